"""Values of the functions on the sphere of directions at any points, and the measure that they are integrated by."""

import math
from itertools import pairwise

import numpy as np
import pytest

from fpsolve.arrays import dense
from fpsolve.fem.sphere import SphereAxis

LINES = np.array([0.0, 0.5, math.pi / 2])
TURNS = 2 * math.pi * np.arange(12) / 12


def axis_of(n):
    return SphereAxis(tuple(map(tuple, np.eye(n).tolist())), LINES, 4, 4)


def rule(n, lines=LINES):
    """Directions and weights of dσ in the angles of the axes, exact for products of waves, by Gauss in each element."""
    x, w = np.polynomial.legendre.leggauss(12)
    eta = np.concatenate([a + (b - a) * (1 + x) / 2 for a, b in pairwise(lines)])
    weights = np.concatenate([(b - a) / 2 * w for a, b in pairwise(lines)])
    firsts = np.array([[1.0, -1.0]]) if n == 3 else np.stack([np.cos(TURNS), np.sin(TURNS)])
    seconds = np.stack([np.cos(TURNS), np.sin(TURNS)])
    c, s = np.cos(eta)[:, None, None], np.sin(eta)[:, None, None]
    shape = eta.size, firsts.shape[1], TURNS.size
    rows = [c * each[None, :, None] for each in firsts] + [s * each[None, None] for each in seconds]
    points = np.stack([np.broadcast_to(row, shape).ravel() for row in rows])
    own = weights * np.cos(eta) ** (n - 3) * np.sin(eta) * 2 * math.pi / 12 * (1 if n == 3 else 2 * math.pi / 12)
    return points, np.repeat(own, shape[1] * shape[2])


@pytest.mark.parametrize("n", [3, 4])
def test_integrals_by_points_are_the_matrices(n):
    """∫ u v, and ∫ v q u of a matrix, whose q is eᵀXe: the first fixes the order of the functions, too."""
    axis, (points, weights) = axis_of(n), rule(n)
    values = axis.at(points).toarray()
    mass = values.T @ (weights[:, None] * values) / axis.area
    np.testing.assert_allclose(mass, dense(axis.identity), atol=1e-8)
    matrix = np.random.default_rng(1).standard_normal((n, n))
    _, growth = axis.driven(matrix)
    q = np.einsum("im,ij,jm->m", points, matrix, points)
    np.testing.assert_allclose(values.T @ ((weights * q)[:, None] * values) / axis.area, dense(growth), atol=1e-8)
    np.testing.assert_allclose(values @ axis.constant, 1.0, atol=1e-12)


@pytest.mark.parametrize("n", [3, 4])
def test_opposite_directions_are_one(n):
    axis = axis_of(n)
    points = np.random.default_rng(2).standard_normal((n, 50))
    points /= np.linalg.norm(points, axis=0)
    own = np.random.default_rng(3).standard_normal(axis.size)
    np.testing.assert_allclose(axis.at(points) @ own, axis.at(-points) @ own, atol=1e-9)
