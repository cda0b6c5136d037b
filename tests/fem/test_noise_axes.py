"""Functions of the noise: orthogonal polynomials with and without a tilt, cells, and what they share."""

import math

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.arrays import one
from fpsolve.fem.line import LineSpace
from fpsolve.fem.noise_axes import CellAxis, PolynomialAxis
from fpsolve.model import Noise
from fpsolve.model.noise import NoiseDerivative
from fpsolve.polynomials import gegenbauer, hermite, stieltjes

OU = OrnsteinUhlenbeck(alpha=1.3, sigma=0.8)
BOUNDED = [NonGaussianNoise(D0=0.8, tau0=0.7, r0=r0) for r0 in (-3.0, 0.0, 0.7, 0.99)]
TILTS = [0.0, 0.4, -1.7]


def identity(xi):
    return xi


def spread(matrix):
    rows, columns = np.nonzero(np.abs(matrix) > 1e-12 * np.abs(matrix).max())
    return int(np.max(np.abs(rows - columns)))


@pytest.mark.parametrize("polynomials", [hermite(12), gegenbauer(12, -0.6), gegenbauer(12, 0.0), gegenbauer(12, 30.0)])
def test_rules_are_exact_and_polynomials_orthonormal(polynomials):
    x, weights = polynomials.rule()
    values, slopes = polynomials.at(x)
    np.testing.assert_allclose((values * weights[:, None]).T @ values, np.eye(12), atol=1e-12)
    h = 1e-6
    np.testing.assert_allclose(
        slopes, (polynomials.at(x + h)[0] - polynomials.at(x - h)[0]) / (2 * h), rtol=1e-6, atol=1e-7
    )


def test_moments_of_known_weights():
    x, weights = hermite(20).rule()
    np.testing.assert_allclose([weights @ x**k for k in (0, 2, 4, 6)], [1, 1, 3, 15], rtol=1e-13)
    for exponent in (-0.5, 0.0, 2.5):
        x, weights = gegenbauer(20, exponent).rule()
        np.testing.assert_allclose(weights @ x**2, 1 / (2 * exponent + 3), rtol=1e-13)


def test_stieltjes_finds_the_hermite_polynomials_of_a_moved_gaussian():
    x, weights = hermite(80).rule()
    moved = stieltjes(x, weights * np.exp(1.2 * x), 15)
    np.testing.assert_allclose(moved.a, 1.2, atol=1e-11)
    np.testing.assert_allclose(moved.b, np.sqrt(np.arange(1, 16)), rtol=1e-11)


@pytest.mark.parametrize("tilt", TILTS)
def test_ornstein_uhlenbeck_matrices_in_closed_form(tilt):
    """exp(−sz) L_ξ exp(sz) is −α(N + sY + s²) in the Hermite polynomials about 2s, ξ = std (Y + 2s)."""
    space, n = PolynomialAxis(OU, 9, tilt), np.arange(9.0)
    y = np.diag(np.sqrt(n[1:]), 1) + np.diag(np.sqrt(n[1:]), -1)
    np.testing.assert_allclose(space.mass(), np.eye(9), atol=1e-13)
    np.testing.assert_allclose(space.mass(identity), OU.standard_deviation * (y + 2 * tilt * np.eye(9)), atol=1e-12)
    expected = -OU.alpha * (np.diag(n) + tilt * y + tilt**2 * np.eye(9))
    np.testing.assert_allclose(space.generator(), expected, atol=1e-12)


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("noise", BOUNDED, ids=lambda noise: f"r0={noise.r0}")
def test_bounded_noise_has_banded_matrices_and_the_right_weight(noise, tilt):
    space = PolynomialAxis(noise, 14, tilt)
    assert spread(space.mass()) <= 2
    assert spread(space.mass(identity)) <= 3
    assert spread(space.generator()) <= 2
    z = np.linspace(-1, 1, 200_001)[1:-1] * noise.half_width / noise.standard_deviation
    weight = space.weight(z)
    if noise.end_exponent > 0.5:
        assert np.trapezoid(weight, z) == pytest.approx(1, abs=1e-4)
        assert np.trapezoid(weight * z, z) == pytest.approx(space.center, abs=1e-4)
    near = space.weight(np.array([0.3, 0.0]))
    density = noise.density(noise.standard_deviation * np.array([0.3, 0.0]))
    assert near[0] / near[1] == pytest.approx(density[0] / density[1] * math.exp(0.6 * tilt), rel=1e-12)


@pytest.mark.parametrize("noise", [OU, *BOUNDED])
def test_the_generator_is_minus_the_energy_of_smooth_functions(noise):
    """⟨v, L_ξ u⟩ for u = exp(a z), v = exp(b z), the factor of the space among them."""
    space, a = PolynomialAxis(noise, 30, 0.5), 0.3
    u = np.linalg.solve(space.mass(), space.values.T @ (space.measure * np.exp(a * space.points)))
    energy = (a + 0.5) ** 2 * (space.measure * space.rate(space.points) @ np.exp(2 * a * space.points))
    assert u @ space.generator() @ u == pytest.approx(-energy, rel=1e-9)
    assert space.generator_of_one() @ u == pytest.approx(space.generator()[0] @ u, rel=1e-12)


@pytest.mark.parametrize("noise", [OU, *BOUNDED])
def test_functions_are_carried_between_tilts_sizes_and_cells(noise):
    rough, fine = PolynomialAxis(noise, 6, 0.2), PolynomialAxis(noise, 40, -0.3)
    u = np.array([1.0, 0.3, -0.2, 0.1, 0.0, 0.05])
    np.testing.assert_allclose(rough.projection(fine) @ (fine.projection(rough) @ u), u, atol=1e-8)
    end = min(6.0, noise.half_width / noise.standard_deviation)
    cells = CellAxis(noise, np.linspace(-end, end, 7), np.full(6, 9))
    z = np.linspace(-2, 2, 9) if end > 2 else np.linspace(-0.9, 0.9, 9) * end
    on_cells, first = cells.at(z), rough.at(z)
    carried = on_cells.values @ (cells.projection(rough) @ u)
    np.testing.assert_allclose(carried, first.factor * (first.values @ u), rtol=1e-6, atol=1e-7)


def test_samples_integrate_densities():
    at = PolynomialAxis(OU, 8, 0.7).samples()
    assert at.measure @ at.weight == pytest.approx(1, rel=1e-12)
    shares = at.weight / at.factor**2 / OU.density(at.xi)  # the weight is P_s times the square of the factor
    np.testing.assert_allclose(shares, shares[0], rtol=1e-10)


def test_nested_modes_of_cells_are_those_of_lower_degrees():
    """A function of degree 4 on cells of degree 7 has no nested modes above 4."""

    def weight(z):
        return np.exp(-(z**2) / 2)

    line = LineSpace(np.array([-6.0, -2.0, 1.0, 7.0]), 7, weight)
    values = np.where(line.points < 1, line.points**4, 1 + 2 * (line.points - 1) ** 3)
    coefficients = np.linalg.lstsq(
        line.values.toarray() * np.sqrt(line.measure)[:, None], np.sqrt(line.measure) * values, rcond=None
    )[0]
    nested = line.nested @ coefficients
    assert np.max(np.abs(nested[line.modes > 4])) < 1e-9 * np.max(np.abs(nested))
    assert np.max(np.abs(coefficients[line.modes > 4])) > 1e-6


def test_cells_of_several_degrees():
    """The functions are all continuous polynomials of these degrees: as many, and each is reproduced."""
    lines, degrees = np.array([-2.0, -0.5, 1.0, 4.0]), np.array([1, 6, 4])
    line = LineSpace(lines, degrees, lambda x: np.exp(-(x**2)))
    assert line.size == line.modes.size == degrees.sum() + 1
    values, mass = line.values.toarray(), line.mass().toarray()
    for j, degree in enumerate(degrees):
        x = np.clip((line.points - lines[j]) / np.diff(lines)[j], 0, 1)
        for wanted in (x, *(x**k * (1 - x) for k in range(1, degree))):
            coefficients = np.linalg.solve(mass, values.T @ (line.measure * wanted))
            np.testing.assert_allclose(values @ coefficients, wanted, atol=1e-11)
    np.testing.assert_allclose(line.at(line.points).toarray(), values, atol=1e-12)
    np.testing.assert_allclose(values @ line.constant(), 1, atol=1e-12)


def test_flat_vertex_functions_span_the_same():
    """They have no slope at the next vertices, 1 is among them, and all polynomials of the degree are, as before."""
    line = LineSpace(np.array([0.0, 0.4, 1.0, 1.5]), 6, np.sin, end_exponents=(1.0, 0.0), is_flat=True)
    np.testing.assert_allclose(line.values @ line.constant(), 1, atol=1e-12)
    jumps, (low, high) = line.jumps_of_slope().toarray(), line.ends
    for row in jumps:
        at, *others = sorted(np.flatnonzero(line.modes == 1), key=lambda k: -abs(row[k]))
        assert abs(row[at]) > 1
        np.testing.assert_allclose(row[others], 0, atol=1e-11)
    root = np.sqrt(line.measure)[:, None]
    values = np.stack([line.points, (line.points - 0.7) ** 6], axis=1)
    fitted = np.linalg.lstsq(line.values.toarray() * root, root * values, rcond=None)[0]
    np.testing.assert_allclose(line.at(np.array([0.1, 0.9, 1.4])) @ fitted[:, 0], [0.1, 0.9, 1.4], atol=1e-11)
    np.testing.assert_allclose(line.values @ fitted, values, atol=1e-10)
    np.testing.assert_allclose(jumps @ fitted, 0, atol=1e-8)
    assert np.max(np.abs((line.nested @ fitted[:, 0])[line.modes > 1])) < 1e-10
    assert [np.flatnonzero(row).tolist() for row in line.at(np.array([0.0, 1.5])).toarray().round(12)] == [
        [low],
        [high],
    ]


class Arcsine(Noise):
    """ξ = A sin θ, dθ = σ dW: P_s = 1/(π√(A² − ξ²)) and σ²(ξ) = σ²(A² − ξ²)."""

    half_width, end_exponent, standard_deviation, correlation_time = 0.8, -0.5, 0.8 / math.sqrt(2), 2 / 1.3**2

    def spectral_density(self, omega):
        raise NotImplementedError

    def squared_diffusion(self, xi):
        return 1.3**2 * (self.half_width**2 - np.asarray(xi) ** 2)

    def log_density(self, xi):
        return -0.5 * np.log(self.half_width**2 - np.asarray(xi) ** 2) - math.log(math.pi)


def test_noise_whose_diffusion_vanishes_at_its_ends_has_chebyshev_polynomials():
    """L_ξ T_k = −½σ²k² T_k, and ξ couples neighbours: by A/√2 the first two, by A/2 all others."""
    noise, n = Arcsine(), np.arange(9.0)
    axis = PolynomialAxis(noise, 9)
    np.testing.assert_allclose(axis.mass(), np.eye(9), atol=1e-13)
    np.testing.assert_allclose(axis.generator(), -0.5 * 1.3**2 * np.diag(n**2), atol=1e-12)
    couplings = noise.half_width * np.append(1 / math.sqrt(2), np.full(7, 0.5))
    np.testing.assert_allclose(axis.mass(identity), np.diag(couplings, 1) + np.diag(couplings, -1), atol=1e-13)
    np.testing.assert_allclose(axis.samples().weight, np.exp(noise.log_density(axis.samples().xi)), rtol=1e-11)


def test_a_length_that_changes_holds_what_is_measured_by_it():
    """∂/∂ ln A of ∫P_s ξ³ u v at fixed ξ/A is three times it, and L_ξ does not change: σ ~ A."""
    axis = PolynomialAxis(Arcsine(), 9)
    by_size = NoiseDerivative(log_diffusion=1.0, log_scale=1.0)

    def cubed(xi):
        return xi**3

    np.testing.assert_allclose(axis.changed(by_size, cubed), 3 * axis.mass(cubed), atol=1e-9)
    np.testing.assert_allclose(axis.changed(by_size, None), np.zeros((9, 9)), atol=1e-12)
    np.testing.assert_allclose(axis.changed(by_size, one), np.zeros((9, 9)), atol=1e-12)
