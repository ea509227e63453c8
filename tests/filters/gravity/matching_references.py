"""Maps, random numbers and closed forms for the tests of the matching filters."""

import numpy as np

MGAL = 1e-5
SPACING = 1000.0
SLOPE = np.array([0.9, -1.7]) * MGAL / 1e3  # east, north
P0 = np.array([[1.1e6, 0.3e6], [0.3e6, 0.8e6]])
Q = np.array([[900.0, 200.0], [200.0, 400.0]])
R = (2 * MGAL) ** 2


def plane(nodes=61):
    i, j = np.mgrid[:nodes, :nodes] * SPACING
    return 3 * MGAL + SLOPE[0] * j + SLOPE[1] * i


def hills(nodes=61):
    """Return a smooth map of about ±40 mGal with slopes of up to some 6 mGal/km."""
    i, j = np.mgrid[:nodes, :nodes] * 2 * np.pi
    waves = np.sin(j / 31 + i / 47) + 0.7 * np.cos(i / 23 - j / 61) + 0.4 * np.sin(j / 15 + 1)
    return 19 * MGAL * waves


def simulate(runs, steps=25, *, start=(15e3, 20e3), end=(45e3, 38e3), seed=1, P0=P0, Q=Q, R=R):
    """Return truth, initial_error, drift, noise: the first inputs after the map."""
    rng = np.random.default_rng(seed)
    truth = np.linspace(start, end, steps)
    initial = rng.multivariate_normal([0, 0], P0, runs)
    drift = rng.multivariate_normal([0, 0], Q, (runs, steps))
    return truth, initial, drift, np.sqrt(R) * rng.standard_normal((runs, steps))


def packed(matrices):
    return np.stack([matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 1, 1]], axis=-1)


def unpacked(P):
    return P[..., [0, 1, 1, 2]].reshape(*P.shape[:-1], 2, 2)


def riccati(slopes, R):
    """Return the covariances in information form for slopes (steps, 2), slope 0 unused."""
    P = [P0]
    for H in slopes[1:]:
        P.append(np.linalg.inv(np.linalg.inv(P[-1] + Q) + np.outer(H, H) / R))
    return np.array(P)


def block_by_slices(grid, i, j, size):
    rows, columns = slice(i - size, i + size + 1), slice(j - size, j + size + 1)
    scale = size * (size + 1) * (2 * size + 1) * SPACING
    right, left = grid[rows, j + 1 : j + size + 1], grid[rows, j - size : j]
    above, below = grid[i + 1 : i + size + 1, columns], grid[i - size : i, columns]
    return np.array([right.sum() - left.sum(), above.sum() - below.sum()]) / scale
