"""Paper 1 on own systems: the file, its injections and refusals, and the path of the notebook."""

import copy
import re

import attrs
import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm, solve_continuous_lyapunov

from seanav.checks import ParameterError
from seanav.filters import moments
from seanav.studies.ito_filter import figures, own_sde, run
from seanav.studies.ito_filter.scenario import Scenario

FEW = Scenario(runs=60, particle_runs=2)
GOOD = {
    "states": ["x", "v"],
    "step": 0.02,
    "interval": 0.2,
    "duration": 4.0,
    "drift": {"x": "v", "v": "-a*x - b*v"},
    "diffusion": {"x": 0, "v": "s"},
    "parameters": {"a": 1.5, "b": 0.4, "s": 0.3},
    "mean": {"x": 1.0, "v": 0.0},
    "variance": {"x": 0.1, "v": 0.2},
    "measurement": {"h": ["x"], "variance": [0.01]},
    "units": {"x": "m"},
}


def toml(value, inside=False):
    """Return a value as TOML writes it; a table of the top level with its head."""
    if isinstance(value, dict) and not inside:
        plain = {k: v for k, v in value.items() if not isinstance(v, dict)}
        lines = [f"{k} = {toml(v, True)}" for k, v in plain.items()]
        for k, v in value.items():
            if isinstance(v, dict):
                lines += [f"[{k}]", *(f'"{n}" = {toml(x, True)}' for n, x in v.items())]
        return "\n".join(lines) + "\n"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k} = {toml(v, True)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(toml(v, True) for v in value) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return {True: "true", False: "false"}.get(value) if isinstance(value, bool) else repr(value)


@pytest.fixture
def read(tmp_path):
    def written(content, scenario=FEW):
        path = tmp_path / "own.toml"
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            text = content if isinstance(content, str) else toml(content)
            path.write_text(text, encoding="utf-8")
        try:
            return own_sde.read(attrs.evolve(scenario, sde_file=str(path)))
        finally:
            assert list(tmp_path.iterdir()) == [path]  # nothing is written

    return written


def changed(*keys, to=None):
    content = copy.deepcopy(GOOD)
    inner = content
    for key in keys[:-1]:
        inner = inner[key]
    if to is None:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = to
    return content


# ---------------------------------------------------------------- what is read


def test_a_good_file_is_the_system_that_it_says(read):
    own = read(GOOD)
    x, v = own.model.states
    a, b, s = own.model.parameters
    assert list(own.model.drift) == [v, sp.expand(-a * x - b * v)]
    assert own.model.diffusion == sp.Matrix([[0, 0], [0, s]])
    assert own.parameters.tolist() == [1.5, 0.4, 0.3]
    assert own.mean.tolist() == [1.0, 0.0]
    assert np.array_equal(own.P0, np.diag([0.1, 0.2]))
    assert np.array_equal(own.measured, [[1.0, 0.0]])
    assert (own.units, own.source) == (("m", ""), "own.toml")
    rows = changed("diffusion", to={"x": ["0", "s"], "v": ["s", "1"]})
    assert read(rows).model.diffusion == sp.Matrix([[0, s], [s, 1]])


def test_the_built_in_file_is_read_like_any_other(read):
    own, same = own_sde.read(FEW), read(own_sde.BUILT_IN)
    assert own.source == "built in"
    assert own.model == same.model
    assert own_sde.observed(own)[-1] == 2


def test_the_papers_vehicle_written_as_a_file_has_the_same_equations(read):
    vehicle = run.body()
    content = changed("units")
    content["states"] = [x.name for x in vehicle.states]
    inputs = {x.name: sp.Integer(0) for x in vehicle.inputs}
    still = [sp.expand(f.xreplace({x: 0 for x in vehicle.inputs})) for f in vehicle.drift]
    assert inputs
    content["drift"] = {
        x.name: str(f).replace("SignedSquare", "square")
        for x, f in zip(vehicle.states, still, strict=True)
    }
    for name, text in content["drift"].items():
        for x in content["states"]:
            text = text.replace(f"square({x})", f"{x}*Abs({x})")
        content["drift"][name] = text
    noises = np.array(vehicle.diffusion.tolist())
    content["diffusion"] = {x: str(noises[i, i]) for i, x in enumerate(content["states"])}
    content["parameters"] = dict.fromkeys((x.name for x in vehicle.parameters), 1.0)
    content["mean"] = dict.fromkeys(content["states"], 0.1)
    content["variance"] = dict.fromkeys(content["states"], 0.1)
    content["measurement"] = {"h": content["states"][:3], "variance": [0.1] * 3}
    own = read(content)
    differ = [sp.expand(f - g) for f, g in zip(own.model.drift, still, strict=True)]
    assert differ == [0] * 6
    mine = moments.close(own.model, "gaussian").mean_rate
    theirs = moments.close(vehicle, "gaussian").mean_rate
    zero = {x: 0 for x in vehicle.inputs}
    assert [sp.expand(p - q.xreplace(zero)) for p, q in zip(mine, theirs, strict=True)] == [0] * 6


def test_the_order_of_a_tables_entries_means_nothing(read):
    tables = {key: dict(reversed(GOOD[key].items())) for key in own_sde.TABLES}
    own, same = read(GOOD | tables), read(GOOD)
    assert own.model == same.model
    assert own.mean.tolist() == same.mean.tolist()
    assert np.array_equal(own.P0, same.P0)


# ---------------------------------------------------------------- what is computed


def test_runs_start_with_the_mean_and_variance_of_the_file(read):
    many = attrs.evolve(FEW, runs=4000)
    start = own_sde.simulate(many, read(changed("duration", to=0.2), many)).x[:, 0]
    sd = np.sqrt([0.1, 0.2])
    assert np.allclose(start.mean(axis=0), [1.0, 0.0], atol=4 * sd / np.sqrt(4000))
    assert np.allclose(start.std(axis=0), sd, rtol=4 / np.sqrt(2 * 4000))


@pytest.mark.parametrize("h", ["log(x)", "sqrt(x)"])
def test_a_measurement_that_is_not_real_is_one_line(h, read):
    own = read(changed("measurement", "h", to=[h]))
    with pytest.raises(ParameterError, match=r"^sde_file = .*measurement\.h: '.*finite[^\n]*$"):
        own_sde.study(FEW, own)


def test_a_linear_system_is_filtered_by_kalmans_filter(read):
    own = read(changed("step", to=0.001) | {"duration": 2.0})
    truth, tracks = own_sde.study(FEW, own)
    z = own_sde.measure(FEW, own, truth)
    A, G = np.array([[0.0, 1.0], [-1.5, -0.4]]), np.diag([0.0, 0.09])
    # Van Loan's block matrix: transition and process noise over an interval, exactly.
    block = expm(0.2 * np.block([[-A, G], [np.zeros((2, 2)), A.T]]))
    Phi = block[2:, 2:].T
    Q = Phi @ block[:2, 2:]
    H, R = np.array([[1.0, 0.0]]), 0.01
    mean, P = np.tile(own.mean, (60, 1)), own.P0
    for k in range(z.shape[1]):
        mean, P = mean @ Phi.T, Phi @ P @ Phi.T + Q
        K = P @ H.T / (H @ P @ H.T + R)
        mean = mean + (z[:, k] - mean @ H.T) @ K.T
        P = P - K @ H @ P
        for name in moments.CLOSURES:
            assert np.allclose(tracks[name].mean[:, k + 1], mean, atol=1e-7)
            assert np.allclose(tracks[name].P[:, k + 1], P, atol=1e-7)


def test_a_linear_system_spreads_as_lyapunov_says(read):
    long = changed("duration", to=40.0) | {"step": 0.002}
    own = read(long, attrs.evolve(FEW, runs=400))
    truth = own_sde.simulate(attrs.evolve(FEW, runs=400), own)
    A, G = np.array([[0.0, 1.0], [-1.5, -0.4]]), np.diag([0.0, 0.09])
    stationary = solve_continuous_lyapunov(A, -G)
    late = truth.x[:, 100::20].reshape(-1, 2)
    assert np.allclose(np.cov(late.T), stationary, atol=0.06 * stationary.max())


def test_a_cubic_is_the_equation_by_hand(read):
    content = changed("states", to=["x"]) | {
        "drift": {"x": "-c*x**3"},
        "diffusion": {"x": "s"},
        "parameters": {"c": 2.0, "s": 0.5},
        "mean": {"x": 0.4},
        "variance": {"x": 0.1},
        "measurement": {"h": ["x**2"], "variance": [0.01]},
        "units": {},
    }
    own = read(content)
    m, p = 0.4, 0.1
    rate, growth = own_sde._propagator(own.model, "gaussian").rates(
        [m], [[p]], None, own.parameters
    )
    assert rate[0] == pytest.approx(-2.0 * (m**3 + 3 * m * p))
    assert growth[0, 0] == pytest.approx(-2 * 2.0 * (3 * m**2 * p + 3 * p**2) + 0.25)
    assert isinstance(own.measured, moments.Predictor)
    truth, tracks = own_sde.study(FEW, own)
    z = own_sde.measure(FEW, own, truth)
    noise = z[..., 0] - truth.x[:, 1:, 0] ** 2
    assert noise.std() == pytest.approx(0.1, rel=0.1)
    rows = own_sde.rows(own, truth, tracks)
    assert len(rows) == 4
    assert isinstance(own_sde.observed(own), str)  # the measured is no state


def test_a_filter_that_is_told_the_truth_knows_its_error(read):
    own = read(GOOD, attrs.evolve(FEW, runs=200))
    truth, tracks = own_sde.study(attrs.evolve(FEW, runs=200), own)
    rows = own_sde.rows(own, truth, tracks)
    values = {(row[0], row[1]): row for row in rows}
    assert len(rows) == 8
    ratio, nees = (float(text.split()[0]) for text in values["gaussian", "x"][-2:])
    assert ratio == pytest.approx(1.0, abs=0.1)
    assert nees == pytest.approx(2.0, abs=0.15)
    assert values["gaussian", "x"][3] < values["prediction only", "x"][3]
    assert own_sde.told(own, truth, rows)[0].startswith("x: RMSE ")
    figures.own_sde(own, truth, tracks["gaussian"], tracks["prediction only"])


def test_what_explodes_is_shown_as_diverged(read):
    content = changed("drift", "v", to="x**3 + b*v + a*s")
    own = read(content)
    truth, tracks = own_sde.study(FEW, own)
    rows = own_sde.rows(own, truth, tracks)
    assert {row[3] for row in rows if row[0] == "gaussian"} == {"diverged"}
    (line,) = own_sde.told(own, truth, rows)
    assert re.fullmatch(r"the system itself left all bounds in \d+ of \d+ runs: .+", line)


def test_a_certain_system_without_noise_has_rows_too(read):
    content = changed("variance", to={"x": 0, "v": 0}) | {"diffusion": {"x": 0, "v": 0}}
    own = read(content)
    truth, tracks = own_sde.study(FEW, own)
    rows = own_sde.rows(own, truth, tracks)
    assert {row[-1] for row in rows} == {"no NEES"}
    assert own_sde.told(own, truth, rows)


# ---------------------------------------------------------------- refusals


def formula(text):
    return changed("drift", "v", to=text)


BAD = {
    "no TOML": ("states = [", "must be TOML"),
    "two equal keys": ('states = ["x"]\nstates = ["x"]\n', "must be TOML"),
    "deep": ("x = " + "[" * 5000, "must be TOML"),
    "empty": ("\n", "must not be empty"),
    "thousands of digits": ("step = " + "9" * 5000, "must be TOML"),
    "no text": (b"\xff\xfe", "must be text"),
    "too large": ("# " + "x" * 70_000, "must be a file of at most"),
    "no states": (changed("states"), "must hold 'states', too"),
    "no drift": (changed("drift"), "must hold 'drift', too"),
    "no drift of a state": (changed("drift", "v"), "must hold 'v', too"),
    "unknown key": (GOOD | {"noise": 1}, "'noise': must hold states, drift"),
    "unknown state": (changed("mean", "w", to=1.0), "mean = 'w': must hold x, v only"),
    "states as text": (changed("states", to="x v"), "must be a list of names"),
    "state twice": (changed("states", to=["x", "x"]), "different names"),
    "a name with a space": (
        changed("states", to=["x y", "v"]) | {"drift": {"x y": "v", "v": "1"}},
        "must",
    ),
    "no state at all": (changed("states", to=[]), "number of states"),
    "nine states": (changed("states", to=[f"x{k}" for k in range(9)]), "at most 8"),
    "drift as list": (changed("drift", to=["v", "x"]), "must be a table"),
    "a name that nobody knows": (formula("-q*x"), "drift[1]"),
    "a formula of two lines": (formula("x\n+ v*"), "must be TOML"),
    "true as formula": (formula(True), "must be a formula as text"),
    "a list as drift": (formula(["x"]), "must be a formula as text"),
    "sine": (formula("sin(x)"), "polynomial"),
    "quotient": (formula("1/x"), "drift[1]"),
    "ragged noise": (changed("diffusion", to={"x": ["1", "2"], "v": ["1"]}), "equal length"),
    "a list and a number": (changed("diffusion", to={"x": ["1"], "v": "1"}), "equal length"),
    "parameter as text": (changed("parameters", "a", to="1.5"), "parameters.a = '1.5'"),
    "parameter as state": (changed("parameters", "x", to=1.0), "must be different names"),
    "mean as text": (changed("mean", "x", to="one"), "mean.x = 'one'"),
    "negative variance": (changed("variance", "v", to=-0.1), "variance.v = -0.1"),
    "no measurement noise": (changed("measurement", "variance", to=[0.0]), "above 0"),
    "two variances for one": (changed("measurement", "variance", to=[0.1, 0.1]), "a list of 1"),
    "nothing measured": (changed("measurement", "h", to=[]), "measurement.h"),
    "h of an unknown name": (changed("measurement", "h", to=["y"]), "h[0]"),
    "uneven step": (changed("step", to=0.03), "must divide"),
    "interval beyond": (changed("interval", to=8.0), "interval = 8"),
    "step of zero": (changed("step", to=0.0), "step = 0"),
    "too many steps": (changed("step", to=1e-8), "step = 1e-08"),
    "units as numbers": (changed("units", "x", to=3), "must be a table of texts"),
    "unit as a formula": (changed("units", "x", to="$\\frac$"), "units.x"),
    "unit of two lines": (changed("units", "x", to="m/\ts"), "units.x"),
    "units of nobody": (changed("units", "z", to="m"), "must hold x, v only"),
    "a date": (changed("duration", to="2020-01-01"), "duration = '2020-01-01'"),
}
INJECTED = [
    "__import__('os').system('touch hacked')",
    "().__class__.__bases__[0].__subclasses__()",
    "lambda: 0",
    "eval('1')",
    "open('hacked', 'w')",
    "x.__class__",
    "x if x else v",
    "[x for x in (1,)][0]",
    "exec(x)",
    "x; v",
    "x := 1",
    "9**9**9**9",
    "(" * 3000 + "x" + ")" * 3000,
    "(" * 2000 + "x" + ")" * 2000,
    "x**1000",
    "+".join(["x"] * 4000),
    "1" * 400 + "*x",
    "ｘ",  # looks like x
    "х",  # Cyrillic
    "x\u200b",
    "f'{x}'",
    "getattr(x, 'name')",
    "nan*x",
    "inf*x",
]


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_file_is_one_line(kind, read):
    content, why = BAD[kind]
    with pytest.raises(ParameterError) as error:
        read(content)
    said = str(error.value)
    assert why in said
    assert "\n" not in said
    assert said.startswith("sde_file = ")


@pytest.mark.parametrize("text", INJECTED, ids=range(len(INJECTED)))
@pytest.mark.parametrize("place", ["drift", "diffusion", "h"])
def test_a_formula_is_never_a_program(text, place, read, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = formula(text)
    if place == "diffusion":
        content = changed("diffusion", "v", to=text)
    elif place == "h":
        content = changed("measurement", "h", to=[text])
    with pytest.raises(ParameterError) as error:
        read(content)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 500


def test_what_is_no_file_is_one_line(tmp_path):
    for path in (tmp_path, tmp_path / "none.toml"):
        with pytest.raises(ParameterError, match=r"^sde_file = .*existing file"):
            own_sde.read(attrs.evolve(FEW, sde_file=str(path)))


def test_too_much_work_is_refused_before_it_begins(read):
    with pytest.raises(ParameterError, match=r"duration = .*at most .* steps"):
        read(changed("duration", to=400.0), attrs.evolve(FEW, runs=5000))
