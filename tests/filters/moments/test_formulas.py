"""Formulas of a user: what is read, what is refused, and that nothing is ever run."""

import math
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from seanav.checks import ParameterError
from seanav.filters import moments
from seanav.filters.moments import formulas

x, k = sp.symbols("x k", real=True)
KNOWN = (x, k, sp.Symbol("lambda", real=True), sp.Symbol("pi", real=True))

# ---------------------------------------------------------------- attacks

# Each of these is handed in as drift, as diffusion and as measurement of x with parameter k.
ATTACKS = """
import sys, time
import numpy as np, sympy as sp
from seanav.checks import ParameterError
from seanav.filters import moments

canary, slot = sys.argv[1:]
x, k = sp.symbols("x k")
deep, wide = x, x
for _ in range(150):
    deep = sp.sin(deep)
for _ in range(60):
    wide = sp.sin(wide) + sp.cos(wide)
tall = "x"
for _ in range(30):
    tall = f"({tall}+1)**12"

run = f"__import__('os').system('touch {canary}')"
attacks = [
    f"x + 0*{run}", run, f"0 if {run} else x", f"[{run}][0]", f"(lambda: {run})()",
    f"x + 0*open('{canary}', 'w').write('x')", f"open('{canary}', 'w')", f"eval(\\"{run}\\")",
    f"f'{{{run}}}'", f"x*({run}or 1)", f"S('{run}')", f"sympify('{run}')", f"(k := {run})",
    f"exec('{run}')", f"x.subs(x, {run})", f"[{run} for _ in '1']", f"{run};x", f"x\\n{run}",
    "().__class__.__base__.__subclasses__()", "x.__class__", "x.real", "x.diff", "__builtins__",
    "x and k", "x or k", "not x", "x if k else 1", "x == k", "x < k", "x <= 1", "x != 1", "x is k",
    "x in k", "lambda: x", "lambda q: q", "(q := x)", "f'{x}'", "'x'", '"x"', "b'x'", "x=1",
    "[x]", "{x}", "{x: k}", "(x, k)", "x,", "x,k", "*x", "**x", "x[0]", "x[0:1]", "...", "x...",
    "True", "True*x", "None", "1j*x", "2j", "I*x", "E*x", "pi*x", "oo", "oo*x", "-oo", "zoo", "nan",
    "nan*x", "inf", "S(1)", "Symbol('x')", "Function('f')(x)", "Integral(x)", "N(x)", "Q(x)",
    "x//k", "x%k", "x@k", "x^2", "x|k", "x&k", "~x", "x>>1", "x<<9", "x!", "k x", "2x", "x2", "x k",
    "0x10*x", "1_0*x", "0b1*x", "1e*x", "1.2.3*x", "x..k", "$x", "`x`", "x?", "x#k", "x\\\\", "x\\0",
    "ｘ", "х", "x\\u200b", "x²", "½*x", "٣*x", "x×k", "x−k", "（x）", "x\\u0301",
    "", " ", "+", "(", ")", "()", "x)", "(x", "x(", "x()", "x(k)", "k(x)", "sin", "sin()", "sin(x",
    "sin(x, k)", "atan2(x)", "tan(x)", "factorial(x)", "gamma(x)", "Abs", "Abs()", "abs x",
    "x**1000000", "x**21", "9**9**9*x", "9**9**9", "2**-9**9**9", "x**x", "x**k", "k**x", "x**1e9",
    "x**(1/3)", "x**0.3", "(2*x)**1000000", "((9**9)**9)**9", "x**9**9**9**9**9",
    "1e999999999*x", "1e-999999999*x", "9"*100000, "9"*4000 + "*x", "0." + "0"*3000 + "1",
    "(" * 10000 + "x" + ")" * 10000, "(" * 50 + "x" + ")" * 50, "-" * 100000 + "x",
    "-" * 4000 + "x", "+".join("x" * 100000), "x" * 5001, "*".join("x" * 400) + "*Abs(x)",
    "*".join("x" * 2400), "x**" * 1500 + "x", "(x+k+1)**400", "(x+k+1)**100000", tall,
    "(1+x+k)**20*(1-x+k)**20", "*".join(["(x+k)"] * 30) + "*Abs(x)", "Abs(" * 45 + "x" + ")" * 45,
    "exp(" * 45 + "9" + ")" * 45, "exp(exp(exp(exp(9))))*x", "exp(1000)*x", "exp(1)*x",
    "1/0*x", "x/0", "x/(k-k)", "0**-1", "1/(1/0)", "sqrt(-1)*x", "sqrt(-4)", "log(-1)", "log(0)*x",
    "0*log(0)", "atan2(1, 1)", "atan2(0, 0)", "1/(sqrt(8)-2*sqrt(2))",
    None, True, np.bool_(True), object(), b"x", ["x", "k"], {"x": 1}, {1}, print, int, x.diff,
    math_nan := float("nan"), float("inf"), -np.inf, 1j, np.complex128(1), 10**100000, 1e300,
    np.array(["x"]), sp.I, sp.E, sp.pi * x, sp.oo, -sp.oo, sp.zoo, sp.nan, sp.true, sp.I * x,
    sp.E * x, sp.exp(1) * x, x < k, sp.Eq(x, k), sp.Function("f")(x), sp.Integral(x, x), sp.Dummy("x"),
    sp.Piecewise((x, x > 0), (k, True)), sp.Derivative(sp.Function("f")(x), x), sp.Lambda(x, x),
    sp.ImmutableMatrix([[x, k]]), sp.Max(x, k), sp.Wild("x"), sp.Symbol("x", commutative=False) * sp.Dummy(),
    sp.Symbol("q"), x**k, x**1000000, x**sp.pi, sp.Float("1e400") * x, sp.Integer(9)**9**5 * x,
    (x + k + 1)**400, deep, wide, sp.gamma(x), sp.sign(x), sp.re(x), sp.tan(x), sp.Order(x), sp.S.EmptySet,
    sp.MatrixSymbol("A", 1, 1)[0, 0], sp.IndexedBase("x")[0], sp.Sum(x, (x, 0, 3)),
]
print(len(attacks))
for attack in attacks:
    start = time.monotonic()
    try:
        if slot == "drift":
            moments.system("x", [attack], [1], parameters="k")
        elif slot == "diffusion":
            moments.system("x", ["x"], [[attack]], parameters="k")
        else:
            moments.measurement(moments.system("x", ["x"], [1], parameters="k"), [attack])
        words = "ACCEPTED"
    except ParameterError as error:
        words = "refused" if "\\n" not in str(error) and len(str(error)) < 400 else "LONG"
    except Exception as error:
        words = f"TRACEBACK {type(error).__name__}"
    if words != "refused" or time.monotonic() - start > 2:
        text = attack if isinstance(attack, str) else str(type(attack))
        print(words, ascii(text)[:70], round(time.monotonic() - start, 1), flush=True)
"""


@pytest.mark.parametrize("slot", ["drift", "diffusion", "h"])
def test_no_attack_runs_hangs_or_is_taken_for_a_formula(slot, tmp_path):
    canary = tmp_path / "canary"
    done = subprocess.run(
        [sys.executable, "-c", ATTACKS, str(canary), slot],
        capture_output=True, text=True, encoding="utf-8", timeout=120, check=False,
    )  # fmt: skip
    assert not canary.exists()
    count, *faults = done.stdout.splitlines()
    assert int(count) > 200
    assert faults == []
    assert done.stderr == ""


PIECES = [
    *"xk1239.e+-*/()^,_j[:=<\n ",
    "0.5",
    "10",
    "**",
    "sin(",
    "Abs(",
    "lambda",
    " if ",
    "x*",
    "(k",
]


@given(st.lists(st.sampled_from(PIECES), max_size=16).map("".join))
@settings(max_examples=1000, deadline=None)
def test_any_text_is_a_formula_of_known_names_or_one_line(text):
    try:
        value = formulas.formula("f", text, KNOWN)
    except ParameterError as error:
        if "\n" in str(error):
            raise
    else:
        assert value.free_symbols <= set(KNOWN)
        # What is read is what Python means by it.
        for at in (0.7, 1.9):
            names = {"x": at, "k": 1.3, "sin": math.sin, "Abs": abs}
            wanted = eval(f"({text})".replace("lambda", "k"), {"__builtins__": {}}, names)
            at_point = {symbol: 1.3 for symbol in KNOWN} | {x: at}
            assert float(value.subs(at_point)) == pytest.approx(float(wanted), rel=1e-9, abs=1e-9)


# ---------------------------------------------------------------- what is read


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-x**2", -(x**2)),
        ("2**-1*x", x / 2),
        ("x - -k", x + k),
        ("2**3**2/x**2", 512 / x**2),
        ("x/k/2*3", sp.Rational(3, 2) * x / k),
        ("x - k - 1", x - k - 1),
        ("-(x + k)*2", -2 * x - 2 * k),
        ("+x\n  + k\t", x + k),
        ("0.1*x + .5 + 2. + 1.5e-3*k", x / 10 + sp.Rational(5, 2) + sp.Rational(3, 2000) * k),
        ("0.10000000000000000001", sp.Rational(10**19 + 1, 10**20) / 1),
        ("8*x/3", sp.Rational(8, 3) * x),
        ("sqrt(k)*x**1.5", sp.sqrt(k) * x ** sp.Rational(3, 2)),
        ("x*Abs(x) + abs(k)", x * sp.Abs(x) + sp.Abs(k)),
        ("exp(sin(k)) + cos(log(k)) + atan2(x, k)",
         sp.exp(sp.sin(k)) + sp.cos(sp.log(k)) + sp.atan2(x, k)),
        ("lambda*pi", KNOWN[2] * KNOWN[3]),
    ],
)  # fmt: skip
def test_text_means_what_python_means_by_it(text, expected):
    value = formulas.formula("f", text, KNOWN)
    assert sp.expand(value - expected) == 0


def test_numbers_and_expressions_are_read_too():
    tenth = sp.Rational(1, 10)
    for number in (0.1, "0.1", Decimal("0.1"), Fraction(1, 10), np.float64(0.1), sp.Float(0.1)):
        assert formulas.formula("f", number, ()) == tenth
    assert formulas.formula("f", np.int64(-3), ()) == -3
    assert formulas.formula("f", 0.0 * sp.Float(1), ()) == 0
    for assumption in ({}, {"positive": True}, {"integer": True}, {"commutative": False}):
        own = sp.Symbol("x", **assumption)
        assert formulas.formula("f", own**2 + 3 * own, KNOWN) == x**2 + 3 * x
    # A name declared as pi is that name; the number has none.
    assert formulas.formula("f", sp.Symbol("pi"), KNOWN) == KNOWN[3] != sp.pi


def test_a_name_that_is_a_function_too_is_the_name():
    exp = sp.Symbol("exp", real=True)
    assert formulas.formula("f", "exp*2", [exp]) == 2 * exp
    with pytest.raises(ParameterError, match=r"f = 'exp\(2\)': must be a formula; \( is unexpec"):
        formulas.formula("f", "exp(2)", [exp])


def test_bounds_are_where_they_are_said_to_be():
    def read(text):
        return formulas.formula("f", text, KNOWN)

    nested = "(" * formulas.MAX_DEPTH + "x" + ")" * formulas.MAX_DEPTH
    assert read(nested) == x
    with pytest.raises(ParameterError, match="must not be nested deeper than 40"):
        read(f"({nested})")
    assert read("x" + " " * (formulas.MAX_LENGTH - 1)) == x
    with pytest.raises(ParameterError, match="must not be longer than 5000 characters"):
        read("x" + " " * formulas.MAX_LENGTH)
    assert read("x**20") == x**20
    for text in ("x**20*k", "(x*k)**11", "x**15/k**6"):
        with pytest.raises(ParameterError, match="must not be of a degree above 20"):
            read(text)
    read("(x + k)**20*(x + k)**0*(1 + k)**0")
    with pytest.raises(ParameterError, match="must not have more than 500 terms"):
        read("(x + k + lambda + pi + 1)**9")
    assert read("9" * 60) == 10**60 - 1
    for text in ("9" * 61, "1e61", "1e-60", "(10**10)**6", "1/(10**20*10**20*10**20)"):
        with pytest.raises(ParameterError, match="must not hold numbers of more than 60 digits"):
            read(text)


@pytest.mark.parametrize(
    "names",
    [5, None, b"x", ["x", "x"], "x x", "x y-z", ["x y"], [""], [1], "1x", "x²", {"x": 1}, [["x"]], "x.y"],
)  # fmt: skip
def test_names_are_names(names):
    with pytest.raises(ParameterError, match=r"states = .*must be different names") as caught:
        moments.system(names, ["1"], [1])
    assert "\n" not in str(caught.value)
