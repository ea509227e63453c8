"""What is kept of a mission: sums over time, and errors, NEES and modes at recorded steps."""

import math
from typing import NamedTuple

import numpy as np

from seanav._compile import kernel
from seanav.filters import imm
from seanav.filters.ins.layout import (
    AT,
    B_A,
    HEADING,
    LANES,
    LATITUDE,
    LONGITUDE,
    METRES_E,
    METRES_N,
    PHI,
    QUATERNION,
    V_E,
    V_N,
    N,
)
from seanav.filters.ins.states import _difference


class MeanSquares(NamedTuple):
    """Squared errors, mean over the steps of a run: each of shape (runs,).

    Attributes
    ----------
    north, east : ndarray
        Position, m².
    velocity : ndarray
        Horizontal, (m/s)².
    levelling : ndarray
        phi_N² + phi_E², rad².
    heading : ndarray
        rad².
    """

    north: np.ndarray
    east: np.ndarray
    velocity: np.ndarray
    levelling: np.ndarray
    heading: np.ndarray


class Series(NamedTuple):
    """What a mission was at its recorded steps; the first record is after `stride` steps.

    Attributes
    ----------
    errors : ndarray (records, 16, runs)
        Estimate minus truth, rows as in `seanav.filters.ins.layout`, position in metres
        north and east. Biases and current are the estimates themselves for pure inertial
        navigation.
    nees : ndarray (records, runs)
        Of all 16 states; zero for pure inertial navigation.
    mode_probability : ndarray (records, models, runs)
    """

    errors: np.ndarray
    nees: np.ndarray
    mode_probability: np.ndarray

    @property
    def north(self) -> np.ndarray:
        """Position error to the north, (records, runs), m."""
        return self.errors[:, LATITUDE]

    @property
    def east(self) -> np.ndarray:
        """Position error to the east, (records, runs), m."""
        return self.errors[:, LONGITUDE]


class Flight(NamedTuple):
    """Missions of one filter, runs last.

    Attributes
    ----------
    mean_squares : MeanSquares
    nis, beta : ndarray (runs,)
        Normalised squared residual and fading factor, weighted by the modes, mean over time.
    squared_nis : ndarray (runs,)
        Mean over time of the squared NIS of the first model.
    nees : ndarray (runs,)
        Mean over the recorded steps; zero without records.
    mode_probability : ndarray (models, runs)
        Mean over time.
    series : Series
    P : ndarray (models, 136, runs)
        Packed covariances at the end, see `seanav.filters.ins.unpack`.
    """

    mean_squares: MeanSquares
    nis: np.ndarray
    beta: np.ndarray
    squared_nis: np.ndarray
    nees: np.ndarray
    mode_probability: np.ndarray
    series: Series
    P: np.ndarray

    def runs(self, count: int) -> "Flight":
        """Return the first `count` runs."""
        return _each_array(lambda array: array[..., :count], self)

    def without_series(self) -> "Flight":
        """Return the flight with the means of its records only: the series fill the memory."""
        return self._replace(series=Series(*(part[:0].copy() for part in self.series)))

    def unrecorded(self) -> "Flight":
        """Return the flight as it is with a stride of zero: without series and NEES."""
        return self.without_series()._replace(nees=np.zeros_like(self.nees))

    @classmethod
    def join(cls, flights: "list[Flight]") -> "Flight":
        """Return the runs of all flights as one."""
        return _each_array(lambda *arrays: np.concatenate(arrays, axis=-1), *flights)


def _each_array(function, *trees):
    """Apply `function` to the corresponding arrays of equally nested named tuples."""
    if not isinstance(trees[0], tuple):
        return function(*trees)
    parts = zip(*trees, strict=True)
    return type(trees[0])(*(_each_array(function, *part) for part in parts))


# Rows of the sums over time; one for each model's probability follows.
NORTH, EAST, VELOCITY, LEVELLING, HEADING_ERROR, NIS, BETA, SQUARED_NIS, MODES = range(9)


def _empty_sums(models: int) -> np.ndarray:
    """Return zeros for `_score` to add to."""
    return np.zeros((MODES + models, LANES))


def _empty_series(models: int, records: int) -> Series:
    """Return zeros for `_record` to fill."""
    errors, nees = np.zeros((records, N, LANES)), np.zeros((records, LANES))
    return Series(errors, nees, np.zeros((records, models, LANES)))


def _flight(sums: np.ndarray, steps: int, series: Series, P: np.ndarray) -> Flight:
    """Return sums over `steps` steps, series and final covariances by their names."""
    means = sums / steps
    return Flight(
        MeanSquares(*means[NORTH : HEADING_ERROR + 1]),
        means[NIS],
        means[BETA],
        means[SQUARED_NIS],
        series.nees.sum(axis=0) / max(len(series.nees), 1),
        means[MODES:],
        series,
        P,
    )


@kernel
def _score(best, truth, mu, nis, beta, sums, true_state, e):
    """Add one step to the sums over time.

    Parameters
    ----------
    best : (17, runs)
        Combined estimate.
    truth : (10,)
        Of this step, see `layout`.
    mu, nis, beta : (models, runs)
    sums : (8 + models, runs), changed
    true_state : (17, runs)
        Workspace, zero below the quaternion.
    e : (16, runs), output
        Error of `best`; biases and current less zero.
    """
    for i in range(QUATERNION + 4):
        for r in range(LANES):
            true_state[i, r] = truth[i]
    _difference(best, true_state, e)
    metres_N, metres_E = truth[METRES_N], truth[METRES_E]
    for r in range(LANES):
        north, east = e[LATITUDE, r] * metres_N, e[LONGITUDE, r] * metres_E
        sums[NORTH, r] += north * north
        sums[EAST, r] += east * east
        sums[VELOCITY, r] += e[V_N, r] * e[V_N, r] + e[V_E, r] * e[V_E, r]
        sums[LEVELLING, r] += e[PHI, r] * e[PHI, r] + e[PHI + 1, r] * e[PHI + 1, r]
        sums[HEADING_ERROR, r] += e[HEADING, r] * e[HEADING, r]
        for j in range(mu.shape[0]):
            sums[NIS, r] += mu[j, r] * nis[j, r]
            sums[BETA, r] += mu[j, r] * beta[j, r]
            sums[MODES + j, r] += mu[j, r]
        sums[SQUARED_NIS, r] += nis[0, r] * nis[0, r]


@kernel
def _record(at, aided, truth, rest, mu, P, e, series, mixing):
    """Put one step into record `at` of `series`, with the NEES if `aided`.

    Parameters
    ----------
    truth : (10,); rest : (9, runs)
        Of this step; the second are true biases and current.
    mu : (models, runs)
    P : (models, 136, runs)
    e : (16, runs), changed
        As `_score` left it.
    series : Series, changed
    mixing : seanav.filters.ins.mission.Mixing
        Deviations of the models as combined, and workspace.
    """
    errors, nees = series.errors[at], series.nees[at]
    if aided:
        for i in range(B_A, N):
            for r in range(LANES):
                e[i, r] -= rest[i - B_A, r]
    errors[:] = e
    for r in range(LANES):
        errors[LATITUDE, r] *= truth[METRES_N]
        errors[LONGITUDE, r] *= truth[METRES_E]
    series.mode_probability[at] = mu
    if aided:
        combined, factor = mixing.P[0], np.empty((N, N + 1))
        if mu.shape[0] > 1:
            imm._mix(mu, mixing.deviations, P, mixing.mean, combined, mixing.centred)
        else:
            combined[:] = P[0]
        for r in range(LANES):
            nees[r] = _squared_error(combined, e, r, factor)


@kernel
def _squared_error(P, e, r, L):
    """Return eᵀ P⁻¹ e of run r, by Cholesky's factor of the correlation matrix.

    P is packed (136, runs), e (16, runs); L (16, 17) is workspace, its last column the error
    in units of its own spread.
    """
    total = 0.0
    for i in range(N):
        di = math.sqrt(P[AT[i, i], r])
        for j in range(i + 1):
            s = P[AT[i, j], r] / (di * math.sqrt(P[AT[j, j], r]))
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = math.sqrt(s) if i == j else s / L[j, j]
        s = e[i, r] / di
        for k in range(i):
            s -= L[i, k] * L[k, N]
        L[i, N] = s / L[i, i]
        total += L[i, N] * L[i, N]
    return total
