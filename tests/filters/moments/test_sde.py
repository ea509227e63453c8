"""A user's equation is read or refused; what a measurement sees of it, against Lie derivatives."""

import pytest
import sympy as sp

from seanav.checks import ParameterError
from seanav.filters import moments


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("x", ["sin(x)"], [1]),
            r"drift\[0\] = 'sin\(x\)': must be a polynomial in the states, or",
        ),
        (("x", ["1/x"], [1]), r"drift\[0\].*must be a polynomial"),
        (("x y", ["x*y*Abs(x)", "y"], [1, 1]), r"drift\[0\].*terms c\*x\*Abs\(x\)"),
        (("x", ["sqrt(x)"], [1]), r"drift\[0\].*must be a polynomial"),
        (("x y", ["x"], [1, 1]), "drift = .*must have 2 entries, one per state"),
        (("x y", ["x", "y"], [[1, 0]]), "diffusion = .*must have 2 rows of equal length"),
        (("x y", ["x", "y"], [[1, 0], [1]]), "diffusion = .*must have 2 rows of equal length"),
        (("x", ["k*x"], [1]), r"drift\[0\] = 'k\*x': must not use k; known: x"),
        (("x", ["x +"], [1]), r"drift\[0\] = 'x \+': must be a formula"),
        (("x x", ["x", "x"], [1, 1]), "states = .*must be different names"),
        (("x", ["x"], ["exp(x)"]), r"diffusion\[0\]\[0\] = 'exp\(x\)': must be a polynomial"),
    ],
)
def test_unusable_equation_is_one_clear_line(arguments, message):
    with pytest.raises(ParameterError, match=message) as caught:
        moments.system(*arguments)
    assert "\n" not in str(caught.value)


# ---------------------------------------------------------------- observability


def test_observability_rank_of_linear_systems_is_kalmans():
    model = moments.system("x y z", ["y", "z", "-x"], [1, 1, 1])
    x, y, z = model.states
    point = {x: 1, y: 2, z: 3}
    assert moments.observability(model, [x], point, 4) == [1, 2, 3, 3]
    hidden = moments.system("x y z", ["y", "-x", "-z"], [1, 1, 1])
    x, y, z = hidden.states
    assert moments.observability(hidden, [x], {x: 1, y: 2, z: 3}, 4) == [1, 2, 2, 2]
    # A chain: only the last of four derivatives sees the last state.
    chain = moments.system("a b c d", ["b", "c", "d", "0"], [1] * 4)
    assert moments.observability(chain, chain.states[:1], dict.fromkeys(chain.states, 1), 4) == [
        *range(1, 5)
    ]


def test_observability_rank_agrees_with_lie_derivatives_written_out():
    model = moments.system("x y z", ["y*z", "x*z - y**3", "x - z"], [1, 1, 1])
    x, y, z = model.states
    point = {x: sp.Rational(1, 2), y: sp.Rational(2, 3), z: -1}
    rows, lie, ranks = [], x, []
    for _ in range(4):
        rows.append([sp.diff(lie, s).subs(point) for s in model.states])
        lie = sum(f * sp.diff(lie, s) for f, s in zip(model.drift, model.states, strict=True))
        ranks.append(sp.Matrix(rows).rank())
    assert moments.observability(model, [x], point, 4) == ranks
