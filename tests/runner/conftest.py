"""Checkouts with a tiny paper in them."""

import shutil

import pytest
from tiny import FINISH, REPORT, STUDY, cell, empty_checkout, save

from seanav import runner


@pytest.fixture
def root(tmp_path, monkeypatch):
    """An empty checkout; what the runner sets for its kernel is undone afterwards."""
    for name in ("SEANAV_RESULTS", "SEANAV_PROGRESS"):
        monkeypatch.setenv(name, "")
    return empty_checkout(tmp_path / "empty")


@pytest.fixture(scope="session")
def full_run(tmp_path_factory):
    """A checkout whose one paper has run at full scale, once for all tests."""
    root = empty_checkout(tmp_path_factory.mktemp("full") / "checkout")
    save(root, cell(STUDY), cell(REPORT), cell(FINISH))
    with pytest.MonkeyPatch.context() as patch:
        for name in ("SEANAV_RESULTS", "SEANAV_PROGRESS"):
            patch.setenv(name, "")
        runner.run(root, "9_tiny")
    return root


@pytest.fixture
def finished(full_run, root):
    """A copy of that checkout, time stamps included."""
    shutil.copytree(full_run, root, dirs_exist_ok=True)
    return root
