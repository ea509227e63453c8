"""A stochastic differential equation dx = f(x, t) dt + G(x, t) dW in symbols.

W is a standard Wiener process (put the spectral density Q into G). `system` reads one,
`observability` asks what a measurement sees of it, and `seanav.filters.moments.equations` makes
its moment equations.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
import sympy as sp
from sympy.polys.ring_series import rs_integrate, rs_mul

from seanav.checks import ParameterError, integer
from seanav.filters.moments.formulas import SignedSquare, formula, number, shown, symbols

MAX_STATES = 30
MAX_DRIFT_DEGREE, MAX_DIFFUSION_DEGREE = 10, 5  # in the states
MAX_PRODUCTS = 50_000  # of two terms in G Gᵀ
MAX_SIZE = 60_000  # n times the sum of 2^degree over all terms: less than a minute's work
MAX_ORDERS = 30  # of Lie derivatives
POLYNOMIAL = "must be a polynomial in the states"
SUPPORTED = POLYNOMIAL + ", or that plus terms c*x*Abs(x)"


@attrs.frozen
class System:
    """A stochastic differential equation in symbols; made by `system`.

    Attributes
    ----------
    states : tuple of Symbol
        n states.
    drift : Matrix, shape (n, 1)
    diffusion : Matrix, shape (n, noises)
    inputs, parameters : tuple of Symbol
        Known functions of time, and constants.
    mean : tuple of Symbol
        m_x for each state x; `own` says when it is written m_(x).
    covariance : Matrix, shape (n, n), of Symbol
        P_xy, or P_(x,y).
    """

    states: tuple
    drift: sp.ImmutableMatrix
    diffusion: sp.ImmutableMatrix
    inputs: tuple = ()
    parameters: tuple = ()
    mean: tuple = attrs.field(init=False)
    covariance: sp.ImmutableMatrix = attrs.field(init=False)

    @mean.default
    def _mean(self):
        return tuple(self.own("m_", [x.name], real=True) for x in self.states)

    @covariance.default
    def _covariance(self):
        n, names = len(self.states), [x.name for x in self.states]
        pairs = [(i, j) for i in range(n) for j in range(i, n)]
        # States ab, a, ba: P_aba is two covariances.
        twice = Counter(names[i] + names[j] for i, j in pairs)
        entry = {
            (i, j): self.own(
                "P_",
                [names[i], names[j]],
                unclear=twice[names[i] + names[j]] > 1,
                real=True,
                positive=i == j or None,
            )
            for i, j in pairs
        }
        return sp.ImmutableMatrix(n, n, lambda i, j: entry[min(i, j), max(i, j)])

    @property
    def known(self) -> tuple:
        """Every symbol that a user declared: states, inputs, parameters."""
        return (*self.states, *self.inputs, *self.parameters)

    def own(
        self,
        prefix: str,
        names: list[str],
        joint: str = "",
        unclear: bool = False,
        **assumptions: Any,
    ) -> sp.Symbol:
        """Return a symbol of ours: prefix and names, such as m_u or P_uv.

        Where a user declared that name, or it is `unclear`, it is written m_(u), P_(u,v).
        No user's name has a bracket, so no symbol of ours is ever a user's.
        """
        name = prefix + joint.join(names)
        if unclear or name in {x.name for x in self.known}:
            name = f"{prefix}({','.join(names)})"
        return sp.Symbol(name, **assumptions)

    @property
    def spread(self) -> sp.Matrix:
        """G Gᵀ, shape (n, n), in the states."""
        return sp.ImmutableMatrix((self.diffusion * self.diffusion.T).applyfunc(sp.expand))

    def at_mean(self, expression: sp.Expr) -> sp.Expr:
        """Return `expression` with the states replaced by the mean."""
        pairs = dict(zip(self.states, self.mean, strict=True))
        return expression.xreplace(pairs)


def system(
    states: Any, drift: Any, diffusion: Any, inputs: Any = "", parameters: Any = ""
) -> System:
    """Read a stochastic differential equation given as text or SymPy expressions.

    Parameters
    ----------
    states, inputs, parameters : str or list
        Names, such as ``"x y z"``, any that Python would take and its keywords too;
        at most `MAX_STATES` states.
    drift : list, length n
        f, a polynomial in the states; terms ``c*x*Abs(x)`` are allowed. Coefficients are
        formulas (`seanav.filters.moments.formulas`) in inputs and parameters.
    diffusion : list of lists, shape (n, noises), or list, length n
        G, polynomial in the states; a flat list is a diagonal matrix.

    Raises
    ------
    ParameterError
        Wrong dimensions, an unknown name, or a term that is not supported: one line.
    """
    states, inputs, parameters = (
        symbols(name, names)
        for name, names in (("states", states), ("inputs", inputs), ("parameters", parameters))
    )
    known = (*states, *inputs, *parameters)
    n = len(states)
    if n == 0 or len(set(known)) < len(known):
        raise ParameterError("states", [x.name for x in known], "must be different names")
    integer("number of states", n, at_least=1, at_most=MAX_STATES)
    entries = list(drift) if isinstance(drift, sp.MatrixBase) else _entries(drift)
    if len(entries) != n:
        words = [shown(entry) for entry in entries]
        raise ParameterError("drift", words, f"must have {n} entries, one per state")
    f = [formula(f"drift[{i}]", entry, known) for i, entry in enumerate(entries)]
    f = [_with_signed_squares(entry, states) for entry in f]
    for i, entry in enumerate(f):
        split(f"drift[{i}]", entry, states)
    rows = _entries(diffusion)
    if not any(isinstance(row, (list, tuple)) for row in rows):
        rows = [[rows[i] if i == j else 0 for j in range(len(rows))] for i in range(len(rows))]
    ragged = any(not isinstance(row, (list, tuple)) for row in rows) or len(set(map(len, rows))) > 1
    if len(rows) != n or ragged or not 1 <= len(rows[0]) <= MAX_STATES:
        allowed = f"must have {n} rows of equal length, at most {MAX_STATES}"
        raise ParameterError("diffusion", shown(str(diffusion)), allowed)
    G = [
        [formula(f"diffusion[{i}][{j}]", entry, known) for j, entry in enumerate(row)]
        for i, row in enumerate(rows)
    ]
    for i, row in enumerate(G):
        for j, entry in enumerate(row):
            demand_polynomial(f"diffusion[{i}][{j}]", entry, states, MAX_DIFFUSION_DEGREE)
    counts = np.array([[len(monomials(entry, states)) for entry in row] for row in G])
    products = int((counts.sum(axis=0) ** 2).sum())
    integer("products of two terms in G Gᵀ", products, at_least=0, at_most=MAX_PRODUCTS)
    model = System(states, sp.ImmutableMatrix(f), sp.ImmutableMatrix(G), inputs, parameters)
    degrees = [sum(k) for f in (*model.drift, *model.spread) for _, k in monomials(f, states)]
    size = n * sum(2**k for k in degrees)
    integer("states times the sum of 2**degree over all terms", size, at_least=0, at_most=MAX_SIZE)
    return model


def _entries(given):
    if isinstance(given, (sp.MatrixBase, np.ndarray)):
        given = given.tolist()
    return list(given) if isinstance(given, (list, tuple)) else [given]


def monomials(expression: sp.Expr, states: tuple) -> list:
    """Return [(coefficient, powers of the states), …] of a polynomial in the states."""
    out = []
    for term in sp.Add.make_args(sp.expand(expression)):
        coefficient, monomial = term.as_independent(*states, as_Add=False)
        powers = monomial.as_powers_dict()
        out.append((coefficient, tuple(int(powers[x]) for x in states)))
    return out


def demand_polynomial(
    name: str, expression: sp.Expr, states: tuple, at_most: int, allowed: str = POLYNOMIAL
) -> None:
    """Raise `ParameterError` if this is no polynomial of a degree up to `at_most`."""
    if not expression.is_polynomial(*states):
        raise ParameterError(name, shown(expression), allowed)
    if max(sum(powers) for _, powers in monomials(expression, states)) > at_most:
        allowed = f"must be of a degree up to {at_most} in the states"
        raise ParameterError(name, shown(expression), allowed)


def _with_signed_squares(expression, states):
    """Return `expression` expanded, with x*Abs(x) written as `SignedSquare` of x."""
    expression = sp.expand(expression)
    for x in states:
        if expression.has(sp.Abs(x)):
            expression = sp.expand(expression.subs(sp.Abs(x), SignedSquare(x) / x))
    return expression


def split(name: str, expression: sp.Expr, states: tuple) -> tuple:
    """Return the polynomial part and {x: coefficient} of the terms c x|x|."""
    polynomial, squares = expression, {}
    for atom in sorted(expression.atoms(SignedSquare), key=str):
        coefficient = expression.coeff(atom)
        if coefficient.free_symbols & set(states) or coefficient.atoms(SignedSquare):
            raise ParameterError(name, shown(expression), SUPPORTED)
        squares[atom.args[0]] = coefficient
        polynomial = sp.expand(polynomial - coefficient * atom)
    demand_polynomial(name, polynomial, states, MAX_DRIFT_DEGREE, SUPPORTED)
    return polynomial, squares


# ---------------------------------------------------------------- observability


def observability(model: System, h: Sequence, point: dict, orders: int = 8) -> list[int]:
    """Return the exact rank of the first 1, 2, … Lie derivatives' gradients at a point.

    The k-th Taylor coefficient of the output along the noise-free solution is the k-th
    Lie derivative of `h` over k!, and its gradient by the initial state follows from the
    variational equation. Both are power series with rational coefficients: no rounding,
    and no expression that grows with the order.

    Parameters
    ----------
    model : System
        Polynomial drift.
    h : list of Symbol or str
        The measured states.
    point : dict
        {symbol or name: rational number} for every state, input and parameter.
    orders : int
        Number of Lie derivatives, `h` itself included; at most `MAX_ORDERS`.

    Returns
    -------
    list of int
        Rank with 1, …, `orders` derivatives; n means locally weakly observable.

    Raises
    ------
    ParameterError
        If the drift is no polynomial with rational coefficients at the point, or a name
        in `h` or `point` is missing or too many.

    References
    ----------
    R. Hermann and A. J. Krener, "Nonlinear controllability and observability",
    *IEEE Transactions on Automatic Control* 22 (1977) 728–740.
    """
    integer("orders", orders, at_least=1, at_most=MAX_ORDERS)
    drift, start, rows = _at_point(model, h, point)
    ring, t = sp.ring("t", sp.QQ)
    n = len(model.states)
    slopes = [[f.diff(x).terms() for x in model.states] for f in drift]
    drift = [f.terms() for f in drift]

    def series(entry, states):
        # Substitute power series into a polynomial, keeping terms below t^orders.
        total = ring.zero
        for powers, coefficient in entry:
            term = ring(coefficient)
            for state, power in zip(states, powers, strict=True):
                for _ in range(power):
                    term = rs_mul(term, state, t, orders)
            total += term
        return total

    states = [ring(value) for value in start]
    gradient = [[ring(int(i == j)) for j in range(n)] for i in range(n)]
    start, unit = list(states), [list(row) for row in gradient]
    # Picard iteration: each pass makes one more coefficient right.
    for _ in range(orders - 1):
        rates = [series(entry, states) for entry in drift]
        A = [[series(entry, states) for entry in row] for row in slopes]
        products = [
            [sum(rs_mul(A[i][k], gradient[k][j], t, orders) for k in range(n)) for j in range(n)]
            for i in range(n)
        ]
        states = [s + rs_integrate(r, t) for s, r in zip(start, rates, strict=True)]
        gradient = [
            [unit[i][j] + rs_integrate(products[i][j], t) for j in range(n)] for i in range(n)
        ]
    ranks, stacked = [], sp.zeros(0, n)
    for order in range(orders):
        block = [[gradient[i][j].coeff(t**order) for j in range(n)] for i in rows]
        stacked = stacked.col_join(sp.Matrix(block))
        ranks.append(stacked.rank())
    return ranks


def _at_point(model, h, point):
    """Return drift polynomials (rational coefficients), states, and indices measured, checked."""
    known = {x.name: x for x in model.known}
    needed = {x.name for x in (*model.states, *model.drift.free_symbols)}
    given = {_name(key): value for key, value in point.items()} if isinstance(point, dict) else {}
    if not needed <= set(given) <= set(known):
        allowed = f"must have a number for each of {', '.join(x for x in known if x in needed)}"
        raise ParameterError("point", sorted(given), f"{allowed}, and no other name")
    values = {known[x]: number(f"point, {x}", value) for x, value in given.items()}
    names = [x.name for x in model.states]
    measured = [_name(x) for x in _entries(h)]
    if not measured or not set(measured) <= set(names):
        raise ParameterError("h", measured, f"must be states: {', '.join(names)}")
    constants = {x: value for x, value in values.items() if x not in model.states}
    drift = []
    for i, f in enumerate(model.drift):
        entry = f.xreplace(constants)
        demand_polynomial(f"drift[{i}]", entry, model.states, MAX_DRIFT_DEGREE)
        if not all(c.is_Rational for c, _ in monomials(entry, model.states)):
            allowed = "must have fractions as coefficients at the point"
            raise ParameterError(f"drift[{i}]", shown(f), allowed)
        drift.append(sp.Poly(entry, *model.states, domain="QQ"))
    return drift, [values[x] for x in model.states], [names.index(x) for x in measured]


def _name(symbol):
    return symbol.name if isinstance(symbol, sp.Symbol) else shown(symbol)
