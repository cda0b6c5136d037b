"""The generator as a list of terms: the paper's Eq. (19) is an instance, and matrices follow from the terms."""

from dataclasses import replace

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, PlaneSystem, Problem, VibroImpactOscillator, make_mesh
from fpsolve.arrays import identity
from fpsolve.exponent import spectrum
from fpsolve.fem import Generator
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space
from fpsolve.fem.terms import OfMoment
from fpsolve.model import CoefficientMatrix, MarkovChain
from tests.conftest import FIG1, UNIT_NOISE, sampled
from tests.oracles.paper_generator import PaperGenerator

WEAK = VibroImpactOscillator(omega=1.2, restitution=0.7, c1=-0.3, epsilon=0.4)
STRONG = VibroImpactOscillator(omega=1.0, restitution=0.9, c1=0.2, epsilon=1.5, impact="restitution")
PHASE = PhaseAxis(np.array([np.pi / 2, 2.2, 3.5, 3 * np.pi / 2]), np.array([4, 7, 5]))
BOUNDED = NonGaussianNoise(D0=0.8, tau0=0.7, r0=0.4)
PROBLEMS = {
    "weak": (WEAK, UNIT_NOISE, make_mesh(phi_degree=6, xi_degree=6)),
    "exact noise": (WEAK, BOUNDED, make_mesh(phi_degree=6, xi_degree=6)),
    "the phase turns back": (STRONG, UNIT_NOISE, make_mesh(phi_cells=4, phi_degree=6, xi_degree=6, xi_min=-6.0)),
    "full circle": (STRONG, UNIT_NOISE, make_mesh(phi_cells=4, phi_degree=6, xi_degree=6, full_circle=True)),
    "polynomials": (STRONG, UNIT_NOISE, Space((PHASE, PolynomialAxis(UNIT_NOISE, 8)))),
    "tilted": (STRONG, UNIT_NOISE, Space((PHASE, PolynomialAxis(UNIT_NOISE, 8, 0.9)))),
    "bounded and tilted": (WEAK, BOUNDED, Space((PHASE, PolynomialAxis(BOUNDED, 9, 0.4)))),
}
KEEP_THEIR_DIRECTION = ("weak", "exact noise", "polynomials", "tilted", "bounded and tilted")


@pytest.fixture(params=PROBLEMS)
def both(request):
    """A generator, and for a p the paper's equation on the same space."""
    oscillator, noise, chosen = PROBLEMS[request.param]
    generator = Generator(Problem(oscillator, noise), chosen)
    generator.name = request.param
    return generator, lambda p: PaperGenerator(oscillator, noise, generator.space(p))


def assert_same(matrix, expected):
    assert np.max(np.abs(matrix.toarray() - expected)) <= 1e-14 * max(np.max(np.abs(expected)), 1e-3)


@pytest.mark.parametrize("p", sampled(1.7, -2.0))
def test_the_terms_are_the_papers_equation(both, p):
    (generator, on), scale = both, both[0].problem.system.epsilon
    paper = on(p)
    assert_same(generator.matrix(p), paper.matrix(p))
    assert_same(generator.matrix(p).shifted(0.3), paper.matrix(p) - 0.3 * generator.space(p).mass.toarray())
    if generator.name not in KEEP_THEIR_DIRECTION:  # elsewhere the upwind loads of all orders are one
        return
    assert_same(generator.matrix(p, orders=slice(0, 1)), paper.L0())
    assert_same(generator.matrix(p, orders=slice(1, 2)), scale * paper.L1(p))
    assert_same(generator.matrix(p, orders=slice(2, None)), scale**2 * paper.L2(p) + paper.impact(p))
    assert_same(generator.matrix(p, orders=slice(1, None)), paper.matrix(p) - paper.L0())


def test_derivatives_in_p(both):
    (generator, on), p = both, 1.3
    scale, log_factor = generator.problem.system.epsilon, generator.problem.system.log_impact_factor
    paper = on(p)
    load = paper.impact(1.0) / np.expm1(log_factor)
    slope = scale * (paper.L1(1.0) - paper.L1(0.0)) + scale**2 * (paper.L2(1.0) - paper.L2(0.0))
    jump = np.exp(p * log_factor) * load
    assert_same(generator.matrix(p, derivative=1), slope + log_factor * jump)
    assert_same(generator.matrix(p, derivative=2), log_factor**2 * jump)


def test_constants_are_in_the_kernel_of_the_backward_operator(both):
    generator, _ = both
    assert np.max(np.abs(generator.matrix(0.0) @ generator.space(0.0).constant)) < 1e-13


def test_printed_terms():
    text = str(Generator(Problem(FIG1, UNIT_NOISE), make_mesh()))
    for line in (
        "L_ξ, the generator of the noise",
        "1 ∂φ",
        "ε ξ (0.5 sin 2φ) ∂φ",
        "p ε ξ (0.5 − 0.5 cos 2φ)",
        "ε² (0.05 sin 2φ) ∂φ",
        "p ε² (0.05 − 0.05 cos 2φ)",
        "(R^p − 1) |dφ/dt| δ(φ − 1.5708 mod π), R = 0.998002",
    ):
        assert line in text, text


def cube(xi):
    return xi**3


def test_noise_may_enter_by_any_function():
    chain = MarkovChain((-1.0, 0.5), ((0, 1), (1, 0)))
    matrix = ((0.1, 0.2), (0.3, -0.4))
    rotation = CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.0)))
    mesh = make_mesh(phi_cells=3)
    mesh = replace(mesh, z_lines=[])
    cubed = Generator(Problem(PlaneSystem([rotation, CoefficientMatrix(1, matrix, cube)]), chain), mesh)
    direct = MarkovChain((-1.0, 0.125), chain.rates)
    plain = Generator(Problem(PlaneSystem([rotation, CoefficientMatrix(1, matrix, identity)]), direct), mesh)
    assert_same(cubed.matrix(1.5), plain.matrix(1.5).toarray())
    assert "cube(ξ)" in str(cubed)


POWERS = [OfMoment(n) for n in range(4)]
JUMPS = [OfMoment(0, -0.2, is_change=True), OfMoment(0, 0.0, is_change=True), OfMoment(1, -0.2)]


@pytest.mark.parametrize("coefficient", POWERS + JUMPS)
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_coefficients_and_their_derivatives(coefficient, derivative):
    p, h = 1.3, 1e-4
    slope = (coefficient(p + h, derivative) - coefficient(p - h, derivative)) / (2 * h)
    assert coefficient(p, derivative + 1) == pytest.approx(slope, abs=1e-7)
    assert coefficient.of_orders(0.0, 0, False, True) == (1 if coefficient == OfMoment(0) else 0)
    assert coefficient.of_orders(p, 0, True, True) == coefficient(p)


@pytest.mark.parametrize("p", sampled(0.5, -3.0, 4.0))
def test_the_numerical_abscissa_lies_right_of_the_spectrum(both, p):
    generator, _ = both
    if generator.size < 1500:
        assert generator.at(p).numerical_abscissa >= spectrum(generator, p, 1)[0].real
