"""Compiled equations: in another process, from several threads, against a law that is known."""

import os
import pickle
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy import stats

from seanav.filters import moments
from seanav.filters.moments import continuous_discrete, generated

# In the other process: nothing compiled so far, and not the same order of sets.
OTHER = """
import pickle, sys
from pathlib import Path
from seanav import _compile

_compile.CACHE = Path(sys.argv[2]) / "cache"
assert not any(name.startswith("generated_") for name in sys.modules)
from tests_of_pickles import numbers

with open(sys.argv[1], "rb") as file:
    objects = pickle.load(file)
print("modules", len(list(_compile.CACHE.glob("generated/*.py"))))
from seanav.filters.moments import sources

propagator, simulator, predictor = objects
print(propagator.source == sources.propagator_source(propagator.moments))
print(simulator.source == sources.simulator_source(simulator.model))
print(predictor.source == sources.measurement_source(predictor.measurement))
with open(sys.argv[2] + "/numbers", "wb") as file:
    pickle.dump(numbers(*objects), file)
"""


def numbers(propagator, simulator, predictor):
    """Return what the three compute, and a whole filter made of them."""
    known = np.array([0.3]), np.array([0.7, 1.2])
    mean, P = np.array([[0.4, -0.2], [1.0, 0.5]]), np.tile(0.2 * np.eye(2), (2, 1, 1))
    rates, measured = propagator.rates(mean[0], P[0], *known), predictor(mean, P, *known)
    noise = np.linspace(-1, 1, 10).reshape(2, 5, 1)
    track = simulator(mean.copy(), noise, 0.1, np.full((6, 1), 0.3), known[1])
    z = np.array([[[0.3], [0.1]], [[-0.4], [0.9]]])
    filtered = continuous_discrete.run(
        propagator, mean[0], P[0], z, 0.2, 0.1, np.eye(1), predictor,
        lambda times: np.sin(times)[:, None], known[1],
    )  # fmt: skip
    return [*rates, *measured, track, filtered.mean, filtered.P]


@pytest.fixture(scope="module")
def objects():
    drift = ["y - a_0*x*Abs(x)", "mu*(1 - x**2)*y - x + tau"]
    model = moments.system("x y", drift, [["0"], ["0.4"]], "tau", "mu a_0")
    return (
        moments.Propagator(moments.close(model, "gaussian")),
        moments.Simulator(model),
        moments.Predictor(moments.measurement(model, ["x*y + a_0"])),
    )


def test_another_process_has_the_same_numbers(objects, tmp_path):
    given = tmp_path / "objects"
    given.write_bytes(pickle.dumps(objects))
    shutil.copy(__file__, tmp_path / "tests_of_pickles.py")
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "PYTHONHASHSEED": "5"}
    done = subprocess.run(
        [sys.executable, "-c", OTHER, str(given), str(tmp_path)],
        capture_output=True, text=True, env=environment, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:-1] == ["modules 3", "True", "True", "True"]
    others = pickle.loads((tmp_path / "numbers").read_bytes())
    for one, other in zip(numbers(*objects), others, strict=True):
        assert np.array_equal(one, other)


def test_a_copy_is_as_good_as_the_object(objects):
    copies = pickle.loads(pickle.dumps(objects))
    assert [type(copy) for copy in copies] == [type(one) for one in objects]
    assert copies[0].moments == objects[0].moments
    assert copies[1].model == objects[1].model
    assert copies[2].measurement == objects[2].measurement
    for one, other in zip(numbers(*objects), numbers(*copies), strict=True):
        assert np.array_equal(one, other)


def test_state_dependent_noise_follows_the_lognormal_law():
    model = moments.system("x", ["a*x"], ["b*x"], parameters="a b")
    rng = np.random.default_rng(7)
    noise = rng.standard_normal((4000, 500, 1))
    end = moments.Simulator(model)(np.ones((4000, 1)), noise, 0.002, None, [0.2, 0.4], 500)
    law = stats.lognorm(0.4, scale=np.exp(0.2 - 0.08))
    assert stats.kstest(end[:, -1, 0], law.cdf).pvalue > 1e-3


def test_threads_share_one_finished_module():
    # The sleep stands for a long import: nobody may see the module before `value` is there.
    source = "import time\n\ntime.sleep(0.2)\nvalue = 7\n"
    with ThreadPoolExecutor(4) as pool:
        values = list(pool.map(lambda _: generated._module(source).value, range(4)))
    assert values == [7] * 4
