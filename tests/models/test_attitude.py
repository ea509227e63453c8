"""Quaternions of the kernels against rotation matrices."""

from itertools import pairwise

import numpy as np
import pytest

from seanav.models import attitude

RANDOM = np.random.default_rng(0)
VECTORS = [tuple(row) for row in RANDOM.standard_normal((6, 3))]


def _quaternion(theta):
    angle = np.linalg.norm(theta)
    return (np.cos(angle / 2), *(np.sin(angle / 2) / angle * np.array(theta)))


def _matrix(q):
    return np.stack([attitude._column(q, axis) for axis in range(3)], axis=1)


def test_products_of_vectors():
    for a, b in pairwise(VECTORS):
        assert attitude._dot(a, b) == pytest.approx(np.dot(a, b))
        assert attitude._cross(a, b) == pytest.approx(np.cross(a, b))
        assert attitude._plus_cross((1.0, 2.0, 3.0), a, b) == pytest.approx(
            np.array([1, 2, 3]) + np.cross(a, b)
        )


def test_columns_are_those_of_the_rotation_matrix():
    for theta in VECTORS:
        assert _matrix(_quaternion(theta)) == pytest.approx(attitude.exp_so3(theta), abs=1e-14)


def test_product_first_does_the_second_rotation():
    for one, two in pairwise(VECTORS):
        p, q = _quaternion(one), _quaternion(two)
        C = attitude.exp_so3(one) @ attitude.exp_so3(two)
        assert _matrix(attitude._multiply(p, q)) == pytest.approx(C, abs=1e-14)
        assert attitude._rotate(p, two) == pytest.approx(attitude.exp_so3(one) @ two)
        back = attitude._multiply(attitude._conjugate(p), p)
        assert back == pytest.approx([1, 0, 0, 0], abs=1e-15)


@pytest.mark.parametrize(
    ("make", "size", "off"),
    [
        (attitude._from_rotation_vector, 0.3, 2e-8),
        (attitude._from_small_rotation, 0.003, 1e-15),
        (lambda theta: attitude._from_half_angles(tuple(0.5 * x for x in theta)), 0.003, 2e-8),
    ],
)
def test_a_series_is_as_good_as_it_says(make, size, off):
    for vector in VECTORS:
        theta = tuple(size * np.array(vector) / np.linalg.norm(vector))
        gap = np.abs(np.array(make(theta)) - _quaternion(theta)).max()
        assert gap < off


def test_rotation_vector_undoes_the_quaternion():
    for vector in [*VECTORS, (1e-14, 0.0, 0.0), (0.0, 0.0, 0.0)]:
        if np.linalg.norm(vector) > 0:
            assert attitude._rotation_vector(_quaternion(vector)) == pytest.approx(vector)
    assert attitude._rotation_vector((1.0, 0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def test_normalise_mends_rounding():
    q = np.array(_quaternion(VECTORS[0]))
    once = attitude._normalise(tuple(q * (1 + 1e-9)))
    assert once == pytest.approx(q, rel=1e-15)
