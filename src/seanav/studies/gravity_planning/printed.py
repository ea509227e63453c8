"""What paper 5 prints, and our numbers beside it."""

import numpy as np
from scipy.stats import kendalltau

from seanav import estimates
from seanav.models.units import KM
from seanav.report import Report
from seanav.studies.gravity_planning.scenario import Scenario
from seanav.studies.gravity_planning.scores import Score

# Sum of RMSE in km as printed, columns R = 1, 2, 3, 4 mGal (Tables 2 and 3).
SUMS_KM = {
    1: {
        "Planned": (8.1, 14.4, 20.9, 27.4),
        "Direct": (12.8, 22.8, 33.4, 44.6),
        "L3": (21.6, 38.0, 56.0, 75.6),
        "L4": (19.5, 34.3, 50.4, 67.1),
        "L5": (13.8, 24.6, 36.3, 49.2),
        "L6": (10.0, 17.7, 25.7, 34.0),
        "L7": (9.5, 16.7, 24.0, 31.4),
        "L8": (9.0, 15.7, 22.5, 29.3),
        "L9": (9.6, 16.8, 24.2, 31.7),
    },
    2: {
        "Planned": (30.4, 41.8, 54.6, 68.1),
        "Direct": (66.4, 78.5, 93.3, 110.0),
        "L3": (40.0, 55.4, 73.2, 92.5),
        "L4": (31.3, 43.4, 56.6, 70.7),
        "L5": (35.8, 46.7, 59.0, 72.2),
        "L6": (41.5, 54.3, 68.7, 84.7),
        "L7": (54.1, 67.6, 84.5, 104.0),
        "L8": (52.5, 64.2, 79.4, 97.1),
        "L9": (53.9, 68.6, 86.3, 106.0),
        "L10": (49.3, 62.8, 80.5, 101.0),
        "L11": (44.7, 63.0, 84.3, 108.0),
        "L12": (50.0, 67.7, 89.0, 112.2),
    },
}

NOISE_MGAL = (1.0, 2.0, 3.0, 4.0)
RUNS = 1000  # Table 1
ANOTHER_MAP = "another map: the paper does not name the place of its own"


def table_1(scenario: Scenario) -> list:
    """Return Table 1 as rows (parameter, printed, used)."""
    return [
        ("speed V", "5 m/s", f"{scenario.speed:g} m/s"),
        ("initial covariance P0", "diag(1, 1) km²/s", f"diag({scenario.initial_std_km**2:g}) km²"),
        (
            "process noise Q",
            "diag(0.01, 0.01)² m²/s",
            f"{scenario.process_noise**2:g} m²/s per axis",
        ),
        ("measurement noise R", "4 mGal²", f"{scenario.planning_noise_mgal**2:g} mGal²"),
        ("map resolution", "1 km", "the map's spacing, 1 km by default"),
        ("Monte-Carlo runs", "1000", str(scenario.runs)),
    ]


def in_km(estimate: estimates.Estimate) -> estimates.Estimate:
    """Return an `Estimate` in km from one in m."""
    ends = estimate.low / KM, estimate.high / KM
    return estimates.Estimate(estimate.value / KM, *ends, estimate.se / KM, estimate.count)


def paper_se(scenario: Scenario, ours: estimates.Estimate) -> float:
    """Return the standard error (km) of the paper's number: its runs match no moments.

    `ours` is our number (m) with the interval of `Score.drawn`.
    """
    return ours.se / KM * float(np.sqrt(scenario.runs / RUNS))


def sums_table(scenario: Scenario, scores: dict[str, list[Score]]) -> tuple:
    """Return columns and rows of Table 2 or 3: sum of RMSE in km with its interval per noise."""
    columns = ["path"]
    for mgal in scenario.noise_mgal:
        columns += [f"R_{mgal:g}", f"low_{mgal:g}", f"high_{mgal:g}"]
    rows = []
    for name, row in scores.items():
        totals = [in_km(one.total) for one in row]
        rows.append([name, *(x for one in totals for x in (one.value, one.low, one.high))])
    return columns, rows


def compare(
    report: Report, scenario: Scenario, test: int, scores: dict[str, list[Score]]
) -> tuple[int, ...]:
    """Put every printed cell of a test beside ours; return how many agree, and how many there are.

    A cell has no partner when the scenario has no such path or noise level; it is left out.
    """
    agreeing = []
    for name, cells in SUMS_KM[test].items():
        for mgal, printed in zip(NOISE_MGAL, cells, strict=True):
            if name in scores and mgal in scenario.noise_mgal:
                one = scores[name][scenario.noise_mgal.index(mgal)]
                numbers = printed, in_km(one.total), paper_se(scenario, one.drawn.total)
                column = f"R_{mgal:g}_mgal"
                agree = report.deviation(str(test + 1), name, column, *numbers, why=ANOTHER_MAP)
                agreeing.append(agree)
    return sum(agreeing), len(agreeing)


def rank_stability(test: int) -> float:
    """Return Kendall's tau between the order of the paths at 1 and at 4 mGal, as printed."""
    cells = np.array(list(SUMS_KM[test].values()))
    return float(kendalltau(cells[:, 0], cells[:, -1]).statistic)


def gain_growth(test: int, reading: str) -> float:
    """Return the growth of the gain as `scores.growth` does, of the printed table."""
    planned, direct = (np.array(SUMS_KM[test][name]) for name in ("Planned", "Direct"))
    gains = np.log(direct / planned) if reading == "relative" else direct - planned
    return float(gains[-1] - gains[0])


def noise_growth(scenario: Scenario, test: int, known: list[Score], held: list[Score]) -> list:
    """Return rows (test, mGal, printed, known, held): sums over that at the least noise.

    `known` and `held` are the planned path's scores per noise level, with the filter knowing
    the noise and holding on to the planning noise. `printed` is None where the paper prints
    no sum for the level, or none for the least one.
    """
    sums = dict(zip(NOISE_MGAL, SUMS_KM[test]["Planned"], strict=True))
    least = sums.get(scenario.noise_mgal[0])
    rows = []
    for mgal, one, other in zip(scenario.noise_mgal, known, held, strict=True):
        printed = sums[mgal] / least if least and mgal in sums else None
        ours = one.total.value / known[0].total.value
        rows.append((test, mgal, printed, ours, other.total.value / held[0].total.value))
    return rows
