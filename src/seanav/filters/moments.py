"""From a stochastic differential equation to its moment equations, symbolically.

``dx = f(x, t) dt + G(x, t) dW`` with a standard Wiener process W (put the spectral
density Q into G). The Kolmogorov backward operator L gives the evolution of every
expectation, d⟨φ⟩/dt = ⟨Lφ⟩; φ = exp(s·x) is the characteristic function, φ = x and
φ = x xᵀ are mean and covariance. A *closure* then says what the moments beyond the
second are. What comes out are SymPy expressions; `seanav.filters.generated` compiles
the same expressions, so the equation that is printed is the function that runs.
"""

from dataclasses import dataclass, field
from functools import cache
from itertools import product

import sympy as sp
from sympy.polys.ring_series import rs_integrate, rs_mul

from seanav.checks import ParameterError, choice

CLOSURES = ("ekf", "second order", "gaussian")
SUPPORTED = "must be a polynomial in the states, or that plus terms c*x*Abs(x)"


class Sign(sp.Function):
    """Sign of a state; its derivative is taken as 0, which is right except at 0."""

    def fdiff(self, argindex=1):
        """Return the derivative."""
        return sp.Integer(0)


class Magnitude(sp.Function):
    """|x| with the derivative sign(x)."""

    def fdiff(self, argindex=1):
        """Return the derivative."""
        return Sign(self.args[0])


class SignedSquare(sp.Function):
    """x|x|, the quadratic drag law, with the derivative 2|x|."""

    def fdiff(self, argindex=1):
        """Return the derivative."""
        return 2 * Magnitude(self.args[0])


@dataclass(frozen=True)
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
    """

    states: tuple
    drift: sp.ImmutableMatrix
    diffusion: sp.ImmutableMatrix
    inputs: tuple = ()
    parameters: tuple = ()
    mean: tuple = field(init=False)
    covariance: sp.ImmutableMatrix = field(init=False)

    def __post_init__(self):
        n = len(self.states)
        mean = tuple(sp.Symbol(f"m_{x.name}", real=True) for x in self.states)
        names = [x.name for x in self.states]

        def entry(i, j):
            i, j = min(i, j), max(i, j)
            return sp.Symbol(f"P_{names[i]}{names[j]}", real=True, positive=i == j or None)

        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "covariance", sp.ImmutableMatrix(n, n, entry))

    @property
    def spread(self):
        """G Gᵀ, shape (n, n), in the states."""
        return sp.ImmutableMatrix((self.diffusion * self.diffusion.T).applyfunc(sp.expand))

    def at_mean(self, expression):
        """Return `expression` with the states replaced by the mean."""
        pairs = dict(zip(self.states, self.mean, strict=True))
        return expression.xreplace(pairs)


def _symbols(name, names):
    names = names.replace(",", " ").split() if isinstance(names, str) else list(names)
    wrong = [x for x in names if not str(x).isidentifier()]
    if wrong or len(set(map(str, names))) < len(names):
        raise ParameterError(name, names, "must be different names, each letters and digits")
    return tuple(sp.Symbol(str(x), real=True) for x in names)


def _expression(name, text, known):
    try:
        value = sp.sympify(text, locals={x.name: x for x in known}, rational=True)
    except (sp.SympifyError, TypeError, SyntaxError, AttributeError) as error:
        raise ParameterError(name, str(text), "must be a formula SymPy can read") from error
    if not isinstance(value, sp.Expr):
        raise ParameterError(name, str(text), "must be a formula SymPy can read")
    # A user's own SymPy expression need not carry our assumption that symbols are real.
    value = value.xreplace({s: x for s in value.free_symbols for x in known if s.name == x.name})
    unknown = sorted(s.name for s in value.free_symbols - set(known))
    if unknown:
        allowed = ", ".join(x.name for x in known)
        raise ParameterError(
            name, str(text), f"must not use {', '.join(unknown)}; known: {allowed}"
        )
    return value


def system(states, drift, diffusion, inputs="", parameters="") -> System:
    """Read a stochastic differential equation given as text or SymPy expressions.

    Parameters
    ----------
    states, inputs, parameters : str or list
        Names, such as ``"x y z"``.
    drift : list, length n
        f, a polynomial in the states; terms ``c*x*Abs(x)`` are allowed.
    diffusion : list of lists, shape (n, noises), or list, length n
        G, polynomial in the states; a flat list is a diagonal matrix.

    Raises
    ------
    ParameterError
        Wrong dimensions, an unknown name, or a term that is not supported: one line.
    """
    states, inputs, parameters = (
        _symbols(name, names)
        for name, names in (("states", states), ("inputs", inputs), ("parameters", parameters))
    )
    known = (*states, *inputs, *parameters)
    n = len(states)
    if n == 0 or len({x.name for x in known}) < len(known):
        raise ParameterError("states", [x.name for x in known], "must be different names")
    drift = list(drift) if not isinstance(drift, str) else [drift]
    if len(drift) != n:
        raise ParameterError(
            "drift", list(map(str, drift)), f"must have {n} entries, one per state"
        )
    rows = diffusion.tolist() if isinstance(diffusion, sp.MatrixBase) else list(diffusion)
    if not any(isinstance(row, (list, tuple)) for row in rows):
        rows = [[rows[i] if i == j else 0 for j in range(len(rows))] for i in range(len(rows))]
    ragged = any(not isinstance(row, (list, tuple)) for row in rows) or len(set(map(len, rows))) > 1
    if len(rows) != n or ragged or len(rows[0]) == 0:
        raise ParameterError("diffusion", str(diffusion), f"must have {n} rows of equal length")
    f = [_expression(f"drift[{i}]", entry, known) for i, entry in enumerate(drift)]
    G = [
        [_expression(f"diffusion[{i}][{j}]", entry, known) for j, entry in enumerate(row)]
        for i, row in enumerate(rows)
    ]
    f = [_with_signed_squares(entry, states) for entry in f]
    for i, entry in enumerate(f):
        _split(f"drift[{i}]", entry, states)
    for i, row in enumerate(G):
        for j, entry in enumerate(row):
            if not entry.is_polynomial(*states):
                raise ParameterError(
                    f"diffusion[{i}][{j}]", str(entry), "must be a polynomial in the states"
                )
    return System(states, sp.ImmutableMatrix(f), sp.ImmutableMatrix(G), inputs, parameters)


def _with_signed_squares(expression, states):
    """Return `expression` expanded, with x*Abs(x) written as `SignedSquare` of x."""
    expression = sp.expand(expression)
    for x in states:
        if expression.has(sp.Abs(x)):
            expression = sp.expand(expression.subs(sp.Abs(x), SignedSquare(x) / x))
    return expression


def _split(name, expression, states):
    """Return the polynomial part and {x: coefficient} of the terms c x|x|."""
    polynomial, squares = expression, {}
    for atom in sorted(expression.atoms(SignedSquare), key=str):
        coefficient = expression.coeff(atom)
        if coefficient.free_symbols & set(states) or coefficient.atoms(SignedSquare):
            raise ParameterError(name, str(expression), SUPPORTED)
        squares[atom.args[0]] = coefficient
        polynomial = sp.expand(polynomial - coefficient * atom)
    if not polynomial.is_polynomial(*states):
        raise ParameterError(name, str(expression), SUPPORTED)
    return polynomial, squares


# ---------------------------------------------------------------- operators


def backward(model: System, phi):
    """Return L φ = Σ f_i ∂_i φ + ½ Σ (G Gᵀ)_ij ∂_i ∂_j φ, the Kolmogorov backward operator."""
    x, spread = model.states, model.spread
    first = sum(f * sp.diff(phi, xi) for f, xi in zip(model.drift, x, strict=True))
    pairs = [(i, j) for i in range(len(x)) for j in range(len(x)) if spread[i, j] != 0]
    second = sum(spread[i, j] * sp.diff(phi, x[i], x[j]) for i, j in pairs)
    return first + second / 2


def forward(model: System, p):
    """Return L* p = −Σ ∂_i (f_i p) + ½ Σ ∂_i ∂_j ((G Gᵀ)_ij p), the Fokker–Planck operator."""
    x, spread = model.states, model.spread
    first = sum(sp.diff(f * p, xi) for f, xi in zip(model.drift, x, strict=True))
    pairs = [(i, j) for i in range(len(x)) for j in range(len(x)) if spread[i, j] != 0]
    second = sum(sp.diff(spread[i, j] * p, x[i], x[j]) for i, j in pairs)
    return second / 2 - first


def characteristic(model: System):
    """Return (s, K): d/dt ⟨e^{s·x}⟩ = ⟨K(s, x) e^{s·x}⟩, by letting L act on e^{s·x}.

    Exact. Derivatives with respect to s at s = 0 are the moment equations (8)–(9).
    """
    s = tuple(sp.Symbol(f"s_{x.name}", real=True) for x in model.states)
    wave = sp.exp(sum(si * x for si, x in zip(s, model.states, strict=True)))
    return s, sp.expand(sp.expand(backward(model, wave)) / wave)


# ---------------------------------------------------------------- moments


@cache
def pairings(indices):
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
def isserlis(indices, P):
    """Return the central moment ⟨e_i e_j …⟩ of a Gaussian with covariance matrix `P`.

    L. Isserlis, "On a formula for the product-moment coefficient of any order of a
    normal frequency distribution", *Biometrika* 12 (1918) 134–139.
    """
    return sp.Add(*(sp.Mul(*(P[i, j] for i, j in pairing)) for pairing in pairings(indices)))


def central_moment(model: System, indices):
    """Return the symbol of a central moment: 1, 0, an entry of P, or mu_… beyond."""
    if len(indices) < 2:
        return sp.Integer(1 - len(indices))
    if len(indices) == 2:
        return model.covariance[indices]
    name = "_".join(model.states[i].name for i in indices)
    return sp.Symbol(f"mu_{name}", real=True)


def expectation(model: System, expression, moment=central_moment):
    """Return ⟨expression⟩ of a polynomial, by expansion about the mean.

    Parameters
    ----------
    model : System
    expression : Expr
        Polynomial in the states.
    moment : callable, optional
        ``moment(model, indices)`` gives each central moment. Default: exact symbols.

    Raises
    ------
    ParameterError
        If it is not a polynomial.
    """
    if not expression.is_polynomial(*model.states):
        raise ParameterError("expression", str(expression), "must be a polynomial in the states")
    total = []
    for term in sp.Add.make_args(sp.expand(expression)):
        coefficient, monomial = term.as_independent(*model.states, as_Add=False)
        powers = monomial.as_powers_dict()
        raw = _raw_moment(model, tuple(int(powers[x]) for x in model.states), moment)
        total.append(sp.expand(coefficient * raw))
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


def gaussian_moment(model: System, indices):
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
    mean_rate = [expectation(model, backward(model, xi), moment) for xi in x]
    rate = sp.zeros(n, n)
    for i in range(n):
        for j in range(i, n):
            second = expectation(model, backward(model, x[i] * x[j]), moment)
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
        if not entry.is_polynomial(*model.states):
            raise ParameterError(f"drift[{i}]", str(entry), "must be a polynomial in the states")
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
    parts = [_split("drift", entry, model.states) for entry in model.drift]
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


def signed_square_mean(m, variance):
    """Return E[x|x|] of x ~ N(m, variance): (m²+s²)(2Φ(m/s)−1) + 2 m s φ(m/s)."""
    s = sp.sqrt(variance)
    density = sp.exp(-(m**2) / (2 * variance)) / sp.sqrt(2 * sp.pi)
    return (m**2 + variance) * sp.erf(m / (sp.sqrt(2) * s)) + 2 * m * s * density


def signed_square_slope(m, variance):
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


def measurement(model: System, h) -> Measurement:
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
    entries = [h] if isinstance(h, (str, sp.Expr)) else list(h)
    known = (*model.states, *model.inputs, *model.parameters)
    h = sp.Matrix([_expression(f"h[{i}]", entry, known) for i, entry in enumerate(entries)])
    P = model.covariance
    bends = [model.at_mean(sp.hessian(entry, model.states)) * P for entry in h]
    predicted = model.at_mean(h) + sp.Matrix([bend.trace() / 2 for bend in bends])
    spread = sp.Matrix(len(bends), len(bends), lambda a, b: (bends[a] * bends[b]).trace() / 2)
    return Measurement(
        model,
        sp.ImmutableMatrix(predicted),
        sp.ImmutableMatrix(model.at_mean(h.jacobian(model.states))),
        sp.ImmutableMatrix(spread.applyfunc(sp.expand)),
    )


# ---------------------------------------------------------------- observability


def observability(model: System, h, point: dict, orders: int = 8) -> list[int]:
    """Return the exact rank of the first 1, 2, … Lie derivatives' gradients at a point.

    The k-th Taylor coefficient of the output along the noise-free solution is the k-th
    Lie derivative of `h` over k!, and its gradient by the initial state follows from the
    variational equation. Both are power series with rational coefficients: no rounding,
    and no expression that grows with the order.

    Parameters
    ----------
    model : System
        Polynomial drift.
    h : list of Symbol
        The measured states.
    point : dict
        {symbol: rational number} for every state, input and parameter.
    orders : int
        Number of Lie derivatives, `h` itself included.

    Returns
    -------
    list of int
        Rank with 1, …, `orders` derivatives; n means locally weakly observable.

    References
    ----------
    R. Hermann and A. J. Krener, "Nonlinear controllability and observability",
    *IEEE Transactions on Automatic Control* 22 (1977) 728–740.
    """
    ring, t = sp.ring("t", sp.QQ)
    n = len(model.states)
    values = {symbol: sp.Rational(value) for symbol, value in point.items()}
    constants = {s: value for s, value in values.items() if s not in model.states}
    terms = [sp.Poly(f.xreplace(constants), *model.states, domain="QQ") for f in model.drift]
    drift = [f.terms() for f in terms]
    slopes = [[f.diff(x).terms() for x in model.states] for f in terms]
    rows = [model.states.index(x) for x in h]

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

    states = [ring(values[x]) for x in model.states]
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
