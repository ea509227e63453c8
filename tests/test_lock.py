"""The lock: exact, hashed, one numerics stack, what the project asks for and what is installed."""

import re
import tomllib
from collections import Counter
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

# Pure Python helpers of the notebook server that follow the interpreter's version.
# Everything else, numerics and plotting above all, appears once.
MAY_APPEAR_TWICE = {"soupsieve"}


def locked(lock):
    """Return the requirement of each entry; its hashes are checked on the way."""
    entries = lock.replace("\\\n", " ").splitlines()
    requirements = []
    for entry in entries:
        if entry.startswith("#") or not entry.strip():
            continue
        text, *hashes = re.split(r"\s+--hash=", entry.strip())
        assert hashes, f"{text}: no hash"
        assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", h.strip()) for h in hashes), text
        requirement = Requirement(text)
        assert re.fullmatch(r"==[^*,]+", str(requirement.specifier)), f"{text}: not exact"
        requirements.append(requirement)
    return requirements


def check_form(lock):
    assert "://" not in lock, "the lock holds an address"
    counts = Counter(canonicalize_name(requirement.name) for requirement in locked(lock))
    twice = {name for name, count in counts.items() if count > 1} - MAY_APPEAR_TWICE
    assert not twice, f"in two versions: {twice}"


def check_project(lock, project):
    versions = {}
    for requirement in locked(lock):
        (exact,) = requirement.specifier
        versions.setdefault(canonicalize_name(requirement.name), []).append(exact.version)
    extras = project.get("optional-dependencies", {}).values()
    for line in [*project["dependencies"], *(line for extra in extras for line in extra)]:
        wanted = Requirement(line)
        found = versions.get(canonicalize_name(wanted.name), [])
        assert found, f"{line}: not in the lock"
        assert all(v in wanted.specifier for v in found), f"{line}: the lock holds {found}"


def check_installed(lock, installed):
    here = [r for r in locked(lock) if r.marker is None or r.marker.evaluate()]
    expected = {canonicalize_name(r.name): r for r in here}
    for name, version in installed.items():
        assert name in expected, f"{name} is installed and not in the lock"
        assert version in expected[name].specifier, f"{name} {version} is not {expected[name]}"
    assert not expected.keys() - installed.keys(), "in the lock and not installed"


def test_every_entry_is_exact_hashed_and_alone():
    check_form(LOCK)


def test_lock_satisfies_the_project():
    check_project(LOCK, PROJECT)


def test_environment_is_that_of_the_lock():
    installed = {canonicalize_name(d.metadata["Name"]): d.version for d in distributions()}
    for name in ("pip", "setuptools", "seanav"):
        installed.pop(name, None)
    check_installed(LOCK, installed)


HASH = "    --hash=sha256:" + "0" * 64 + "\n"


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("numpy==2.0.0\n", "no hash"),
        ("numpy>=2.0.0 \\\n" + HASH, "not exact"),
        ("numpy==2.* \\\n" + HASH, "not exact"),
        ("numpy==2.0.0 \\\n    --hash=md5:0\n", "numpy"),
        ("numpy @ https://example.org/numpy.whl \\\n" + HASH, "address"),
        ("NumPy==2.0.0 ; python_version < '3.12' \\\n" + HASH, "two versions: {'numpy'}"),
        ("scipy==1.0.0 \\\n" + HASH, "two versions: {'scipy'}"),
    ],
)
def test_bad_entries_are_seen(entry, message):
    with pytest.raises(AssertionError, match=re.escape(message)):
        check_form(LOCK + entry)


def test_unsatisfied_project_is_seen():
    with pytest.raises(AssertionError, match="not in the lock"):
        check_project(LOCK, {"dependencies": ["no-such-package>=1"]})
    with pytest.raises(AssertionError, match="the lock holds"):
        check_project(LOCK, {"dependencies": [], "optional-dependencies": {"x": ["numpy<2"]}})


def test_other_environment_is_seen():
    lock = "numpy==2.0.0 \\\n" + HASH
    check_installed(lock, {"numpy": "2.0.0"})
    for installed in ({"numpy": "2.0.1"}, {}, {"numpy": "2.0.0", "extra": "1"}):
        with pytest.raises(AssertionError, match=r"lock|2\.0\.1"):
            check_installed(lock, installed)
