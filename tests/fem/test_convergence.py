"""hp convergence: the error falls exponentially with the degree, and at least as h^(2k) with the cells."""

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator, make_mesh
from fpsolve.exponent import principal_pair
from fpsolve.fem import Generator
from tests.conftest import oracle_arguments
from tests.oracles import fourier_hermite

OSCILLATOR = VibroImpactOscillator(omega=1.2, restitution=0.7, c1=0.1, epsilon=0.3)
NOISE = OrnsteinUhlenbeck(alpha=1.1, sigma=1.0)
P = 2.0
EXACT = fourier_hermite.moment_lyapunov(**oracle_arguments(OSCILLATOR, NOISE), p=P, harmonics=14, hermite=40)


def error(**mesh):
    return abs(principal_pair(Generator(Problem(OSCILLATOR, NOISE), make_mesh(**mesh)), P).value - EXACT)


def orders(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


FINE_XI = {"xi_cells": 5, "xi_degree": 12}
FINE_PHI = {"phi_cells": 2, "phi_degree": 14}


def test_oracle_is_converged():
    finer = fourier_hermite.moment_lyapunov(**oracle_arguments(OSCILLATOR, NOISE), p=P, harmonics=20, hermite=60)
    assert pytest.approx(finer, rel=1e-12) == EXACT


def test_error_falls_exponentially_with_the_degree_in_phase():
    errors = [error(phi_cells=1, phi_degree=k, **FINE_XI) for k in range(2, 15, 2)]
    assert errors[-1] < 1e-12
    assert np.all(np.array(errors[:-1]) / errors[1:] > 8)


def test_error_falls_exponentially_with_the_degree_in_noise():
    errors = [error(**FINE_PHI, xi_cells=3, xi_degree=k) for k in range(2, 7)]
    assert errors[-1] < 1e-12
    assert np.all(np.array(errors[:-1]) / errors[1:] > 8)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_order_in_phase_is_at_least_twice_the_degree(degree):
    errors = [error(phi_cells=n, phi_degree=degree, **FINE_XI) for n in (4, 8, 16)]
    assert orders(errors)[-1] > 2 * degree - 0.1


@pytest.mark.parametrize(("degree", "cells"), [(1, (16, 32, 64)), (2, (12, 24, 48)), (3, (16, 32))])
def test_order_in_noise_is_at_least_twice_the_degree(degree, cells):
    errors = [error(**FINE_PHI, xi_cells=n, xi_degree=degree) for n in cells]
    assert orders(errors)[-1] > 2 * degree - 0.1


@pytest.mark.parametrize("r0", [0.7, 0.0, -1.0])
def test_order_with_the_end_point_power_of_a_bounded_noise(r0):
    """Gauss-Jacobi rules in the last cells keep the order 2k, also where P_s ends as a square root (r₀ = −1)."""
    noise = NonGaussianNoise(D0=0.6, tau0=0.9, r0=r0)
    exact = fourier_hermite.moment_lyapunov_bounded_noise(
        D0=0.6, tau0=0.9, r0=r0, omega=1.2, epsilon=0.3, c1=0.1,
        log_R=OSCILLATOR.log_impact_factor, p=P, harmonics=14, gegenbauer=40,
    )  # fmt: skip
    meshes = [make_mesh(**FINE_PHI, xi_cells=n, xi_degree=2) for n in (16, 32, 64)]
    errors = [abs(principal_pair(Generator(Problem(OSCILLATOR, noise), mesh), P).value - exact) for mesh in meshes]
    assert orders(errors)[-1] > 3.9


@pytest.mark.slow
def test_truncation_error_falls_with_the_tilted_density_at_the_ends():
    errors = [error(**FINE_PHI, xi_cells=5, xi_degree=14, xi_min=-w, xi_max=w) for w in (4.0, 5.0, 6.0, 7.0)]
    assert errors[-1] < 1e-8
    assert np.all(np.array(errors[:-1]) / errors[1:] > 10)
