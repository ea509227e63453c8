"""Each notebook in full with many sets of parameters: `make soak` runs this, `make test` not."""

import pytest
from cells import SMALL, refusal
from sets import REFUSED, RUNS, covering, factors


def sets(stem):
    """Return {name: (changes, whether the first cell is to refuse them)}."""
    rows = [
        {name: value for level in row.values() for name, value in level.items()}
        for row in covering(factors(stem))
    ]
    named = {f"pairs {k}": (row, False) for k, row in enumerate(rows, 1)}
    for refused, listed in ((False, RUNS), (True, REFUSED)):
        named |= {str(changes): (changes, refused) for changes in listed[stem]}
    return named


@pytest.mark.parametrize(
    ("stem", "changes", "refused"),
    [
        pytest.param(stem, *case, id=f"{stem}-{name}")
        for stem in SMALL
        for name, case in sets(stem).items()
    ],
)
def test_a_notebook_runs_to_its_end_or_its_first_cell_says_no(stem, changes, refused, tmp_path):
    said = refusal(stem, changes, tmp_path)
    assert bool(said) == refused, said or "not refused"
    print(f"soak {stem}: refused: {said}" if said else f"soak {stem}: run")
