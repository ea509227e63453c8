"""Bad input gives one line with the name, the value and what is allowed."""

import math

import numpy as np
import pytest

from seanav.checks import (
    ParameterError,
    array,
    choice,
    covariance,
    in_place,
    integer,
    number,
    parts,
)


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


def test_an_array_comes_back_as_contiguous_floats_of_its_own_shape():
    found = array("x", np.arange(6).reshape(2, 3).T, (3, "runs"))
    assert found.dtype == np.float64
    assert found.flags.c_contiguous
    np.testing.assert_array_equal(found, [[0, 3], [1, 4], [2, 5]])
    assert array("R", np.float32(2), ()).shape == ()


def test_the_same_word_is_the_same_length_in_every_array():
    sizes = {}
    array("mean", np.zeros((3, 2)), ("runs", "states"), sizes)
    assert sizes == {"runs": 3, "states": 2}
    array("P", np.zeros((3, 2, 2)), ("runs", "states", "states"), sizes)
    with pytest.raises(ParameterError) as caught:
        array("P", np.zeros((1, 2, 2)), ("runs", "states", "states"), sizes)
    told = "P = (1, 2, 2): must have the shape (3, 2, 2) (runs, states, states)"
    assert str(caught.value) == told


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (np.zeros((2, 3)), "x = (2, 3): must have the shape (2, 2)"),
        (np.zeros(2), "x = (2,): must have the shape (2, 2)"),
        (3.0, "x = (): must have the shape (2, 2)"),
        ([[0, 1], [np.nan, 1]], "x = nan: must be finite everywhere, is not at (1, 0)"),
        ([[0, 1], [1]], "x = [[0, 1], [1]]: must be an array of real numbers"),
        ([["a", "b"], ["c", "d"]], "must be an array of real numbers"),
        (np.eye(2) * 1j, "must be an array of real numbers"),
        (np.eye(2) > 0, "must be an array of real numbers"),
        (None, "x = None: must be an array of real numbers"),
    ],
)
def test_no_such_array(value, told):
    with pytest.raises(ParameterError) as caught:
        array("x", value, (2, 2))
    assert told in str(caught.value)


def test_dots_stand_for_the_same_axes_in_every_array():
    sizes = {}
    array("C", np.zeros((4, 5, 3, 3)), (..., 3, 3), sizes)
    assert array("v", np.zeros((4, 5, 3)), (..., 3), sizes).shape == (4, 5, 3)
    with pytest.raises(ParameterError, match=r"v = \(4, 3\): must have the shape \(4, 5, 3\)"):
        array("v", np.zeros((4, 3)), (..., 3), sizes)
    assert array("speed", 2.0, (...,)).shape == ()
    with pytest.raises(ParameterError, match=r"v = \(\): must have the shape"):
        array("v", 2.0, (..., 3))


def test_entries_of_an_array_have_bounds():
    assert array("w", [0.0, 1.0], (2,), at_least=0, at_most=1).tolist() == [0, 1]
    with pytest.raises(ParameterError, match=r"^w = -0.5: must be at least 0 everywhere$"):
        array("w", [0.0, -0.5], (2,), at_least=0)
    with pytest.raises(ParameterError, match=r"^w = 1.5: must be at most 1 everywhere$"):
        array("w", [1.5, 0.0], (2,), at_most=1)
    assert array("log", [-np.inf], (1,), also=-np.inf).tolist() == [-np.inf]
    with pytest.raises(ParameterError, match=r"^log = inf: must be finite"):
        array("log", [np.inf, -np.inf], (2,), also=-np.inf)


def test_an_array_is_copied_only_for_its_order():
    view = np.zeros((3, 4)).T
    assert np.shares_memory(array("x", view, (4, 3), contiguous=False), view)
    assert array("x", view, (4, 3)).flags.c_contiguous


def test_masked_entries_are_no_numbers():
    value = np.ma.array([1.0, 2.0], mask=[False, True])
    with pytest.raises(ParameterError, match="must be an array of real numbers"):
        array("x", value, (2,))


def test_an_integer_beyond_the_floats_is_no_finite_number():
    with pytest.raises(ParameterError, match="must be a finite number"):
        number("noise", 10**400)


def test_an_empty_axis_is_refused():
    with pytest.raises(ParameterError, match=r"must have the shape \(runs, 2\)"):
        array("x", np.zeros((0, 2)), ("runs", 2))


@pytest.mark.parametrize(
    "value", [[0.0, 1.0], np.arange(2), np.arange(4.0)[::2], np.float32([0, 1])]
)
def test_what_is_changed_in_place_is_never_a_copy(value):
    with pytest.raises(ParameterError, match="it is changed in place"):
        in_place("mean", value, (2,))


def test_what_can_be_changed_in_place_is_the_same_object():
    value = np.zeros(2)
    assert in_place("mean", value, ("n",)) is value
    value.flags.writeable = False
    with pytest.raises(ParameterError, match="writable"):
        in_place("mean", value, ("n",))


def test_a_covariance_is_symmetric_and_positive_in_its_own_units():
    assert covariance("P", np.diag([1e-12, 1e12]), 2, definite=True).shape == (2, 2)
    covariance("P", np.zeros((2, 2)), 2)
    for bad in ([[1, 2], [2, 1]], [[1, 0.1], [0, 1]], [[0, 1], [1, 0]]):
        with pytest.raises(ParameterError, match="positive semidefinite"):
            covariance("P", bad, 2)
    with pytest.raises(ParameterError, match="positive definite"):
        covariance("P", np.diag([1.0, 0.0]), 2, definite=True)


def test_a_long_value_is_cut():
    with pytest.raises(ParameterError) as caught:
        integer("runs", 10**400, at_least=2, at_most=9)
    assert len(str(caught.value)) < 200
    with pytest.raises(ParameterError, match="too many digits"):
        integer("runs", 10**10_000, at_least=2, at_most=9)


@pytest.mark.parametrize("value", [True, "1", None, [1], np.eye(2), 2])
def test_not_one_of_the_choices(value):
    with pytest.raises(ParameterError, match="must be one of 1, 3"):
        choice("log_axes", value, (1, 3))


@pytest.mark.parametrize(("part", "whole", "count"), [(0.1, 0.3, 3), (0.01, 40.0, 4000), (2, 2, 1)])
def test_parts_of_a_time_that_divides(part, whole, count):
    assert parts("step", part, "interval", whole) == count


@pytest.mark.parametrize(
    ("part", "whole", "told"),
    [
        (0.02, 0.25, "step = 0.02: must divide interval = 0.25 evenly"),
        (0.5, 0.25, "step = 0.5: must divide interval = 0.25 evenly"),
        (1e300, 1e-300, "must divide"),
        (1e-9, 0.5, "step = 1e-09: must cut interval = 0.5 into at most 100000 parts"),
        (1e-300, 1e300, "must cut"),
        (0.0, 0.5, "step = 0.0: must be a finite number above 0"),
        (0.1, float("nan"), "interval = nan: must be a finite number above 0"),
    ],
)
def test_a_step_that_does_not_divide_is_refused(part, whole, told):
    with pytest.raises(ParameterError, match=told):
        parts("step", part, "interval", whole)
