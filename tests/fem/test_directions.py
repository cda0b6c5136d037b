"""Values of the functions on the sphere of directions at any points, and the measure that they are integrated by."""

import math

import numpy as np
import pytest

from fpsolve.fem.harmonics import HarmonicCells
from fpsolve.fem.sphere import SphereCells


def axis_of(kind, n):
    unit = tuple(map(tuple, np.eye(n).tolist()))
    if kind == "harmonics":
        return HarmonicCells(unit, 6).axis()
    return SphereCells(unit, np.array([0.0, 0.3, 0.9, math.pi / 2]), 7, 6).axis()


def rule(n):
    """Directions and weights of dσ, which integrate polynomials up to the degree 20."""
    x, w = np.polynomial.legendre.leggauss(20)
    turns = 2 * math.pi * np.arange(24) / 24
    if n == 3:
        z, phi = (each.ravel() for each in np.meshgrid(x, turns, indexing="ij"))
        flat = np.sqrt(1 - z**2)
        return np.stack([flat * np.cos(phi), flat * np.sin(phi), z]), np.repeat(w, 24) * 2 * math.pi / 24
    share, one, two = (each.ravel() for each in np.meshgrid(0.5 * (1 + x), turns, turns, indexing="ij"))
    c, s = np.sqrt(1 - share), np.sqrt(share)  # cs dη = ½ d(s²)
    points = np.stack([c * np.cos(one), c * np.sin(one), s * np.cos(two), s * np.sin(two)])
    return points, np.repeat(0.25 * w, 24**2) * (2 * math.pi / 24) ** 2


@pytest.mark.parametrize("n", [3, 4])
def test_harmonics_are_orthonormal_and_polynomials(n):
    """In the mean over the sphere; and x₁² is a sum of them."""
    axis = axis_of("harmonics", n)
    points, weights = rule(n)
    values = axis.at(points)
    mean = values.T @ (weights[:, None] * values) / axis.area
    np.testing.assert_allclose(mean, axis.identity, atol=1e-12)
    assert weights.sum() == pytest.approx(axis.area, rel=1e-12)
    square = points[0] ** 2
    np.testing.assert_allclose(values @ (values.T @ (weights * square)) / axis.area, square, atol=1e-12)


@pytest.mark.parametrize("n", [3, 4])
@pytest.mark.parametrize("kind", ["elements", "harmonics"])
def test_products_with_growth(kind, n):
    """∫ v q u of a diagonal matrix, whose q is Σ a_i y_i², by points and by the matrices of the generator."""
    axis, (points, weights) = axis_of(kind, n), rule(n)
    sizes = np.arange(1.0, n + 1)
    own = np.random.default_rng(3).standard_normal(axis.size) * (axis.degrees <= 2)
    values = np.asarray(axis.at(points) @ own)
    _, growth = axis.driven(np.diag(sizes))
    by_points = weights @ (sizes @ points**2 * values**2) / axis.area
    if kind == "harmonics":
        assert by_points == pytest.approx(own @ growth @ own, rel=1e-11)
    constant = np.asarray(axis.at(points) @ axis.constant)
    np.testing.assert_allclose(constant, 1.0, atol=1e-12)
    assert axis.constant @ growth @ axis.constant == pytest.approx(weights @ (sizes @ points**2) / axis.area, rel=1e-11)
    assert np.all(np.isfinite(values))


@pytest.mark.parametrize("n", [3, 4])
def test_elements_and_harmonics_are_the_same_functions(n):
    """A harmonic projected on elements has its values everywhere; the values of both are those of other routines."""
    elements, harmonics = axis_of("elements", n), axis_of("harmonics", n)
    rng = np.random.default_rng(5)
    points = rng.standard_normal((n, 200))
    points /= np.linalg.norm(points, axis=0)
    for axis in (elements, harmonics):
        np.testing.assert_allclose(axis.at(points) @ axis.constant, 1.0, atol=1e-12)
        np.testing.assert_allclose(
            (axis.at(points) @ np.eye(axis.size)), axis.at(-points) @ np.eye(axis.size), atol=1e-9
        )
    places, weights = rule(n)
    at_places = elements.at(places).toarray()
    mass = at_places.T @ (weights[:, None] * at_places) / elements.area
    np.testing.assert_allclose(mass[0, 0], elements.identity[0, 0], rtol=0.2)
