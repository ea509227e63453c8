"""Exercises of paper 1: Itô's rule, pairings, closures, updates, observability."""

from functools import cache

import numpy as np
import sympy as sp
from scipy import integrate

from seanav.exercises.judge import Exercise
from seanav.filters import moments
from seanav.models import bodies

# ---------------------------------------------------------------- 1.1: Itô's rule on a square


def _drift_of_square(correction=lambda g: g**2, x=3.0, g=3.0):
    return -2 * x**2 + correction(g)


# ---------------------------------------------------------------- 1.2: pairings

COVARIANCE = ((2.0, 1.0), (1.0, 3.0))


def _paired():
    P = sp.Matrix(COVARIANCE).as_immutable()
    return np.array([float(moments.isserlis(i, P)) for i in ((0, 0, 1, 1), (0, 0, 0, 1))])


# ---------------------------------------------------------------- 1.3: a wrong covariance


def _nees(components=6, factor=2.0):
    return components / factor**2


# ---------------------------------------------------------------- 1.4: three closures by hand

POINT = {"m": 0.5, "P": 0.2, "a": 1.0, "c": 2.0, "g": 1.5}


def _rates(closure, m, P, a, c, g):
    """Return (dm/dt, dP/dt) of dx = −(a x + c x³) dt + g dW."""
    mean = -a * m - c * m**3 - (closure != "ekf") * 3 * c * m * P
    slope = a + 3 * c * (m**2 + (closure == "gaussian") * P)
    return mean, -2 * slope * P + g**2


def _closures(change=lambda closure, mean, variance: (mean, variance)):
    return np.array([change(name, *_rates(name, **POINT)) for name in moments.CLOSURES])


def _without_half():
    bend = 3 * POINT["c"] * POINT["m"] * POINT["P"]
    return _closures(lambda n, mean, rate: (mean - (n != "ekf") * bend, rate))


def _one_slope():
    return np.column_stack([_closures()[:, 0], np.full(3, _closures()[0, 1])])


def _once():
    # The slope times P once, not twice.
    g = POINT["g"]
    return _closures(lambda name, mean, rate: (mean, (rate - g**2) / 2 + g**2))


def _g_once():
    g = POINT["g"]
    return _closures(lambda name, mean, rate: (mean, rate - g**2 + g))


def _bend_once():
    # The cube of m + e with e² once, not three times.
    bend = POINT["c"] * POINT["m"] * POINT["P"]
    return _closures(lambda n, mean, rate: (mean + (n != "ekf") * 2 * bend, rate))


def _one_pairing():
    # ⟨e⁴⟩ = P².
    lost = 4 * POINT["c"] * POINT["P"] ** 2
    return _closures(lambda n, mean, rate: (mean, rate + (n == "gaussian") * lost))


def _g_plain():
    return _closures(lambda name, mean, rate: (mean, rate - POINT["g"] ** 2))


# ---------------------------------------------------------------- 1.5: variance at rest


def _at_rest(pairings=3.0, a=1.0, c=2.0, g=1.0):
    """Return the positive root of 2 (a + pairings c P) P = g²."""
    return (-a + np.sqrt(a**2 + 2 * pairings * c * g**2)) / (2 * pairings * c)


def _slope_once(a=1.0, c=2.0, g=1.0):
    """Return the positive root of (a + 3 c P) P = g²."""
    return (-a + np.sqrt(a**2 + 12 * c * g**2)) / (6 * c)


def _exact_at_rest(a=1.0, c=2.0, g=1.0):
    def weight(x):
        return np.exp(-(a * x**2 + c * x**4 / 2) / g**2)

    return integrate.quad(lambda x: x**2 * weight(x), -9, 9)[0] / integrate.quad(weight, -9, 9)[0]


# ---------------------------------------------------------------- 1.6: drag with |v| v


@cache
def _after(closure, variance=0.2, which="mean"):
    model = moments.system("x", ["-k*x*Abs(x)"], [0.5], parameters="k")
    mean, P = np.array([[0.5]]), np.array([[[variance]]])
    moments.Propagator(moments.close(model, closure))(mean, P, 2.0, 0.01, None, [1.0])
    return float(mean[0, 0] if which == "mean" else P[0, 0, 0])


# ---------------------------------------------------------------- 1.7: measured speed


def _surge(shift=1.0, spread=1.0, R=1e-3, z=1.3, bent=(2.0, 2.0, 2.0)):
    """Return the mean of u after measuring u² + v² + w²."""
    mean, P = np.array([1.0, 0.0, 0.0]), np.diag([0.05, 0.02, 0.02])
    slope, curve = 2 * mean, np.diag(bent)
    predicted = mean @ mean + shift * np.trace(curve @ P) / 2
    variance = slope @ P @ slope + spread * np.trace(curve @ P @ curve @ P) / 2 + R
    return float((mean + P @ slope * (z - predicted) / variance)[0])


# ---------------------------------------------------------------- 1.8: drag of the fifth power


def quintic(m: float, P: float, a: float, c: float, g: float) -> np.ndarray:
    """Return (dm/dt, dP/dt) of dx = −(a x + c x⁵) dt + g dW under the Gaussian closure."""
    fifth = m**5 + 10 * m**3 * P + 15 * m * P**2
    slope = a + 5 * c * (m**4 + 6 * m**2 * P + 3 * P**2)
    return np.array([-a * m - c * fifth, -2 * slope * P + g**2])


def _quintic_ekf(m, P, a, c, g):
    return np.array([-a * m - c * m**5, -2 * (a + 5 * c * m**4) * P + g**2])


def _quintic_truncated(m, P, a, c, g):
    return _quintic_ekf(m, P, a, c, g) - np.array([10 * c * m**3 * P, 0.0])


def _quintic_one_pairing(m, P, a, c, g):
    slope = a + 5 * c * (m**4 + 6 * m**2 * P + P**2)
    return np.array([-a * m - c * (m**5 + 10 * m**3 * P + 5 * m * P**2), -2 * slope * P + g**2])


def _quintic_slope_at_mean(m, P, a, c, g):
    return np.array([quintic(m, P, a, c, g)[0], _quintic_ekf(m, P, a, c, g)[1]])


def _quintic_binomial(m, P, a, c, g):
    return quintic(m, P, a, c, g) + np.array([5 * c * m**3 * P, 0.0])


def _quintic_slope_of_power(m, P, a, c, g):
    return np.array([quintic(m, P, a, c, g)[0], -2 * (a + c * _fourth(m, P)) * P + g**2])


def _fourth(m, P):
    return m**4 + 6 * m**2 * P + 3 * P**2


def _quintic_once(m, P, a, c, g):
    return np.array([quintic(m, P, a, c, g)[0], -(a + 5 * c * _fourth(m, P)) * P + g**2])


def _quintic_no_fourth(m, P, a, c, g):
    slope = a + 5 * c * (m**4 + 6 * m**2 * P)
    return np.array([-a * m - c * (m**5 + 10 * m**3 * P), -2 * slope * P + g**2])


def _quintic_noise(m, P, a, c, g):
    return quintic(m, P, a, c, g) + np.array([0.0, g - g**2])


# ---------------------------------------------------------------- 1.9: one unequal mass


@cache
def _ranks(m3="200"):
    drift, diffusion, names = bodies.equations()
    model = moments.system(bodies.STATES, drift, diffusion, bodies.INPUTS, names)
    state = ("1/2", "1/3", "-1/5", "1/7", "-2/5", "3/11")
    at = dict(zip(model.states, state, strict=True))
    at |= dict(zip(model.parameters, map(str, bodies.SPHERE.parameters()), strict=True))
    at |= dict(zip(model.inputs, map(str, bodies.SPHERE.inputs), strict=True))
    point = {x: sp.Rational(m3 if x.name == "m3" else value) for x, value in at.items()}
    return np.array(moments.observability(model, model.states[3:], point, 4), dtype=float)


EXERCISES = {
    "1.1": Exercise(
        right=_drift_of_square,
        mistakes={
            "That is the ordinary chain rule: the square of dW is not zero.": lambda: (
                _drift_of_square(lambda g: 0.0)
            ),
            "The second derivative of the square is 2; half of it stays.": lambda: [
                _drift_of_square(lambda g: g**2 / 2),
                _drift_of_square(lambda g: 2 * g**2),
            ],
            "The noise enters with its variance, g², not with g.": lambda: [
                _drift_of_square(lambda g: g),
                _drift_of_square(lambda g: g**0.5),
            ],
            "The correction is added: noise makes a square larger.": lambda: _drift_of_square(
                lambda g: -(g**2)
            ),
        },
        rtol=1e-3,
    ),
    "1.2": Exercise(
        right=_paired,
        mistakes={
            "There are three ways to pair up four factors; add them all.": lambda: [
                np.array([6.0, 2.0]),
                np.array([6.0, 6.0]),
                np.array([8.0, 2.0]),
            ],
            "Which pairs join one x with one y? There are two such pairings in x²y².": lambda: (
                np.array([7.0, 6.0])
            ),
            "x and y are correlated: ⟨xy⟩ is not zero.": lambda: np.array([6.0, 0.0]),
            "Each pairing of x³y has one pair x, x and one pair x, y in it.": lambda: [
                np.array([8.0, 3.0]),
                np.array([8.0, 18.0]),
            ],
        },
        rtol=1e-3,
    ),
    "1.3": Exercise(
        right=_nees,
        mistakes={
            "That is for each component alone; the NEES adds up all of them.": lambda: _nees(1),
            "A covariance is made of squares of standard deviations.": lambda: [
                _nees(factor=2**0.5),
                _nees(factor=0.5**0.5),
            ],
            "A filter that thinks its errors too large divides by too much.": lambda: _nees(
                factor=0.5
            ),
            "That is by how much the covariance is too large; the NEES divides by it.": lambda: (
                _nees(1, 0.5)
            ),
        },
        rtol=1e-3,
    ),
    "1.4": Exercise(
        right=_closures,
        mistakes={
            "The correction of the mean is half of f_xx times P.": _without_half,
            "The Gaussian closure averages the slope, too: ⟨x²⟩ is m² + P.": _one_slope,
            "The error meets the slope twice in dP/dt: once from each side.": _once,
            "dP/dt has the noise in it as well: g².": _g_plain,
            "The noise enters dP/dt with its square, not with g.": _g_once,
            "The cube of m + e holds m e² three times.": _bend_once,
            "⟨e⁴⟩ of a Gaussian is 3P²: count the pairings.": _one_pairing,
            "The rows are to be in the order EKF, truncated, Gaussian.": lambda: [
                _closures()[::-1],
                _closures()[[0, 2, 1]],
                _closures()[[2, 0, 1]],
            ],
        },
        rtol=1e-3,
    ),
    "1.5": Exercise(
        right=_at_rest,
        mistakes={
            "That is the variance of the EKF: its slope at 0 knows no cubic drag.": lambda: (
                _at_rest(1e-9)
            ),
            "⟨x⁴⟩ of a Gaussian is 3P²: count its pairings.": lambda: [
                _at_rest(1.0),
                _at_rest(6.0),
            ],
            "That is the exact variance; asked for is that of the Gaussian closure.": (
                _exact_at_rest
            ),
            "The slope stands twice in dP/dt: once from each side.": _slope_once,
        },
        rtol=2e-3,
    ),
    "1.6": Exercise(
        right=lambda: _after("gaussian"),
        mistakes={
            "That is the EKF's mean: it takes the drag at the mean.": lambda: _after("ekf"),
            "The start's variance is 0.2; its root is the standard deviation.": lambda: [
                _after("gaussian", 0.2**2),
                _after("gaussian", 0.2**0.5),
            ],
            "That is the variance after 2 s; asked for is the mean.": lambda: _after(
                "gaussian", which="variance"
            ),
            "That is their ratio; hand in the mean of the Gaussian closure.": lambda: (
                _after("ekf") / _after("gaussian")
            ),
        },
        rtol=5e-3,
    ),
    "1.7": Exercise(
        right=_surge,
        mistakes={
            "That is the EKF's update: the spread of u, v, w adds to the mean of the square.": (
                lambda: _surge(0.0, 0.0)
            ),
            "The predicted speed is right; its variance lacks the second-order part.": lambda: (
                _surge(spread=0.0)
            ),
            "The variance is right; the predicted speed lacks ½ tr(P h_xx).": lambda: _surge(
                shift=0.0
            ),
            "There is a half before each trace.": lambda: [
                _surge(2.0, 2.0),
                _surge(2.0, 1.0),
                _surge(1.0, 2.0),
            ],
            "v and w have mean zero, not variance zero: both traces count them.": lambda: _surge(
                bent=(2.0, 0.0, 0.0)
            ),
            "R is a variance already.": lambda: [_surge(R=1e-6), _surge(R=1e-3**0.5)],
        },
        rtol=3e-4,
    ),
    "1.8": Exercise(
        right=quintic,
        cases=[
            (0.7, 0.2, 1.0, 2.0, 1.5),
            (-1.2, 0.4, 0.3, 0.5, 0.2),
            (0.0, 0.5, 1.0, 3.0, 0.7),
            (2.0, 0.01, 0.0, 1.0, 1.0),
        ],
        mistakes={
            "That is the EKF: f and its slope at the mean.": _quintic_ekf,
            "That is the truncated closure: the fourth moments count as well.": _quintic_truncated,
            "⟨e⁴⟩ of a Gaussian is 3P².": _quintic_one_pairing,
            "The mean is right; the slope must be averaged, too.": _quintic_slope_at_mean,
            "The noise enters dP/dt with g².": _quintic_noise,
            "The fifth power of m + e holds m³ e² ten times.": _quintic_binomial,
            "The slope of x⁵ is 5x⁴.": _quintic_slope_of_power,
            "The slope stands twice in dP/dt: once from each side.": _quintic_once,
            "⟨e⁴⟩ of a Gaussian is not zero.": _quintic_no_fourth,
        },
        rtol=1e-6,
    ),
    "1.9": Exercise(
        right=_ranks,
        mistakes={
            "That is the sphere with three equal masses.": lambda: _ranks("196.55"),
            "While two masses are equal, the first derivatives do not yet give all.": lambda: (
                np.array([3.0, 6.0, 6.0, 6.0])
            ),
            "One order can add up to three to the rank; compute it exactly.": lambda: np.array(
                [3.0, 4.0, 5.0, 6.0]
            ),
            "A state that one equation lacks may enter through others; count all rows.": lambda: [
                np.array([3.0, 5.0, 5.0, 5.0]),
                np.array([3.0, 5.0, 5.0, 6.0]),
            ],
            "The rank counts all six states; begin with the three measured ones.": lambda: (
                _ranks() - 3
            ),
        },
        rtol=1e-6,
    ),
}
