"""Settings for every pytest run, nbval's included, made before numpy is imported."""

import json
import os
from functools import cache

# One thread per library: no oversubscription, and sums in one order.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{library}_NUM_THREADS"] = "1"
# nbval compares what a cell writes: no progress bar in it (see seanav.montecarlo).
os.environ["SEANAV_PROGRESS"] = ""

# The files whose tests take longest, those first: two processes then end at the same time.
LONGEST = ["test_entries", "test_deaths", "test_notebooks", "test_interrupt", "test_pages"]
LONGEST += ["test_make", "test_any_value", "test_notebook_maps", "test_surroundings"]
LONGEST += ["test_places", "test_imm_sea_current", "test_ito_filter", "test_run"]


def pytest_collection_modifyitems(items) -> None:
    """Put long files before short ones, and notebooks in the order of their expected times."""
    items.sort(key=lambda item: _place(item.path))


@cache
def _place(path):
    if path.suffix == ".ipynb":
        about = json.loads(path.read_text(encoding="utf-8"))["metadata"].get("seanav", {})
        return -about.get("expected_seconds", {}).get("full", 0)
    return LONGEST.index(path.stem) if path.stem in LONGEST else len(LONGEST)
