"""Whatever a user calls states, inputs and parameters, the numbers are those of the equation.

The reference knows no names: drift and diffusion by position, averaged over the nodes of a
Gauss–Hermite rule, which is exact for these polynomials.
"""

import itertools
import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from seanav.checks import ParameterError
from seanav.filters import moments
from seanav.filters.moments import sources

# ---------------------------------------------------------------- one equation, any names

PLAIN = ("x", "y", "z", "f", "k", "l", "q")  # three states, an input, three parameters
MEAN, INPUT, NUMBERS = np.array([0.4, -0.7, 1.1]), 0.8, np.array([1.3, 0.6, -0.9])
P = np.array([[0.3, 0.05, -0.1], [0.05, 0.2, 0.02], [-0.1, 0.02, 0.5]])


def equation(x, y, z, f, k, l, q):  # noqa: E741
    """Return drift and diffusion: of numbers, arrays or symbols."""
    drift = [-k * x - l * x**3 + f, q * x * y - l * y + f * z, k / l * y**2 * z - q * z + 2 * x]
    return drift, [[l, 0 * x], [q * x, k + 0 * x], [0 * x, 1 + y]]


def text(x, y, z, f, k, l, q):  # noqa: E741
    """Return the same as text."""
    drift = [
        f"-{k}*{x} - {l}*{x}**3 + {f}",
        f"{q}*{x}*{y} - {l}*{y} + {f}*{z}",
        f"{k}/{l}*{y}**2*{z} - {q}*{z} + 2*{x}",
    ]
    return drift, [[l, "0"], [f"{q}*{x}", k], ["0", f"1 + {y}"]]


def gauss_hermite(function, mean, P, nodes=5):
    """Return ⟨f⟩, ⟨f eᵀ⟩ + ⟨e fᵀ⟩ + ⟨G Gᵀ⟩ of a Gaussian; `function` gives (f, G) at points."""
    at, weights = np.polynomial.hermite_e.hermegauss(nodes)
    n = len(mean)
    e = np.array(list(itertools.product(at, repeat=n))) @ np.linalg.cholesky(P).T
    weight = np.prod(list(itertools.product(weights / weights.sum(), repeat=n)), axis=1)
    drift, G = function(*(mean + e).T)
    f = np.array([np.broadcast_to(entry, len(e)) for entry in drift])
    G = np.array([[np.broadcast_to(entry, len(e)) for entry in row] for row in G])
    cross = (f * weight) @ e
    return f @ weight, cross + cross.T + np.einsum("iwn,jwn,n->ij", G, G, weight)


EXPECTED = gauss_hermite(lambda x, y, z: equation(x, y, z, INPUT, *NUMBERS), MEAN, P)


def uncompiled(source):
    """Return the names of generated source as plain Python: quick for many texts."""
    names = {}
    exec(source.replace("@kernel\n", ""), names)
    return names


def read(names, order, symbols=None):
    """Return the equation under `names`, parameters declared in `order`; text or SymPy."""
    drift, diffusion = text(*names) if symbols is None else equation(*symbols)
    parameters = [names[4:][i] for i in order]
    return moments.system(list(names[:3]), drift, diffusion, [names[3]], parameters)


def numbers_of(model, order, closure="gaussian"):
    """Return mean rate, covariance rate, predicted measurement and one Euler–Maruyama step."""
    inputs, parameters = np.array([INPUT]), NUMBERS[list(order)]
    kernels = uncompiled(sources.propagator_source(moments.close(model, closure)))
    packed = kernels["rates"](MEAN, P, inputs, parameters)
    rate = np.empty((3, 3))
    rate[np.triu_indices(3)] = rate.T[np.triu_indices(3)] = packed[3:]
    x, dx, normal = MEAN.copy(), np.empty(3), np.array([0.3, -1.2])
    step = uncompiled(sources.simulator_source(model))["advance"]
    step(x, inputs, parameters, normal, 0.01, 0.1, dx)
    h = moments.measurement(model, [model.states[0] * model.states[2] + model.parameters[0]])
    predicted, H, spread = np.empty((1, 1)), np.empty((1, 1, 3)), np.empty((1, 1, 1))
    expand = uncompiled(sources.measurement_source(h))["expand"]
    expand(MEAN[None], P[None], inputs, parameters, predicted, H, spread)
    return packed[:3], rate, dx, [*predicted.ravel(), *H.ravel(), *spread.ravel()]


def demand_the_numbers(model, order):
    mean_rate, rate, dx, measured = numbers_of(model, order)
    np.testing.assert_allclose(mean_rate, EXPECTED[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(rate, EXPECTED[1], rtol=0, atol=1e-12)
    f, G = equation(*MEAN, INPUT, *NUMBERS)
    np.testing.assert_allclose(dx, 0.01 * np.array(f) + 0.1 * np.array(G) @ [0.3, -1.2], atol=1e-14)
    # x z + k: the first of the declared parameters; ½ tr(h_xx P h_xx P) = P_xx P_zz + P_xz².
    predicted = MEAN[0] * MEAN[2] + P[0, 2] + NUMBERS[order[0]]
    spread = P[0, 0] * P[2, 2] + P[0, 2] ** 2
    np.testing.assert_allclose(measured, [predicted, MEAN[2], 0.0, MEAN[0], spread], atol=1e-14)


# ---------------------------------------------------------------- names

# What the generated text, its temporaries, Python and SymPy call their own.
WORDS = """a_0 a_1 a_2 c_0 c_1 c_2 h_0 s_0 s_1 t_0 t_1 w_0 w_1 x_0 x_1 y_0 y_1 y_3 m_0 m_1 p_0 p_1
p_2 u_0 u_1 P_0 P_1 P_0_0 P_0_1 mu_0 k i j n run runs lane first step steps root noise keep track
mean P inputs parameters work total rate rates advance simulate propagate expand kernel predicted
H spread np math erf exp pi sqrt abs Abs sin cos log atan2 min range lambda if else and or not is
in for def class None True import I E S N O Q oo nan zoo inf beta gamma zeta Sign Magnitude
SignedSquare Symbol m_x m_y m_u m_a P_xx P_xy P_aa P_ab P_aba mu_x_x mu_a_a_a s_x a b u v ab ba
a_a _ __ _0 é μ µ ｘ l1 O0"""
NAMES = st.sampled_from(WORDS.split()) | st.lists(
    st.sampled_from(["a", "b", "x", "u", "m_", "P_", "mu_", "s_", "_", "c_", "0", "1"]),
    min_size=1, max_size=4,
).map("".join).filter(str.isidentifier)  # fmt: skip
# A failure is told at once: to make its names shorter takes minutes.
QUICK = {"deadline": None, "phases": (Phase.explicit, Phase.generate)}
FIXED = [
    ("v", "w", "r", "tau", "a_0", "a_1", "a_2"),
    ("v", "w", "r", "tau", "c_1", "c_0", "c_2"),
    ("ab", "a", "ba", "P_aba", "P_ab", "P_aab", "P_baa"),
    ("u", "v", "w", "m_v", "m_u", "m_w", "P_uv"),
    ("u", "v", "w", "m_u", "P_uu", "P_vw", "P_vv"),
    ("P_0", "y_0", "s_1", "noise", "step", "root", "np"),
    ("lambda", "np", "step", "m_lambda", "root", "lane", "work"),
    ("y_3", "y_0", "y_1", "u_1", "p_2", "p_0", "p_1"),
    ("x_2", "x_1", "x_0", "w_0", "t_0", "h_0", "s_0"),
    ("m_2", "m_1", "m_0", "P_0_1", "P_0_0", "P_0_2", "u_0"),
    ("I", "E", "oo", "nan", "zoo", "pi", "S"),
    ("a", "a_a", "m_a", "m_a_a", "P_aa_a", "mu_a_a_a", "s_a"),
    ("exp", "sqrt", "Abs", "sin", "erf", "abs", "log"),
    ("and", "or", "not", "if", "is", "in", "for"),
]


@given(
    names=st.lists(NAMES, min_size=7, max_size=7, unique=True),
    order=st.permutations(range(3)),
)
@settings(max_examples=25, **QUICK)
def test_numbers_do_not_depend_on_names_or_their_order(names, order):
    demand_the_numbers(read(tuple(names), order), order)


@pytest.mark.parametrize("names", [PLAIN, *FIXED], ids=" ".join)
@pytest.mark.parametrize("closure", moments.CLOSURES)
def test_every_closure_has_the_numbers_of_plain_names(names, closure):
    order = (2, 0, 1)
    plain = numbers_of(read(PLAIN, order), order, closure)
    for one, other in zip(numbers_of(read(names, order), order, closure), plain, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-13)
    if closure == "gaussian":
        demand_the_numbers(read(names, order), order)


ASSUMPTIONS = [{}, {"real": True}, {"complex": True}, {"integer": True}, {"commutative": False}]


@given(
    names=st.lists(NAMES, min_size=7, max_size=7, unique=True),
    order=st.permutations(range(3)),
    assumptions=st.lists(st.sampled_from(ASSUMPTIONS), min_size=7, max_size=7),
)
@example(names=list(FIXED[0]), order=[1, 0, 2], assumptions=[{"commutative": False}] * 7)
@settings(max_examples=15, **QUICK)
def test_numbers_do_not_depend_on_what_is_assumed_of_symbols(names, order, assumptions):
    own = [sp.Symbol(name, **given) for name, given in zip(names, assumptions, strict=True)]
    demand_the_numbers(read(tuple(names), order, own), order)


@given(states=st.lists(NAMES, min_size=1, max_size=5, unique=True), others=st.lists(NAMES))
@example(states=["a", "a_a"], others=["mu_a_a_a", "s_a"])
@settings(max_examples=100, **QUICK)
def test_no_two_moments_share_a_name_and_none_is_a_users(states, others):
    others = [name for name in dict.fromkeys(others) if name not in states]
    n = len(states)
    model = moments.system(states, ["0"] * n, [1] * n, parameters=others)
    third = itertools.combinations_with_replacement(range(n), 3)
    fourth = itertools.combinations_with_replacement(range(n), 4)
    own = [*model.mean, *(model.covariance[i, j] for i in range(n) for j in range(i, n))]
    own += [moments.central_moment(model, indices) for indices in (*third, *fourth)]
    own += moments.characteristic(model)[0]
    names = [symbol.name for symbol in own]
    assert len(set(names)) == len(names)
    assert not set(names) & {*states, *others}


# ---------------------------------------------------------------- compiled


@pytest.mark.parametrize(
    ("given", "parameters", "numbers"),
    [
        ("-a_0*v - a_1*v**3", "a_0 a_1", {"a_0": 0.7, "a_1": 0.45}),
        ("-c_0*v - c_1*v**3", "c_1 c_0", {"c_0": 0.7, "c_1": 0.45}),
        ("-y_0*v - P_0*v**3", "P_0 y_0", {"y_0": 0.7, "P_0": 0.45}),
        ("-step*v - m_v*v**3", "m_v step", {"step": 0.7, "m_v": 0.45}),
    ],
)
def test_compiled_drag_is_that_of_the_parameters_by_name(given, parameters, numbers):
    model = moments.system("v", [given], [0.2], parameters=parameters)
    values = [numbers[name] for name in parameters.split()]
    mean, variance, (linear, cubic) = 0.8, 0.15, numbers.values()
    rates = moments.Propagator(moments.close(model, "gaussian")).rates(
        [mean], [[variance]], (), values
    )
    wanted = gauss_hermite(
        lambda v: ([-linear * v - cubic * v**3], [[0.2]]), np.array([mean]), np.array([[variance]])
    )
    assert rates[0][0] == pytest.approx(wanted[0][0], rel=1e-13)
    assert rates[1][0, 0] == pytest.approx(wanted[1][0, 0], rel=1e-13)
    track = moments.Simulator(model)(np.array([[mean]]), np.zeros((1, 1, 1)), 0.1, None, values)
    assert track[0, 1, 0] == pytest.approx(mean - 0.1 * (linear * mean + cubic * mean**3))


def test_covariances_of_ab_a_ba_are_three():
    # d P_(ab,a)/dt of a rotation mixes all of them; the numbers by A P + P Aᵀ + G Gᵀ.
    A = np.array([[-1.0, 2.0, 0.5], [0.3, -0.4, 1.0], [0.0, -0.7, -2.0]])
    drift = [f"{row[0]}*ab + {row[1]}*a + {row[2]}*ba" for row in A]
    model = moments.system("ab a ba", drift, [1, 2, 3])
    assert len({*model.covariance}) == 6
    rates = moments.Propagator(moments.close(model, "gaussian")).rates(MEAN, P)
    np.testing.assert_allclose(rates[0], A @ MEAN, rtol=1e-13)
    np.testing.assert_allclose(rates[1], A @ P + P @ A.T + np.diag([1.0, 4.0, 9.0]), rtol=1e-12)


def test_input_called_as_a_mean_is_the_input():
    model = moments.system("u v", ["-u + m_u", "u*v - m_u"], [1, 1], inputs="m_u")
    mean, C = np.array([0.5, 2.0]), np.array([[0.4, 0.1], [0.1, 0.3]])
    rates = moments.Propagator(moments.close(model, "gaussian")).rates(mean, C, [3.0])
    np.testing.assert_allclose(rates[0], [-0.5 + 3.0, 0.5 * 2.0 + 0.1 - 3.0], rtol=1e-13)


# ---------------------------------------------------------------- names that were not declared


@pytest.mark.parametrize("name", ["I", "E", "oo", "nan", "zoo", "pi", "S", "q", "x_0", "m_x"])
@pytest.mark.parametrize("form", ["{}", "{}*x", "x + {}", "-{}"])
def test_a_name_that_was_not_declared_is_refused(name, form):
    entry = form.format(name)
    told = rf"must not use {name}; known: x, k"
    with pytest.raises(ParameterError, match=told):
        moments.system("x", [entry], [1], parameters="k")
    with pytest.raises(ParameterError, match=told):
        moments.system("x", ["x"], [[entry]], parameters="k")
    with pytest.raises(ParameterError, match=told):
        moments.measurement(moments.system("x", ["x"], [1], parameters="k"), [entry])


@pytest.mark.parametrize("entry", ["x and y", "x or y", "not x", "x if y else 1", "x is y", "x<y"])
def test_logic_is_refused(entry):
    with pytest.raises(ParameterError, match=r"drift\[0\] = .*must (be a formula; |not use not)"):
        moments.system("x y", [entry, "y"], [1, 1])


def test_a_number_of_sympy_is_refused_also_where_its_name_is_a_state():
    state = sp.Symbol("E")
    assert moments.system("E", [-state], [1]).drift[0] == -sp.Symbol("E", real=True)
    with pytest.raises(ParameterError, match="must"):
        moments.system("E", [-sp.E], [1])
    assert math.isclose(float(sp.E), math.e)
