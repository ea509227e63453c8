"""From a stochastic differential equation to its moment equations, symbolically.

``dx = f(x, t) dt + G(x, t) dW`` with a standard Wiener process W (put the spectral
density Q into G). The Kolmogorov backward operator L gives the evolution of every
expectation, d⟨φ⟩/dt = ⟨Lφ⟩; φ = exp(s·x) is the characteristic function, φ = x and
φ = x xᵀ are mean and covariance. A *closure* then says what the moments beyond the
second are. What comes out are SymPy expressions; `seanav.filters.moments.generated` compiles
the same expressions, so the equation that is printed is the function that runs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import sympy as sp

from seanav.checks import ParameterError, choice, integer
from seanav.filters.moments.formulas import Magnitude, formula
from seanav.filters.moments.sde import (
    MAX_DRIFT_DEGREE,
    MAX_STATES,
    System,
    demand_polynomial,
    monomials,
    split,
)

CLOSURES = ("ekf", "second order", "gaussian")
MAX_DEGREE = 12  # of an expectation
MAX_CURVATURE = 300  # terms in the second derivatives of a measurement

# ---------------------------------------------------------------- operators


def backward(model: System, phi: sp.Expr) -> sp.Expr:
    """Return L φ = Σ f_i ∂_i φ + ½ Σ (G Gᵀ)_ij ∂_i ∂_j φ, the Kolmogorov backward operator."""
    x, spread = model.states, model.spread
    first = sum(f * sp.diff(phi, xi) for f, xi in zip(model.drift, x, strict=True))
    pairs = [(i, j) for i in range(len(x)) for j in range(len(x)) if spread[i, j] != 0]
    second = sum(spread[i, j] * sp.diff(phi, x[i], x[j]) for i, j in pairs)
    return first + second / 2


def forward(model: System, p: sp.Expr) -> sp.Expr:
    """Return L* p = −Σ ∂_i (f_i p) + ½ Σ ∂_i ∂_j ((G Gᵀ)_ij p), the Fokker–Planck operator."""
    x, spread = model.states, model.spread
    first = sum(sp.diff(f * p, xi) for f, xi in zip(model.drift, x, strict=True))
    pairs = [(i, j) for i in range(len(x)) for j in range(len(x)) if spread[i, j] != 0]
    second = sum(sp.diff(spread[i, j] * p, x[i], x[j]) for i, j in pairs)
    return second / 2 - first


def characteristic(model: System) -> tuple:
    """Return (s, K): d/dt ⟨e^{s·x}⟩ = ⟨K(s, x) e^{s·x}⟩, by letting L act on e^{s·x}.

    Exact. Derivatives with respect to s at s = 0 are the moment equations (8)–(9).
    """
    s = tuple(model.own("s_", [x.name], real=True) for x in model.states)
    wave = sp.exp(sum(si * x for si, x in zip(s, model.states, strict=True)))
    return s, sp.expand(sp.expand(backward(model, wave)) / wave)


# ---------------------------------------------------------------- moments


@cache
def pairings(indices: tuple) -> tuple:
    """Return all ways to pair up `indices`, a tuple of tuples of pairs (Isserlis)."""
    if not indices:
        return ((),)
    if len(indices) % 2:
        return ()
    first, rest = indices[0], indices[1:]
    return tuple(
        ((first, rest[k]), *tail)
        for k in range(len(rest))
        for tail in pairings(rest[:k] + rest[k + 1 :])
    )


@cache
def isserlis(indices: tuple, P: sp.Matrix) -> sp.Expr:
    """Return the central moment ⟨e_i e_j …⟩ of a Gaussian with covariance matrix `P`.

    L. Isserlis, "On a formula for the product-moment coefficient of any order of a
    normal frequency distribution", *Biometrika* 12 (1918) 134–139.
    """
    return sp.Add(*(sp.Mul(*(P[i, j] for i, j in pairing)) for pairing in pairings(indices)))


def central_moment(model: System, indices: tuple) -> sp.Expr:
    """Return the symbol of a central moment: 1, 0, an entry of P, or mu_… beyond."""
    if len(indices) < 2:
        return sp.Integer(1 - len(indices))
    if len(indices) == 2:
        return model.covariance[indices]
    names = [model.states[i].name for i in indices]
    # States a and a_a: mu_a_a_a is three moments.
    unclear = any("_" in x.name for x in model.states)
    return model.own("mu_", names, "_", unclear, real=True)


def expectation(model: System, expression: sp.Expr, moment: Callable = central_moment) -> sp.Expr:
    """Return ⟨expression⟩ of a polynomial, by expansion about the mean.

    Parameters
    ----------
    model : System
    expression : Expr or str
        Polynomial in the states; mean and covariance may be in it too.
    moment : callable, optional
        ``moment(model, indices)`` gives each central moment. Default: exact symbols.

    Raises
    ------
    ParameterError
        If it is not a polynomial of a degree up to `MAX_DEGREE`.
    """
    known = (*model.known, *model.mean, *model.covariance)
    expression = formula("expression", expression, known)
    demand_polynomial("expression", expression, model.states, MAX_DEGREE)
    return _expectation(model, expression, moment)


def _expectation(model, expression, moment):
    total = []
    for coefficient, powers in monomials(expression, model.states):
        total.append(sp.expand(coefficient * _raw_moment(model, powers, moment)))
    return sp.Add(*total)


@cache
def _raw_moment(model, powers, moment):
    """Return ⟨x_1^k_1 … x_n^k_n⟩, x = m + e, by the central moments of e."""
    total = []
    for chosen in product(*(range(k + 1) for k in powers)):
        split = list(zip(model.mean, powers, chosen, strict=True))
        coefficient = sp.Mul(*(sp.binomial(k, j) * m ** (k - j) for m, k, j in split))
        indices = tuple(i for i, j in enumerate(chosen) for _ in range(j))
        total.append(sp.expand(coefficient * moment(model, indices)))
    return sp.Add(*total)


def gaussian_moment(model: System, indices: tuple) -> sp.Expr:
    """Return the central moment of a Gaussian: for `expectation`."""
    return isserlis(indices, model.covariance)


@dataclass(frozen=True)
class Moments:
    """Evolution of mean and covariance: right-hand sides as SymPy matrices.

    Attributes
    ----------
    model : System
    mean_rate : Matrix, shape (n, 1)
    covariance_rate : Matrix, shape (n, n), symmetric
    closure : str
        ``"exact"``: still contains the higher central moments ``mu_…``.
    """

    model: System
    mean_rate: sp.ImmutableMatrix
    covariance_rate: sp.ImmutableMatrix
    closure: str


def _by_operator(model, moment, label):
    # Equation (11): L acts on x_i and on x_i x_j; d(m_i m_j)/dt is taken off.
    x, m, n = model.states, model.mean, len(model.states)
    mean_rate = [_expectation(model, backward(model, xi), moment) for xi in x]
    rate = sp.zeros(n, n)
    for i in range(n):
        for j in range(i, n):
            second = _expectation(model, backward(model, x[i] * x[j]), moment)
            rate[i, j] = rate[j, i] = sp.expand(second - m[i] * mean_rate[j] - mean_rate[i] * m[j])
    return Moments(model, sp.ImmutableMatrix(mean_rate), sp.ImmutableMatrix(rate), label)


def exact(model: System) -> Moments:
    """Return the exact, not closed, evolution of mean and covariance, equation (11).

    Raises
    ------
    ParameterError
        If the drift is not a polynomial.
    """
    for i, entry in enumerate(model.drift):
        demand_polynomial(f"drift[{i}]", entry, model.states, MAX_DRIFT_DEGREE)
    return _by_operator(model, central_moment, "exact")


def close(model: System, closure: str) -> Moments:
    """Return closed equations for mean and covariance.

    Parameters
    ----------
    model : System
    closure : str
        ``"ekf"``: f and f_x at the mean. ``"second order"``: truncated, f + ½ tr(P f_xx),
        f_x at the mean. ``"gaussian"``: ⟨f⟩ and ⟨x fᵀ⟩ of a Gaussian, exact for a
        polynomial: third central moments 0, higher ones by Isserlis; x|x| in closed form.

    References
    ----------
    A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, Academic Press, 1970,
    chapter 9.
    """
    choice("closure", closure, CLOSURES)
    if closure == "gaussian":
        return _gaussian(model)
    x, P, n = model.states, model.covariance, len(model.states)
    A = model.at_mean(model.drift.jacobian(x))
    mean_rate, spread = model.at_mean(model.drift), model.at_mean(model.spread)
    if closure == "second order":

        def bend(expression):
            second = model.at_mean(sp.hessian(expression, x))
            return sum(P[i, j] * second[i, j] for i in range(n) for j in range(n)) / 2

        mean_rate = mean_rate + model.drift.applyfunc(bend)
        spread = spread + model.spread.applyfunc(bend)
    rate = (A * P + (A * P).T + spread).applyfunc(sp.expand)
    return Moments(
        model, sp.ImmutableMatrix(mean_rate.applyfunc(sp.expand)), sp.ImmutableMatrix(rate), closure
    )


def _gaussian(model):
    n, P = len(model.states), model.covariance
    parts = [split("drift", entry, model.states) for entry in model.drift]
    smooth = System(
        model.states,
        sp.ImmutableMatrix([polynomial for polynomial, _ in parts]),
        model.diffusion,
        model.inputs,
        model.parameters,
    )
    moments = _by_operator(smooth, gaussian_moment, "gaussian")
    mean_rate, rate = moments.mean_rate.as_mutable(), moments.covariance_rate.as_mutable()
    for i, (_, squares) in enumerate(parts):
        for x, coefficient in squares.items():
            k = model.states.index(x)
            value = signed_square_mean(model.mean[k], P[k, k])
            # Stein: ⟨g(x_k) e_j⟩ = P_kj ⟨g'(x_k)⟩, and ⟨g'⟩ is the derivative of ⟨g⟩.
            slope = signed_square_slope(model.mean[k], P[k, k])
            mean_rate[i] += coefficient * value
            for j in range(n):
                rate[i, j] += coefficient * slope * P[k, j]
                rate[j, i] += coefficient * slope * P[k, j]
    return Moments(model, sp.ImmutableMatrix(mean_rate), sp.ImmutableMatrix(rate), "gaussian")


def signed_square_mean(m: sp.Expr, variance: sp.Expr) -> sp.Expr:
    """Return E[x|x|] of x ~ N(m, variance): (m²+s²)(2Φ(m/s)−1) + 2 m s φ(m/s)."""
    s = sp.sqrt(variance)
    density = sp.exp(-(m**2) / (2 * variance)) / sp.sqrt(2 * sp.pi)
    return (m**2 + variance) * sp.erf(m / (sp.sqrt(2) * s)) + 2 * m * s * density


def signed_square_slope(m: sp.Expr, variance: sp.Expr) -> sp.Expr:
    """Return E[2|x|] of x ~ N(m, variance), the derivative of `signed_square_mean` by m."""
    s = sp.sqrt(variance)
    density = sp.exp(-(m**2) / (2 * variance)) / sp.sqrt(2 * sp.pi)
    return 2 * m * sp.erf(m / (sp.sqrt(2) * s)) + 4 * s * density


# ---------------------------------------------------------------- measurements


@dataclass(frozen=True)
class Measurement:
    """A measurement function to second order: what the update needs.

    Attributes
    ----------
    model : System
    predicted : Matrix, shape (k, 1)
        h(m) + ½ tr(P h_xx).
    H : Matrix, shape (k, n)
        h_x(m).
    spread : Matrix, shape (k, k)
        ½ tr(h_xx,a P h_xx,b P), added to H P Hᵀ + R.
    """

    model: System
    predicted: sp.ImmutableMatrix
    H: sp.ImmutableMatrix
    spread: sp.ImmutableMatrix


def measurement(model: System, h: Sequence) -> Measurement:
    """Return the second-order expansion of a measurement, given as text or SymPy.

    Raises
    ------
    ParameterError
        If an entry of `h` is not a formula in the states and parameters.

    References
    ----------
    Jazwinski (1970), section 9.3: the modified Gaussian second-order update. "Modified"
    means that the covariance does not depend on the residual.
    """
    entries = h.tolist() if isinstance(h, (sp.MatrixBase, np.ndarray)) else h
    entries = entries if isinstance(entries, (list, tuple)) else [entries]
    if not 1 <= len(entries) <= MAX_STATES:
        raise ParameterError("h", len(entries), f"must have 1 to {MAX_STATES} entries")
    formulas = sp.Matrix(
        [formula(f"h[{i}]", entry, model.known) for i, entry in enumerate(entries)]
    )
    formulas = formulas.applyfunc(lambda entry: entry.replace(sp.Abs, Magnitude))
    P = model.covariance
    curves = [model.at_mean(sp.hessian(entry, model.states)) for entry in formulas]
    terms = sum(len(sp.Add.make_args(sp.expand(e))) for curve in curves for e in curve if e != 0)
    integer("terms in the second derivatives of h", terms, at_least=0, at_most=MAX_CURVATURE)
    bends = [curve * P for curve in curves]
    predicted = model.at_mean(formulas) + sp.Matrix([bend.trace() / 2 for bend in bends])
    spread = sp.Matrix(len(bends), len(bends), lambda a, b: (bends[a] * bends[b]).trace() / 2)
    return Measurement(
        model,
        sp.ImmutableMatrix(predicted),
        sp.ImmutableMatrix(model.at_mean(formulas.jacobian(model.states))),
        sp.ImmutableMatrix(spread.applyfunc(sp.expand)),
    )
