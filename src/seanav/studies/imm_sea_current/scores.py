"""Paper 4: TCEP, its rate, table cells and paired ratios, each with its interval.

`flight` is a `seanav.filters.ins.Flight`: what one filter did in all runs.
"""

from collections.abc import Sequence

import numpy as np
from scipy import stats

from seanav import estimates
from seanav.estimates import Estimate, Statistic, rms
from seanav.filters.ins.score import Flight

COLUMNS = ("position_m", "velocity_m_s", "levelling_deg", "heading_deg")
UNITS = ("m", "m/s", "deg", "deg")

LOST = 1e7  # m: a filter that is farther off than from pole to equator has diverged
FEWEST = 15  # runs from which the two slopes of `controlled` can be fitted
TCEP = 0.589  # of the sum of the two RMS, equation (27)


def squares(flight: Flight) -> np.ndarray:
    """Return mean squares over time, (4, runs): position, velocity, levelling, heading (deg²)."""
    means, turn = flight.mean_squares, np.degrees(1.0) ** 2
    position = means.north + means.east
    return np.array([position, means.velocity, turn * means.levelling, turn * means.heading])


def cells(flight: Flight) -> list[Estimate]:
    """Return one row of Tables 2 and 3: four estimates."""
    return [estimates.root_mean_square(row) for row in squares(flight)]


def position_rms(flight: Flight) -> float:
    """Return the RMS position error in metres, infinite for a filter that blew up."""
    value = float(np.sqrt(squares(flight)[0].mean()))
    return value if np.isfinite(value) else float("inf")


def diverged(flight: Flight) -> bool:
    """Return whether a filter lost the vehicle or its own numbers, in any run."""
    numbers = (*flight.mean_squares, flight.nis, flight.nees, flight.beta, flight.mode_probability)
    finite = all(np.isfinite(part).all() for part in numbers)
    return not (finite and position_rms(flight) < LOST)


def _tcep(flight: Flight) -> Statistic:
    return TCEP * (rms(flight.mean_squares.north) + rms(flight.mean_squares.east))


def tcep(flight: Flight) -> Estimate:
    """Return 0.589 (RMS north + RMS east) over time and runs, equation (27), m."""
    return _tcep(flight).estimate()


def tcep_ratio(flight: Flight, other: Flight) -> Estimate:
    """Return TCEP / TCEP of the other, runs paired."""
    return estimates.exponential((_tcep(flight) / _tcep(other)).log().estimate())


def controlled(number: Statistic, controls: Sequence[tuple[Statistic, float]]) -> Statistic:
    """Return `number` without the sampling error that it shares with known numbers.

    Each control is a number of the same runs whose exact value is known. What the runs
    happened to add to it is known too, and so is, by regression of the contributions of the
    runs, the part of it that went into `number`: it is subtracted. Beside its bias of order
    1/runs the result is that of many more runs.

    Parameters
    ----------
    number : Statistic
    controls : sequence of (Statistic, float)
        Numbers of the same runs, and their exact values.

    References
    ----------
    P. Glasserman, *Monte Carlo Methods in Financial Engineering*, Springer, 2004,
    section 4.1.
    """
    runs, count = len(number.influence), len(controls)
    shared = np.stack([control.influence for control, _ in controls], axis=1)
    slopes = np.linalg.lstsq(shared, number.influence, rcond=None)[0]
    chance = np.array([control.value - known for control, known in controls])
    spread = np.sqrt((runs - 1) / (runs - 1 - count))  # degrees of freedom of the fit
    return Statistic(number.value - slopes @ chance, spread * (number.influence - shared @ slopes))


def _rate(flight: Flight, pure: Flight, best: Flight, exact: Sequence | None = None) -> Statistic:
    number, without, least = (_tcep(one) for one in (flight, pure, best))
    if exact is None or len(number.influence) < FEWEST:
        return 100 * (without - number) / (without - least)
    number = controlled(number, list(zip((without, least), exact, strict=True)))
    return 100 * (exact[0] - number) / (exact[0] - exact[1])


def rate(flight: Flight, pure: Flight, best: Flight, exact: Sequence | None = None) -> Estimate:
    """Return the TCEP rate, equation (28), in percent, runs paired.

    `exact` holds the TCEPs (m) of `pure` and `best` where they are known without sampling:
    they stand in the rate, and take their share out of the error of `flight` (`controlled`).
    """
    return _rate(flight, pure, best, exact).estimate()


def rate_difference(first: tuple, second: tuple) -> Estimate:
    """Return the difference of two rates in points; each as the arguments of `rate`."""
    return (_rate(*first) - _rate(*second)).estimate()


def advantage_difference(
    first: tuple,
    second: tuple,
    third: tuple,
    fourth: tuple,
) -> Estimate:
    """Return (rate 1 − rate 2) − (rate 3 − rate 4) in points; each as in `rate_difference`."""
    one, two, three, four = (_rate(*each) for each in (first, second, third, fourth))
    return (one - two - (three - four)).estimate()


def ratio(flight: Flight, other: Flight, column: int) -> Estimate:
    """Return the ratio of one of the four cells, runs paired."""
    pair = squares(flight)[column], squares(other)[column]
    return estimates.ratio(*pair)


def mode(flight: Flight, model: int = 0) -> Estimate:
    """Return the mode probability of one model, mean over time and runs."""
    return estimates.mean(flight.mode_probability[model])


def mode_difference(flight: Flight, other: Flight) -> Estimate:
    """Return the difference of the first mode probability of two flights, runs paired."""
    return estimates.mean(flight.mode_probability[0] - other.mode_probability[0])


def mode_contrast_difference(flight: Flight, other: Flight, sign: int) -> Estimate:
    """Return how much more the modes of `flight` differ, (mu1 − mu2) · sign, than of `other`."""
    return estimates.mean(2 * sign * (flight.mode_probability[0] - other.mode_probability[0]))


def nis(flight: Flight) -> Estimate:
    """Return the mean normalised innovation squared; 1 (per axis) is right."""
    return estimates.mean(flight.nis)


def nees(flight: Flight) -> Estimate:
    """Return the mean normalised estimation error squared over the records; 16 is right."""
    return estimates.mean(flight.nees)


def mode_curve(flight: Flight, model: int = 0) -> list[Estimate]:
    """Return the mode probability of one model at each record, mean over runs."""
    return [estimates.mean(row) for row in flight.series.mode_probability[:, model]]


def radial_rms(flight: Flight) -> list[Estimate]:
    """Return the RMS position error (m) at each record."""
    radial = flight.series.north**2 + flight.series.east**2
    return [estimates.root_mean_square(row) for row in radial]


def radial_curves(flight: Flight) -> tuple[np.ndarray, ...]:
    """Return RMS, CEP and TCEP (m) against time, each of shape (records,)."""
    north, east = flight.series.north, flight.series.east
    radial = np.sqrt((north**2 + east**2).mean(axis=1))
    cep = np.median(np.hypot(north, east), axis=1)
    count = np.arange(1, len(north) + 1)
    running = [np.sqrt(np.cumsum((e**2).mean(axis=1)) / count) for e in (north, east)]
    return radial, cep, TCEP * (running[0] + running[1])


def radial_bands(flight: Flight) -> dict[str, list[Estimate]]:
    """Return RMS, CEP and TCEP (m) at each record with their intervals, runs as samples.

    The interval of the CEP, a median, has two of the sorted errors as its ends: each lies on
    its side of the true median with a probability of at least 97.5 %.
    """
    _, cep, _ = radial_curves(flight)
    squared = np.stack([flight.series.north**2, flight.series.east**2])  # (2, records, runs)
    sizes = np.sort(np.sqrt(squared.sum(axis=0)), axis=1)
    records, runs = sizes.shape
    first = max(int(stats.binom.ppf(0.025, runs, 0.5)) - 1, 0)
    ends = sizes[:, first], sizes[:, runs - 1 - first]
    medians = [
        Estimate(float(m), float(low), float(high), float(high - low) / 4, runs)
        for m, low, high in zip(cep, *ends, strict=True)
    ]
    count = np.arange(1, records + 1)[:, None]
    north, east = (rms((np.cumsum(part, axis=0) / count).T) for part in squared)
    running = TCEP * (north + east)
    return {
        "RMS": radial_rms(flight),
        "CEP": medians,
        "TCEP": [running[k].estimate() for k in range(records)],
    }


def falls(flight: Flight, first: int, last: int) -> tuple[Estimate, Estimate]:
    """Return value at record `last` / at `first` of the RMS and of the TCEP."""
    squared = np.stack([flight.series.north**2, flight.series.east**2])  # (2, records, runs)
    radial = squared.sum(axis=0)
    swing = estimates.ratio(radial[last], radial[first])
    before, after = (rms(squared[:, : k + 1].mean(axis=1).T).sum() for k in (first, last))
    return swing, estimates.exponential((after / before).log().estimate())


def crossing(grid: np.ndarray, curve: list[float], level: np.ndarray) -> float | None:
    """Return where a sampled curve first rises above `level`, by interpolation; None: never."""
    above = np.asarray(curve) > np.asarray(level)
    if not above.any() or above[0]:
        return None
    k = int(np.argmax(above))
    d0, d1 = curve[k - 1] - level[k - 1], curve[k] - level[k]
    return float(grid[k - 1] + (grid[k] - grid[k - 1]) * d0 / (d0 - d1))
