"""Bad input gives one line with the name, the value and what is allowed."""

import math

import numpy as np
import pytest

from seanav.checks import ParameterError, choice, integer, number


def test_good_values_come_back_as_plain_types():
    assert type(integer("runs", np.int64(3), at_least=2)) is int
    assert type(number("noise", 3)) is float
    assert integer("runs", 2, at_least=2, at_most=2) == 2
    assert number("noise", 0.0, at_least=0.0, at_most=0.0) == 0.0
    assert choice("map", "real", ["real", "synthetic"]) == "real"


@pytest.mark.parametrize("value", [1, 2.0, "2", True, None, np.float64(3.0)])
def test_not_an_integer_of_at_least_two(value):
    with pytest.raises(ParameterError) as caught:
        integer("runs", value, at_least=2)
    assert str(caught.value) == f"runs = {value!r}: must be an integer of at least 2"


def test_a_truth_value_is_no_integer():
    with pytest.raises(ParameterError, match=r"^runs = True: must be an integer of at least 0$"):
        integer("runs", True, at_least=0)


def test_integer_above_its_bound():
    with pytest.raises(ParameterError, match=r"^k = 9: must be .* at least 2 and at most 8$"):
        integer("k", 9, at_least=2, at_most=8)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "1", True, None, 1 + 0j])
def test_not_a_finite_number(value):
    with pytest.raises(ParameterError, match=r"must be a finite number$"):
        number("noise", value)


@pytest.mark.parametrize(
    ("bounds", "bad", "words"),
    [
        ({"above": 0}, 0.0, "above 0"),
        ({"at_least": 0}, -1e-12, "at least 0"),
        ({"below": 90}, 90, "below 90"),
        ({"at_most": 1}, 1.1, "at most 1"),
        ({"above": 0, "at_most": 1}, 2.0, "above 0 and at most 1"),
    ],
)
def test_number_outside_its_bounds(bounds, bad, words):
    with pytest.raises(ParameterError) as caught:
        number("noise", bad, **bounds)
    assert str(caught.value) == f"noise = {bad!r}: must be a finite number {words}"


def test_choice_lists_what_is_allowed():
    with pytest.raises(ParameterError, match=r"^map = 'flat': must be one of 'real', 'wavy'$"):
        choice("map", "flat", ["real", "wavy"])


def test_parameter_error_is_a_value_error_of_one_line():
    assert issubclass(ParameterError, ValueError)
    assert "\n" not in str(ParameterError("path", "a\nb", "must be a file"))
