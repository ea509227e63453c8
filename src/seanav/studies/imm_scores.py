"""Paper 4: TCEP, its rate, table cells and paired ratios, each with its interval."""

import numpy as np

from seanav import estimates
from seanav.estimates import Estimate

COLUMNS = ("position_m", "velocity_m_s", "levelling_deg", "heading_deg")

# Tables 2 and 3 of the paper, at sigma_T = 0.05 and 1 m/s.
PRINTED = {
    2: {
        "EKF 0.1": (362, 0.411, 0.00353, 0.0221),
        "AFEKF 0.1": (375, 0.418, 0.00361, 0.0222),
        "EKF 0.5": (749, 0.483, 0.00421, 0.0241),
        "AFEKF 0.5": (750, 0.485, 0.00424, 0.0241),
        "IMM-AFEKF 0.1,0.5": (477, 0.435, 0.00374, 0.0228),
    },
    3: {
        "EKF 0.1": (2990, 1.41, 0.0119, 0.0511),
        "AFEKF 0.1": (1820, 0.998, 0.00770, 0.0285),
        "EKF 0.5": (1370, 0.889, 0.00712, 0.0263),
        "AFEKF 0.5": (1330, 0.888, 0.00695, 0.0255),
        "IMM-AFEKF 0.1,0.5": (1370, 0.905, 0.00716, 0.0257),
    },
}
PRINTED_SIGMA = {2: 0.05, 3: 1.0}
PAPER_RUNS = 100
TCEP = 0.589  # of the sum of the two RMS, equation (27)


def squares(mission):
    """Return mean squares over time, (4, runs): position, velocity, levelling, heading (deg²)."""
    north, east, velocity, levelling, heading = mission.means[:5]
    turn = np.degrees(1.0) ** 2
    return np.array([north + east, velocity, turn * levelling, turn * heading])


def cells(mission):
    """Return one row of Tables 2 and 3: four estimates."""
    return [estimates.root_mean_square(row) for row in squares(mission)]


def position_rms(mission):
    """Return the RMS position error in metres, infinite for a filter that blew up."""
    value = float(np.sqrt(squares(mission)[0].mean()))
    return value if np.isfinite(value) else float("inf")


def _tcep(mission):
    """TCEP, equation (27), and its influence per run."""
    value, influence = 0.0, 0.0
    for row in mission.means[:2]:
        root = np.sqrt(row.mean())
        value += TCEP * root
        influence = influence + TCEP * (row - row.mean()) / (2 * root)
    return value, influence


def tcep(mission) -> Estimate:
    """Return 0.589 (RMS north + RMS east) over time and runs, equation (27), m."""
    return estimates.from_influence(*_tcep(mission))


def tcep_log_ratio(mission, other) -> Estimate:
    """Return ln(TCEP / TCEP of the other), runs paired."""
    (a, da), (b, db) = _tcep(mission), _tcep(other)
    return estimates.from_influence(np.log(a / b), da / a - db / b)


def _rate(mission, pure, best):
    (t, dt), (p, dp), (o, do) = _tcep(mission), _tcep(pure), _tcep(best)
    gain, range_ = p - t, p - o
    influence = ((dp - dt) - gain / range_ * (dp - do)) / range_
    return 100 * gain / range_, 100 * influence


def rate(mission, pure, best) -> Estimate:
    """Return the TCEP rate, equation (28), in percent, runs paired."""
    return estimates.from_influence(*_rate(mission, pure, best))


def rate_difference(first, second) -> Estimate:
    """Return the difference of two rates in points; each is (mission, pure, best)."""
    (a, da), (b, db) = _rate(*first), _rate(*second)
    return estimates.from_influence(a - b, da - db)


def advantage_difference(first, second, third, fourth) -> Estimate:
    """Return (rate 1 − rate 2) − (rate 3 − rate 4) in points; each as in `rate_difference`."""
    values = [_rate(*one) for one in (first, second, third, fourth)]
    signs = (1, -1, -1, 1)
    value = sum(s * v for s, (v, _) in zip(signs, values, strict=True))
    influence = sum(s * i for s, (_, i) in zip(signs, values, strict=True))
    return estimates.from_influence(value, influence)


def log_ratios(mission, other):
    """Return ln of the ratios of the four cells, runs paired: four estimates."""
    pairs = zip(squares(mission), squares(other), strict=True)
    return [
        estimates.from_influence(
            0.5 * np.log(a.mean() / b.mean()), 0.5 * (a / a.mean() - b / b.mean())
        )
        for a, b in pairs
    ]


def mode(mission, model=0) -> Estimate:
    """Return the mode probability of one model, mean over time and runs."""
    return estimates.mean(mission.means[9 + model])


def mode_difference(mission, other) -> Estimate:
    """Return the difference of the first mode probability of two missions, runs paired."""
    return estimates.mean(mission.means[9] - other.means[9])


def mode_contrast_difference(mission, other, sign) -> Estimate:
    """Return how much more the modes of `mission` differ, (mu1 − mu2) · sign, than of `other`."""
    return estimates.mean(2 * sign * (mission.means[9] - other.means[9]))


def nis(mission) -> Estimate:
    """Return the mean normalised innovation squared; 1 (per axis) is right."""
    return estimates.mean(mission.means[5])


def nees(mission) -> Estimate:
    """Return the mean normalised estimation error squared over the records; 16 is right."""
    return estimates.mean(mission.means[6])


def mode_curve(mission, model=0):
    """Return the mode probability of one model at each record, mean over runs: estimates."""
    return [estimates.mean(row) for row in mission.series[:, 17 + model]]


def radial_rms(mission):
    """Return the RMS position error (m) at each record: estimates."""
    return [estimates.root_mean_square(row) for row in (mission.series[:, :2] ** 2).sum(axis=1)]


def radial_curves(mission):
    """Return RMS, CEP and TCEP (m) against time, each of shape (records,)."""
    north, east = mission.series[:, 0], mission.series[:, 1]
    rms = np.sqrt((north**2 + east**2).mean(axis=1))
    cep = np.median(np.hypot(north, east), axis=1)
    count = np.arange(1, len(north) + 1)
    squares_ = [np.cumsum((e**2).mean(axis=1)) / count for e in (north, east)]
    return rms, cep, TCEP * (np.sqrt(squares_[0]) + np.sqrt(squares_[1]))


def falls(mission, first, last):
    """Return ln(value at record `last` / at `first`) of the RMS and of the TCEP."""
    squared = mission.series[:, :2] ** 2  # (records, 2, runs)
    at = squared.sum(axis=1)
    a, b = at[first], at[last]
    rms = estimates.from_influence(
        0.5 * np.log(b.mean() / a.mean()), 0.5 * (b / b.mean() - a / a.mean())
    )
    values, influences = [], []
    for record in (first, last):
        mean = squared[: record + 1].mean(axis=0)  # (2, runs)
        root = np.sqrt(mean.mean(axis=1, keepdims=True))
        values.append(root.sum())
        influences.append(((mean - root**2) / (2 * root)).sum(axis=0) / root.sum())
    tcep_ = estimates.from_influence(np.log(values[1] / values[0]), influences[1] - influences[0])
    return rms, tcep_


def crossing(grid, curve, level):
    """Return where a sampled curve first rises above `level`, by interpolation; None: never."""
    above = np.asarray(curve) > np.asarray(level)
    if not above.any() or above[0]:
        return None
    k = int(np.argmax(above))
    d0, d1 = curve[k - 1] - level[k - 1], curve[k] - level[k]
    return float(grid[k - 1] + (grid[k] - grid[k - 1]) * d0 / (d0 - d1))
