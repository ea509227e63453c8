"""Numbers from Monte Carlo runs with their 95 % intervals; nothing here knows a paper."""

import math
from dataclasses import dataclass
from numbers import Integral
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from seanav.checks import integer

LEVEL = 0.95
ROUNDING = 1e-9  # more than rounding leaves of a 0 among numbers near 1


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % confidence interval.

    A score of a filter that diverged is infinite, and so are the ends of its interval.

    Attributes
    ----------
    value, low, high : float
        Point estimate and ends of the interval, in the unit of the number.
    se : float
        Standard error in the same unit; 0 for an exact number.
    count : int
        Number of independent runs; 0 for an exact number.

    Raises
    ------
    ValueError
        If some numbers are not finite or the interval does not contain the value.
    """

    value: float
    low: float
    high: float
    se: float
    count: int

    @property
    def diverged(self) -> bool:
        """Whether there is no finite number."""
        return self.value == math.inf

    def __post_init__(self):
        numbers = (self.value, self.low, self.high, self.se)
        if numbers == (math.inf,) * 4:
            return
        if not all(map(math.isfinite, numbers)) or not self.low <= self.value <= self.high:
            raise ValueError(f"not an estimate with its interval: {self}")


# The number of a filter that diverged, where it has no runs to count.
DIVERGED = Estimate(*(math.inf,) * 4, 0)


def exact(value: float, rounding: float = 0.0) -> Estimate:
    """Return a number that is computed without sampling.

    One that is 0 but for `rounding` is 0: what rounding leaves is another on every machine.
    """
    value = 0.0 if abs(value) < rounding else float(value)
    return Estimate(value, value, value, 0.0, 0)


def significant(x: float | Estimate, digits: int = 3) -> str:
    """Return `x` rounded to `digits` significant digits; an estimate with its interval.

    Integers are printed in full. The one helper for every printed number: what it
    prints is the same on every machine.
    """
    if isinstance(x, Estimate) and x.diverged:
        return "diverges"
    if isinstance(x, Estimate):
        value, low, high = (significant(float(y), digits) for y in (x.value, x.low, x.high))
        return value if x.low == x.high else f"{value} [{low}, {high}]"
    if isinstance(x, Integral):
        return str(int(x))
    x = float(x)
    if not math.isfinite(x):
        return str(x)
    if x == 0.0:
        return "0"
    scientific = f"{x:.{digits - 1}e}"
    exponent = int(scientific.partition("e")[2])
    if -4 <= exponent < 6:
        return f"{float(scientific):.{max(digits - 1 - exponent, 0)}f}"
    return scientific


# ---------------------------------------------------------------- the delta method


class Statistic:
    """A smooth function of means over runs, with what each run contributes to its error.

    The delta method as arithmetic: sums, products, quotients, powers, logarithms of such
    numbers are such numbers again, so the interval of any score follows from how the score
    is written. Two scores of the same runs (common random numbers) are paired by
    themselves: their contributions are added run by run before the spread is taken. The
    standard error is the standard deviation of the contributions over √runs.

    Attributes
    ----------
    value : float or ndarray, shape S
    influence : ndarray, shape (runs, *S)
        Contribution of each run to the error of `value`; its mean is 0.

    References
    ----------
    A. W. van der Vaart, *Asymptotic Statistics*, Cambridge University Press, 1998,
    chapters 3 and 20; Student's t quantile in place of the normal one.

    Examples
    --------
    >>> error, reference = rms(a), rms(b)  # doctest: +SKIP
    >>> (error / reference).estimate()  # doctest: +SKIP
    """

    __array_ufunc__ = None  # an array on the left leaves the operation to us

    def __init__(self, value, influence):
        self.value, self.influence = value, np.asarray(influence, dtype=float)

    def _through(self, value: ArrayLike, slope: ArrayLike) -> Self:
        return type(self)(value, slope * self.influence)

    def __neg__(self) -> Self:
        return self._through(-self.value, -1.0)

    def __add__(self, other: Self | float) -> Self:
        if not isinstance(other, Statistic):
            return self._through(self.value + other, 1.0)
        return type(self)(self.value + other.value, self.influence + other.influence)

    def __sub__(self, other: Self | float) -> Self:
        return self + -other

    def __rsub__(self, other: float) -> Self:
        return -self + other

    def __mul__(self, other: Self | float) -> Self:
        if not isinstance(other, Statistic):
            return self._through(self.value * other, other)
        influence = other.value * self.influence + self.value * other.influence
        return type(self)(self.value * other.value, influence)

    def __truediv__(self, other: Self | float) -> Self:
        if not isinstance(other, Statistic):
            return self._through(self.value / other, 1.0 / other)
        quotient = self.value / other.value
        return type(self)(quotient, (self.influence - quotient * other.influence) / other.value)

    def __rtruediv__(self, other: float) -> Self:
        return other * self**-1.0

    def __pow__(self, power: float) -> Self:
        return self._through(self.value**power, power * self.value ** (power - 1.0))

    __radd__, __rmul__ = __add__, __mul__

    def sqrt(self) -> Self:
        """Return the square root; that of 0 is exact."""
        root = np.sqrt(self.value)
        slope = np.divide(0.5, root, out=np.zeros_like(root), where=root != 0)
        return self._through(root, slope)

    def log(self) -> Self:
        """Return the natural logarithm."""
        return self._through(np.log(self.value), 1.0 / self.value)

    def sum(self) -> Self:
        """Return the sum over all entries of `value`."""
        runs = len(self.influence)
        return type(self)(np.sum(self.value), self.influence.reshape(runs, -1).sum(axis=1))

    def mean(self) -> Self:
        """Return the mean over all entries of `value`."""
        return self.sum() / np.size(self.value)

    def __getitem__(self, index: int) -> Self:
        return type(self)(self.value[index], self.influence[:, index])

    def estimate(self) -> Estimate:
        """Return the number with its interval, value ± t · standard error.

        Raises
        ------
        ValueError
            If there are fewer than two runs.
        """
        return from_influence(self.value, self.influence)

    def estimate_of_log(self) -> Estimate:
        """Return the number with the interval of its logarithm: for a ratio of errors."""
        return exponential(self.log().estimate())


def average(samples: np.ndarray) -> Statistic:
    """Return the mean over runs of `samples`, shape (runs, …)."""
    samples = np.asarray(samples, dtype=float)
    if not np.isfinite(samples).all():
        # One run that diverged leaves no mean; NaN says so in all that follows.
        samples = np.where(np.isfinite(samples).all(axis=0), samples, np.nan)
    value = samples.mean(axis=0)
    return Statistic(value, samples - value)


def rms(squares: np.ndarray) -> Statistic:
    """Return the root of the mean over runs of squared errors, shape (runs, …)."""
    return average(squares).sqrt()


def log_ratio(a: np.ndarray, b: np.ndarray) -> Estimate:
    """Return ln(RMS a / RMS b) from paired squared errors (runs,); negative: a is smaller."""
    return (rms(a) / rms(b)).log().estimate()


def ratio(a: np.ndarray, b: np.ndarray) -> Estimate:
    """Return RMS a / RMS b from paired squared errors (runs,), interval of the logarithm."""
    return exponential(log_ratio(a, b))


def exponential(log: Estimate) -> Estimate:
    """Return the exponential of an estimate, its interval's ends with it."""
    if log.diverged:
        return log
    value, low, high = (math.exp(x) for x in (log.value, log.low, log.high))
    return Estimate(value, low, high, value * log.se, log.count)


def over(one: Estimate, number: float) -> Estimate:
    """Return an estimate divided by an exact number above 0."""
    ends = one.low / number, one.high / number
    return Estimate(one.value / number, *ends, one.se / number, one.count)


def from_influence(value: float, influence: np.ndarray) -> Estimate:
    """Return an estimate whose error is the mean of one contribution per run.

    Parameters
    ----------
    value : float
        The estimate.
    influence : ndarray, shape (runs,)
        Contribution of each run to the error, in the unit of `value`; see `Statistic`.
        Where one is not finite, a filter has diverged, and so has the estimate.

    Raises
    ------
    ValueError
        If there are fewer than two runs.
    """
    influence = np.asarray(influence, dtype=float)
    if influence.ndim != 1 or influence.size < 2:
        raise ValueError("need one number for each of at least 2 runs")
    count = influence.size
    if not (math.isfinite(value) and np.isfinite(influence).all()):
        return Estimate(*(math.inf,) * 4, count)
    se = float(np.std(influence, ddof=1)) / math.sqrt(count)
    half = float(stats.t.ppf(0.5 + LEVEL / 2, count - 1)) * se
    value = float(value)
    return Estimate(value, value - half, value + half, se, count)


def mean(samples: np.ndarray) -> Estimate:
    """Return the mean of independent `samples`, shape (runs,), with Student's t interval."""
    return average(samples).estimate()


def root_mean_square(squares: np.ndarray) -> Estimate:
    """Return the root of the mean of `squares`, shape (runs,), one number per run.

    For an RMSE over runs and time hand in each run's mean over time: errors within a
    run are not independent.
    """
    return rms(squares).estimate()


def share(wins: int, count: int) -> Estimate:
    """Return the share of `wins` among `count` independent trials, with Wilson's interval.

    Raises
    ------
    ParameterError
        If `count` is below 1 or `wins` is not between 0 and `count`.

    References
    ----------
    E. B. Wilson, "Probable inference, the law of succession, and statistical
    inference", *Journal of the American Statistical Association* 22 (1927) 209-212.
    """
    count = integer("count", count, at_least=1)
    wins = integer("wins", wins, at_least=0, at_most=count)
    p = wins / count
    z = float(stats.norm.ppf(0.5 + LEVEL / 2))
    centre = (p + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * math.sqrt(p * (1 - p) / count + z**2 / (4 * count**2))
    # At 0 and 1 the interval ends at the value: rounding must not put it outside.
    low, high = min(p, max(0.0, centre - half)), max(p, min(1.0, centre + half))
    return Estimate(p, low, high, math.sqrt(p * (1 - p) / count), count)


def consistency_bounds(degrees: int, runs: int) -> tuple[float, float]:
    """Return the two-sided 95 % bounds of the mean over `runs` of a χ² number.

    For a mean NEES take the number of states as `degrees`, for a mean NIS that of the
    measurements.
    """
    low, high = stats.chi2.ppf([0.5 - LEVEL / 2, 0.5 + LEVEL / 2], degrees * runs) / runs
    return float(low), float(high)
