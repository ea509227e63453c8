"""Missions: one EKF, or the IMM of several, flown for a batch of runs.

The cycle of one second is the loop of `_mission`: interact, predict, adapt, update, combine,
score. `seanav.filters.ins.reference` is the same for one run in plain numpy.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import ParameterError, array, choice, integer, number
from seanav.filters import fading, imm
from seanav.filters.ins.layout import (
    AT,
    B_A,
    COEFFICIENTS,
    LANES,
    NOMINAL,
    PACKED,
    QUATERNION,
    TRUTH,
    WORKSPACE,
    N,
)
from seanav.filters.ins.predict import _predict_covariance, _predict_state
from seanav.filters.ins.score import (
    Flight,
    Series,
    _empty_series,
    _empty_sums,
    _flight,
    _record,
    _score,
)
from seanav.filters.ins.states import _difference, _shift
from seanav.filters.ins.update import LINEARISED, SEEN, _adapt, _update


class Settings(NamedTuple):
    """Numbers of a mission, see `fly`."""

    models: int
    height: float
    dt: float
    R: float
    window: int
    cap: float
    velocity_noise: float
    attitude_noise: float
    aided: bool
    about: int
    stride: int


class Sensors(NamedTuple):
    """What is sensed: see `fly`."""

    theta: np.ndarray
    dv: np.ndarray
    z: np.ndarray


class Truth(NamedTuple):
    """What is true: see `fly`; `rest` is there called `true_rest`."""

    states: np.ndarray
    rest: np.ndarray


class Models(NamedTuple):
    """Models of the current: decay, process noise variance, fading form; their chain T."""

    decay: np.ndarray
    variance: np.ndarray
    forms: np.ndarray
    T: np.ndarray


class Filters(NamedTuple):
    """The filters of all models: states, packed covariances, mode probabilities."""

    x: np.ndarray  # (models, 17, LANES)
    P: np.ndarray  # (models, 136, LANES)
    mu: np.ndarray  # (models, LANES)


class Mixing(NamedTuple):
    """Workspace of the IMM."""

    predicted: np.ndarray  # (models, LANES), mode probabilities
    weights: np.ndarray  # (models, models, LANES)
    deviations: np.ndarray  # (models, 16, LANES), of the models' states from a common point
    mean: np.ndarray  # (16, LANES)
    centred: np.ndarray  # (16, LANES)
    P: np.ndarray  # (models, 136, LANES)


class Work(NamedTuple):
    """Workspace of one step."""

    f: np.ndarray  # coefficients of F
    covariance: np.ndarray
    rings: np.ndarray  # (models, window + 3, LANES), see `update.adapt`
    beta: np.ndarray  # (models, LANES)
    gain: np.ndarray  # (LANES,)
    seen: np.ndarray  # see `update`
    nis: np.ndarray  # (models, LANES)
    logs: np.ndarray  # (models, LANES), log likelihoods
    e: np.ndarray  # (16, LANES)
    true_state: np.ndarray  # (17, LANES)
    best: np.ndarray  # (17, LANES), combined estimate


@kernel
def _workspace(models, window):
    # Made in a kernel: numba aligns arrays for vectors, numpy does not.
    mixing = Mixing(
        np.zeros((models, LANES)),
        np.zeros((models, models, LANES)),
        np.zeros((models, N, LANES)),
        np.zeros((N, LANES)),
        np.zeros((N, LANES)),
        np.zeros((models, PACKED, LANES)),
    )
    work = Work(
        np.zeros(COEFFICIENTS * LANES),
        np.zeros(WORKSPACE),
        np.zeros((models, window + 3, LANES)),
        np.ones((models, LANES)),
        np.ones(LANES),
        np.zeros(SEEN),
        np.zeros((models, LANES)),
        np.zeros((models, LANES)),
        np.zeros((N, LANES)),
        np.zeros((NOMINAL, LANES)),
        np.zeros((NOMINAL, LANES)),
    )
    return mixing, work


# ---------------------------------------------------------------- the IMM around the filters


@kernel
def _deviate(x, best, deviations):
    """Write the states of all models as deviations from the first model's, left in `best`."""
    best[:] = x[0]
    for j in range(len(x)):
        _difference(x[j], best, deviations[j])


@kernel
def _interact(T, x, P, mu, best, mixing):
    """Start every filter from the mixture that its model sees: (20)-(22)."""
    predicted, weights, deviations, mean, centred, mixed_P = mixing
    imm._interact(T, mu, predicted, weights)
    _deviate(x, best, deviations)
    for j in range(len(x)):
        imm._mix(weights[j], deviations, P, mean, mixed_P[j], centred)
        x[j] = best
        _shift(x[j], mean, 1.0)
    P[:] = mixed_P


@kernel
def _combine(x, logs, mu, best, mixing):
    """Update the mode probabilities and put the combined state into `best`: (24)-(26)."""
    imm._probabilities(mixing.predicted, logs, mu)
    _deviate(x, best, mixing.deviations)
    imm._mean(mu, mixing.deviations, mixing.mean)
    _shift(best, mixing.mean, 1.0)


# ---------------------------------------------------------------- the loop over the seconds


@kernel
def _mission(settings, sensors, truth, models, filters, sums, series):
    mixing, work = _workspace(settings.models, settings.window)
    # Arrays leave their tuples here, once: each that enters a call in a tuple is counted.
    theta, dv, z = sensors
    decay, variance, forms, T = models
    x, P, mu = filters
    flat_P = P.reshape((len(P), -1))
    f, covariance, rings, beta, gain, seen, nis, logs, e, true_state, best = work
    for step in range(len(z)):
        now = truth.states[step]
        heading = 2.0 * math.atan2(now[QUATERNION + 3], now[QUATERNION])
        if len(x) > 1:
            _interact(T, x, P, mu, best, mixing)

        for j in range(len(x)):
            _predict_state(x[j], theta[step], dv[step], settings, decay[j], f)
            if settings.aided:
                own, q = flat_P[j], variance[j]
                _predict_covariance(own, f, settings, decay[j], q, covariance)
                gain[:] = 1.0
                if forms[j] != fading.NONE:
                    _adapt(
                        *(x[j], own, z[step], step, settings, heading),
                        *(forms[j], q, rings[j], seen, beta[j], gain),
                    )
                _update(x[j], own, z[step], settings, heading, gain, seen, e, nis[j], logs[j])

        if len(x) > 1:
            _combine(x, logs, mu, best, mixing)
        else:
            best[:] = x[0]

        _score(best, now, mu, nis, beta, sums, true_state, e)
        if settings.stride > 0 and (step + 1) % settings.stride == 0:
            at = (step + 1) // settings.stride - 1
            _record(at, settings.aided, now, truth.rest[at], mu, P, e, series, mixing)


# ---------------------------------------------------------------- what is called


def fly(
    theta: ArrayLike, dv: ArrayLike, z: ArrayLike, truth: ArrayLike, x0: ArrayLike, P0: ArrayLike,
    *, height: float, R: float, noise: ArrayLike, forms: Sequence[str],
    velocity_noise: float, attitude_noise: float, transition: ArrayLike, mu0: ArrayLike,
    window: int = 20, cap: float = 10.0, aided: bool = True, about: str = "estimate",
    stride: int = 0, true_rest: ArrayLike | None = None,
) -> Flight:  # fmt: skip
    """Fly one batch of missions with one EKF or the IMM of several.

    Parameters
    ----------
    theta, dv : (steps, 3, LANES)
        Increments as reported, 1 s each (see `seanav.models.inertial.preintegrate`).
    z : (steps, axes, LANES)
        Log at the end of each step, m/s; 1 axis (forward), 2 or 3.
    truth : (steps, 10)
        Latitude, longitude, v_N, v_E, quaternion, metres per radian north and east.
    x0 : (17, LANES); P0 : (models, 136, LANES)
        Nominal state at the start, the same for every model; packed covariances.
    height, R : float
        Height, held, m; noise variance of each axis of the log, (m/s)².
    noise : (models, 2); forms : sequence of str
        Of the current per step: decay a and variance q. Keys of `seanav.filters.fading.FORMS`.
    velocity_noise, attitude_noise : float
        Process noise variance per step, (m/s)² and rad².
    transition : (models, models); mu0 : (models,)
        Of the IMM; of no effect for one model.
    window, cap : int, float
        Of the fading.
    aided : bool
        False: pure inertial navigation.
    about : str
        Where H is linearised, a key of `LINEARISED`: at the estimate; with the attitude
        columns of the true velocity through still water, zero; or wholly at the truth.
    stride : int; true_rest : (steps // stride, 9, LANES)
        Record every so many steps, 0: never; true biases and current then, None: zero.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite or out of its bounds, or a word unknown.
    """
    sizes = {"runs": LANES}
    sensors = _sensors(theta, dv, z, sizes)
    states = array("truth", truth, ("steps", TRUTH), sizes)
    models, filters = _models(noise, forms, transition, sizes), _filters(x0, P0, mu0, sizes)
    trust = (height, R, window, cap, velocity_noise, attitude_noise)
    settings = _settings(sizes, *trust, aided, about, stride)
    rest, series = _records(true_rest, settings, sizes)
    sums = _empty_sums(settings.models)
    _mission(settings, sensors, Truth(states, rest), models, filters, sums, series)
    return _flight(sums, len(states), series, filters.P)


# ---------------------------------------------------------------- checks of what is flown


def _sensors(theta: ArrayLike, dv: ArrayLike, z: ArrayLike, sizes: dict[str, int]) -> Sensors:
    theta = array("theta", theta, ("steps", 3, "runs"), sizes)
    dv = array("dv", dv, ("steps", 3, "runs"), sizes)
    z = array("z", z, ("steps", "axes", "runs"), sizes)
    integer("axes of z", sizes["axes"], at_least=1, at_most=3)
    return Sensors(theta, dv, z)


def _settings(
    sizes: dict[str, int],
    height: float,
    R: float,
    window: int,
    cap: float,
    velocity_noise: float,
    attitude_noise: float,
    aided: bool,
    about: str,
    stride: int,
) -> Settings:
    steps = sizes["steps"]
    return Settings(
        models=sizes["models"],
        height=number("height", height),
        dt=1.0,
        R=number("R", R, above=0),
        window=min(integer("window", window, at_least=1), steps),  # a longer one stays empty
        cap=number("cap", cap, at_least=1),
        velocity_noise=number("velocity_noise", velocity_noise, at_least=0),
        attitude_noise=number("attitude_noise", attitude_noise, at_least=0),
        aided=choice("aided", aided, (True, False)),
        about=LINEARISED[choice("about", about, LINEARISED)],
        stride=min(integer("stride", stride, at_least=0), steps + 1),  # which is never
    )


def _records(
    true_rest: ArrayLike | None, settings: Settings, sizes: dict[str, int]
) -> tuple[np.ndarray, Series]:
    records = sizes["steps"] // settings.stride if settings.stride else 0
    rest = np.zeros((records, N - B_A, LANES))
    if true_rest is not None and records:
        rest = array("true_rest", true_rest, rest.shape)
    return rest, _empty_series(settings.models, records)


def _models(
    noise: ArrayLike, forms: Sequence[str], transition: ArrayLike, sizes: dict[str, int]
) -> Models:
    noise = array("noise", noise, ("models", 2), sizes, at_least=0)
    T = imm._distributions("transition", transition, ("models", "models"), sizes, axis=1)
    if not isinstance(forms, (list, tuple)) or len(forms) != len(T):
        raise ParameterError("forms", forms, f"must be a list of {len(T)} fading forms")
    numbers = [fading.FORMS[choice("forms", form, fading.FORMS)] for form in forms]
    return Models(noise[:, 0].copy(), noise[:, 1].copy(), np.array(numbers), T)


def _filters(x0: ArrayLike, P0: ArrayLike, mu0: ArrayLike, sizes: dict[str, int]) -> Filters:
    x0 = array("x0", x0, (NOMINAL, "runs"), sizes)
    P0 = array("P0", P0, ("models", PACKED, "runs"), sizes)
    mu = imm._distributions("mu0", mu0, ("models",), sizes)
    least = float(P0[:, np.diagonal(AT)].min())
    if least < 0:
        raise ParameterError("P0", least, "must not be negative on the diagonal")
    x = np.repeat(x0[None], len(P0), axis=0)
    return Filters(x, P0.copy(), np.repeat(mu[:, None], LANES, axis=1))
