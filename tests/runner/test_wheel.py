"""The package without its checkout: built, installed in a fresh environment, and used there."""

import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest
from flit_core import buildapi
from tiny import CHECKOUT

MISSION = """
from pathlib import Path
import seanav
from seanav import lesson, report
from seanav.studies.imm_sea_current import run, scores
from seanav.studies.imm_sea_current.scenario import Scenario

scenario = Scenario(runs=2, duration_s=600.0, trajectory="circle")
(flight,) = run.fly_all(scenario, [(run.EKF(0.3), 0.3)])
print(Path(seanav.__file__).resolve().parent)
print(f"{scores.tcep(flight).value:.6f}")
"""
ROOMS = """
import pkgutil, importlib, seanav
for module in pkgutil.walk_packages(seanav.__path__, "seanav."):
    if "__main__" not in module.name:
        importlib.import_module(module.name)
        print(module.name)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    here = Path.cwd()
    os.chdir(CHECKOUT)
    try:
        return folder / buildapi.build_wheel(str(folder))
    finally:
        os.chdir(here)


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """Return the interpreter of a fresh environment, and a folder without a checkout."""
    home = tmp_path_factory.mktemp("home")
    venv.create(home / "env", with_pip=False)
    python = home / "env/bin/python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q"]
    pip += ["--no-deps", "--no-index", "--disable-pip-version-check", str(wheel)]
    subprocess.run(pip, check=True)
    # What the package depends on comes from here; its own sources do not.
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(home / "env")}))
    (packages / "others.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return python, home


def said(installed, program):
    python, home = installed
    done = subprocess.run(
        [python, "-I", "-c", program], cwd=home, capture_output=True, encoding="utf-8"
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_mission_is_flown_and_is_the_same_as_in_the_checkout(installed):
    place, there = said(installed, MISSION)
    assert Path(place).is_relative_to(installed[1].resolve())
    done = subprocess.run(
        [sys.executable, "-c", MISSION], check=True, capture_output=True, encoding="utf-8"
    )
    assert done.stdout.split()[1] == there


def test_every_module_can_be_imported(installed):
    names = said(installed, ROOMS)
    files = [p for p in (CHECKOUT / "src/seanav").rglob("*.py") if p.name != "__init__.py"]
    assert {f"seanav.{p.stem}" for p in files if p.parent.name == "seanav"} - set(names) == {
        "seanav.__main__"
    }
    assert len([n for n in names if n.startswith("seanav.studies.")]) > 20


def test_the_wheel_holds_the_package_and_what_it_reads(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    sources = CHECKOUT / "src"
    wanted = {
        path.relative_to(sources).as_posix()
        for path in (sources / "seanav").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert wanted <= set(names)
    assert all(name.startswith("seanav") for name in names)
