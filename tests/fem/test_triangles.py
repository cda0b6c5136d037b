"""The tensor-product operator against a general assembly on unstructured triangles."""

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, Problem, VibroImpactOscillator, make_mesh
from fpsolve.exponent import principal_pair
from fpsolve.fem import Generator
from tests.conftest import oracle_arguments
from tests.oracles import triangles

OSCILLATOR = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.5)
NOISE = OrnsteinUhlenbeck(alpha=1.3, sigma=1.0)
GRID = {"cells_phi": 8, "cells_z": 10, "degree": 4, "half_width": 6.0}
MESH = make_mesh(phi_cells=3, phi_degree=10, xi_cells=4, xi_degree=12, xi_min=-6.0, xi_max=6.0)
"""The same truncation, so that both solve one problem."""


@pytest.mark.parametrize("p", [-2.0, 1.0, 3.0])
def test_principal_eigenvalue(p):
    other = triangles.moment_lyapunov(**oracle_arguments(OSCILLATOR, NOISE), p=p, **GRID)
    value = principal_pair(Generator(Problem(OSCILLATOR, NOISE), MESH), p).value
    assert value == pytest.approx(other, rel=1e-5)


def test_triangles_converge_to_the_tensor_value():
    value = principal_pair(Generator(Problem(OSCILLATOR, NOISE), MESH), 2.0).value
    errors = [
        abs(
            triangles.moment_lyapunov(
                **oracle_arguments(OSCILLATOR, NOISE), p=2.0, cells_phi=n, cells_z=2 * n, degree=3
            )
            - value
        )
        for n in (4, 8)
    ]
    assert errors[1] < 1e-5 * abs(value)
    assert errors[1] < errors[0] / 8


def test_bilinear_forms_of_smooth_functions():
    """w·L(p)T of one pair of smooth functions, T with the impact's jump, in both discrete spaces."""
    p = 1.5
    jump = p * OSCILLATOR.log_impact_factor / np.pi

    def trial(phi, z):
        return np.exp(jump * (phi - np.pi / 2)) * (1 + 0.3 * np.cos(2 * phi) * z + 0.1 * np.sin(2 * phi))

    def test(phi, z):
        return 1 + 0.2 * np.sin(2 * phi) + 0.4 * z * np.cos(2 * phi) + 0.1 * z**2

    A, _, basis = triangles.matrices(**oracle_arguments(OSCILLATOR, NOISE), p=p, **GRID)
    other = test(*basis.doflocs) @ (A @ trial(*basis.doflocs))

    generator = Generator(Problem(OSCILLATOR, NOISE), MESH)
    w, t = (interpolate(generator, f) for f in (test, trial))
    assert w @ (generator.matrix(p) @ t) == pytest.approx(other, rel=1e-6)


def interpolate(generator, f):
    """Coefficients of f, by least squares at many points of each direction."""
    space = generator.space(0.0)
    values = f(space.phi.points[:, None], space.xi.points[None])
    in_phi = np.linalg.lstsq(space.phi.values, values, rcond=None)[0]
    return np.linalg.lstsq(space.xi.values.toarray(), in_phi.T, rcond=None)[0].T.ravel()
