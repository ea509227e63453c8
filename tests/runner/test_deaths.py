"""A run that dies, wherever: nothing is lost, nothing half-written is taken for a result."""

import subprocess
import sys
from pathlib import Path

import pytest


def see(checkout, action, at_least, *error):
    script = Path(__file__).with_name("deaths.py")
    command = [sys.executable, script, checkout, action, *error]
    done = subprocess.run(command, check=False, capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    *faults, deaths = done.stdout.splitlines()
    assert faults == []
    assert int(deaths) >= at_least


@pytest.mark.parametrize(("action", "at_least"), [("full", 60), ("quick", 20), ("store", 4)])
def test_death_at_every_file_operation(finished, action, at_least):
    see(finished, action, at_least)


@pytest.mark.parametrize("error", ["ENOSPC", "EROFS"])
@pytest.mark.parametrize(("action", "at_least"), [("full", 30), ("quick", 10), ("store", 2)])
def test_a_disk_that_takes_nothing_more_costs_one_line_and_no_result(
    finished, action, at_least, error
):
    see(finished, action, at_least, error)
