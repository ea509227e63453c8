"""Claims: what a condition says, the verdict, what decides, agreement with a printed number."""

import importlib
import itertools
import math
import pkgutil

import attrs
import numpy as np
import pytest

from seanav import studies
from seanav.claims import (
    CONFIRMATION,
    VERDICTS,
    Claim,
    Condition,
    agreement,
    agrees,
    by_groups,
    changed,
    decisive,
    judged,
    told,
    verdict,
)
from seanav.estimates import Estimate, exact, from_influence, root_mean_square

STUDIES = [module.name for module in pkgutil.iter_modules(studies.__path__)]


def between(low, high):
    return Estimate((low + high) / 2, low, high, (high - low) / 4, 100)


# ---------------------------------------------------------------- verdicts


@pytest.mark.parametrize(
    ("interval", "outcome"),
    [
        ((0.1, 0.9), "holds"),
        ((0.5, 1.0), "holds"),  # the end belongs to the region
        ((0.9, 1.1), "undecided"),
        ((1.0, 1.1), "undecided"),
        ((1.1, 1.2), "fails"),
    ],
)
def test_condition_looks_at_the_whole_interval(interval, outcome):
    assert Condition("c", between(*interval), high=1.0).outcome == outcome
    # The same mirrored: a claim of "at least".
    mirrored = between(-interval[1], -interval[0])
    assert Condition("c", mirrored, low=-1.0).outcome == outcome


def test_condition_between_two_bounds():
    assert Condition("c", between(1, 2), 0, 3).outcome == "holds"
    assert Condition("c", between(-1, 4), 0, 3).outcome == "undecided"
    assert Condition("c", between(4, 5), 0, 3).outcome == "fails"
    assert Condition("c", between(-5, -4), 0, 3).outcome == "fails"


def test_condition_of_an_estimate_from_runs():
    estimate = from_influence(1.0, np.random.default_rng(1).normal(0, 0.1, 1000))
    assert Condition("c", estimate, low=0.9).outcome == "holds"


HOLDS = Condition("near", between(1, 2), low=0)
FAILS = Condition("far", between(-2, -1), low=0)
OPEN = Condition("between", between(-1, 1), low=0)
ASIDE = attrs.evolve(FAILS, what="printed", aside="printed table")
MISSING = Condition("other", "an IMM at 2 m/s was not run", low=0)


def test_verdict_of_every_set_of_outcomes():
    """All 8 sets of the three outcomes, written out from the definition of the words."""
    expected = {
        (): "cannot be tested",
        ("holds",): "reproduced",
        ("fails",): "not reproduced",
        ("undecided",): "undecided",
        ("holds", "fails"): "mixed",
        ("holds", "undecided"): "undecided",
        ("fails", "undecided"): "not reproduced",
        ("holds", "fails", "undecided"): "mixed",
    }
    assert set(expected.values()) == set(VERDICTS)
    for outcomes, word in expected.items():
        for order in itertools.permutations(outcomes * 2):
            assert verdict(order) == word


def test_what_is_shown_aside_or_was_not_run_does_not_count():
    claim = judged(Claim("9.1", "q", "s", "r"), [HOLDS, ASIDE, MISSING], "basis")
    assert claim["verdict"] == "reproduced"
    assert (claim["holds"], claim["fails"], claim["undecided"]) == (1, 0, 0)
    assert claim["conditions"][1]["aside"] == "printed table"
    assert claim["conditions"][1]["outcome"] == "fails"  # it is shown
    assert claim["conditions"][2]["aside"] == "an IMM at 2 m/s was not run"
    assert claim["conditions"][2]["value"] is None
    nothing = judged(Claim("9.1", "q", "s", "r"), [ASIDE, MISSING], "basis")
    assert nothing["verdict"] == "cannot be tested"
    assert nothing["decisive"] is None
    assert told("9.1", nothing)[0] == "9.1 cannot be tested: basis"


def test_a_condition_that_changes_with_the_seed_is_undecided():
    moved = attrs.evolve(HOLDS, confirmed=False)
    assert (moved.outcome, moved.judged) == ("holds", "undecided")
    claim = judged(Claim("9.1", "q", "s", "r"), [moved], "basis")
    assert claim["verdict"] == "undecided"
    assert "undecided: changes with the seed" in told("9.1", claim)[-1]


def test_the_worst_condition_decides():
    near = Condition("barely", between(0.99, 1.0), high=1.02)
    far = Condition("well", between(0.4, 0.5), high=1.02)
    assert decisive([far, near]).what == "barely"
    assert decisive([near, far, OPEN]).what == "between"
    assert decisive([near, OPEN, FAILS, ASIDE]).what == "far"
    worse = Condition("farther", between(-9, -8), low=0)
    assert decisive([FAILS, worse]).what == "farther"
    # In parts of the end: 30 m over 100 m is worse than 2 over 10.
    metres = Condition("m", between(125, 135), high=100.0)
    ratio = Condition("r", between(11.9, 12.1), high=10.0)
    assert decisive([ratio, metres]).what == "m"
    lost = Condition("lost", root_mean_square(np.array([1.0, math.inf])), high=1.0)
    assert decisive([metres, lost]).what == "lost"
    assert decisive([ASIDE, MISSING]) is None


def test_margin_is_the_distance_to_the_nearer_end():
    assert Condition("c", exact(0.9), 0.5, 1.0).margin == pytest.approx(0.1)
    assert Condition("c", exact(0.6), 0.5, 1.0).margin == pytest.approx(0.2)
    assert Condition("c", exact(1.2), 0.5, 1.0).margin == pytest.approx(-0.2)
    assert Condition("c", exact(-0.3), low=0.0).margin == pytest.approx(-0.3)
    assert Condition("c", exact(5.0)).margin == math.inf


def test_groups_say_where():
    north, south = (attrs.evolve(c, group=g) for c, g in ((HOLDS, "north"), (FAILS, "south")))
    more = attrs.evolve(OPEN, group="north")
    found = by_groups([north, south, more, attrs.evolve(ASIDE, group="west")])
    assert found == {"north": ["holds", "undecided"], "south": ["fails"]}


@pytest.mark.parametrize("text", ["", "x" * 181])
def test_words_of_a_claim_fit_a_row(text):
    with pytest.raises(ValueError, match=r"claim 9\.1: quote has"):
        Claim("9.1", text, "s", "r")
    with pytest.raises(ValueError, match=r"claim 9\.1: reading has"):
        Claim("9.1", "q", "s", text)


def test_changed_conditions_are_read_from_the_confirmation(tmp_path):
    assert changed(tmp_path, "9_tiny") == set()
    path = tmp_path / CONFIRMATION
    path.parent.mkdir()
    path.write_text(
        "paper,claim,condition,seed,outcome,again\n"
        "9_tiny,9.1,near,5,holds,holds\n"
        '9_tiny,9.2,"far, north",5,holds,undecided\n'
        "8_other,9.1,near,5,holds,fails\n",
        encoding="utf-8",
    )
    assert changed(tmp_path, "9_tiny") == {("9.2", "far, north")}


# ---------------------------------------------------------------- agreement


def test_agreement_is_two_standard_errors_of_the_log_difference():
    ours = Estimate(10.0, 9.0, 11.0, 0.3, 100)
    limit = 2 * math.sqrt(0.03**2 + 0.03**2)
    assert agrees(10.0 * math.exp(0.999 * limit), ours)
    assert agrees(10.0 * math.exp(-0.999 * limit), ours)
    assert not agrees(10.0 * math.exp(1.001 * limit), ours)
    assert not agrees(10.0 * math.exp(-1.001 * limit), ours)
    # The paper ran fewer runs: its error counts with its own size.
    limit = 2 * math.sqrt(0.03**2 + 0.06**2)
    assert agrees(10.0 * math.exp(0.999 * limit), ours, paper_runs_se=0.6)
    assert not agrees(10.0 * math.exp(1.001 * limit), ours, paper_runs_se=0.6)


def test_agreement_of_numbers_without_a_logarithm():
    assert not agrees(-1.0, between(0.9, 1.1))
    assert not agrees(0.0, between(0.9, 1.1))
    assert not agrees(1.0, exact(0.0))
    assert agrees(0.0, exact(0.0))
    assert agrees(-1.0, Estimate(-1.01, -1.1, -0.9, 0.05, 10))


def test_agreement_of_two_samples_of_one_truth_is_about_95_percent():
    rng = np.random.default_rng(5)

    def rmse():
        return root_mean_square(rng.normal(0, 3.0, 300) ** 2)

    share = np.mean([agrees(rmse().value, rmse()) for _ in range(1000)])
    assert 0.93 < share < 0.975
    # Negative control: a tenth more is seen often.
    assert np.mean([agrees(1.1 * rmse().value, rmse()) for _ in range(1000)]) < 0.75


@pytest.mark.parametrize("paper_runs_se", [None, 0.6])
@pytest.mark.parametrize("printed", [9.0, 9.2, 9.4, 10.0, 10.6, 10.9, 11.0, 12.0])
def test_the_region_of_an_agreement_says_what_agrees_says(printed, paper_runs_se):
    for sign in (1, -1):
        ours = Estimate(sign * 10.0, sign * 10 - 0.6, sign * 10 + 0.6, 0.3, 100)
        found = agreement("c", sign * printed, ours, paper_runs_se, unit="m", group="g")
        assert found.outcome == (
            "holds" if agrees(sign * printed, ours, paper_runs_se) else "fails"
        )
        assert (found.unit, found.group) == ("m", "g")
        assert agreement("c", -sign * printed, ours).outcome == "fails"


def test_agreement_of_exact_and_of_diverged_numbers():
    assert agreement("c", 3.0, exact(3.0)).outcome == "holds"
    assert agreement("c", 3.0, exact(3.1)).outcome == "fails"
    lost = root_mean_square(np.array([1.0, math.inf]))
    assert agreement("c", 3.0, lost).outcome == "fails"


@pytest.mark.parametrize("study", STUDIES)
def test_one_claim_of_each_paper_is_its_main_one(study):
    claims = importlib.import_module(f"seanav.studies.{study}.claims").CLAIMS
    assert [claim.stated for claim in claims if claim.main] == [True]


def test_a_number_is_shown_with_as_many_digits_as_tell_it_from_the_end_of_its_region():
    near = Estimate(1.00021, 1.00002, 1.0004, 1e-4, 9)
    assert Condition("near", near, low=1.0).shown == "1.00021 [1.00002, 1.00040]"
    assert Condition("far", near, low=2.0).shown == "1.00 [1.00, 1.00]"
    assert Condition("equal", exact(1.0), low=1.0).shown == "1.00"
    assert Condition("closer", exact(1.0 + 1e-12), low=1.0).shown == "1.00000"


def test_a_condition_that_its_value_decides_says_so():
    assert Condition("x", exact(1.0), 0.5, 2.0).claimed == "at least 0.500 and at most 2.00"
    found = agreement("x", 1.0, Estimate(1.1, 0.9, 1.3, 0.1, 9))
    assert found.claimed.endswith("(the value alone)")
    assert found.outcome == "holds"
