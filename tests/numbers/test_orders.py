"""The error falls exponentially with the degree, and at least as h^(2k) with the cells; that of Λ(p) on a mesh."""

from functools import cache

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator, make_mesh
from fpsolve.exponent import principal_pair
from fpsolve.fem import Generator
from tests.oracles.planar import series

OSCILLATOR = VibroImpactOscillator(omega=1.2, restitution=0.7, c1=0.1, epsilon=0.3)
GAUSS = OrnsteinUhlenbeck(alpha=1.1, sigma=1.0)
XI, PHI = {"xi_cells": 5, "xi_degree": 12}, {"phi_cells": 2, "phi_degree": 14}
"""Fine."""


def bounded(r0: float) -> NonGaussianNoise:
    return NonGaussianNoise(D0=0.6, tau0=0.9, r0=r0)


@cache
def exact(noise) -> float:
    return series(Problem(OSCILLATOR, noise), 2.0, 14)


def errors(meshes, noise=GAUSS):
    pairs = [principal_pair(Generator(Problem(OSCILLATOR, noise), make_mesh(**mesh)), 2.0) for mesh in meshes]
    return np.array([abs(pair.value - exact(noise)) for pair in pairs])


@pytest.mark.parametrize(
    ("meshes", "ratio", "least"),
    [
        ([{"phi_cells": 1, "phi_degree": k, **XI} for k in range(2, 15, 2)], 8, 1e-12),
        ([{"xi_cells": 3, "xi_degree": k, **PHI} for k in range(2, 7)], 8, 1e-12),
        pytest.param(
            [{"xi_cells": 5, "xi_degree": 14, "xi_min": -w, "xi_max": w, **PHI} for w in (4.0, 5.0, 6.0, 7.0)],
            *(10, 1e-8),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["degree in phase", "degree in noise", "width"],
)
def test_error_falls_exponentially(meshes, ratio, least):
    found = errors(meshes)
    assert found[-1] < least
    assert np.all(found[:-1] / found[1:] > ratio)


@pytest.mark.parametrize(
    ("degree", "meshes", "noise"),
    [
        *((k, [{"phi_cells": n, "phi_degree": k, **XI} for n in (8, 16)], GAUSS) for k in (1, 2, 3)),
        *(
            (k, [{"xi_cells": n, "xi_degree": k, **PHI} for n in cells], GAUSS)
            for k, cells in ((1, (32, 64)), (2, (24, 48)), (3, (16, 32)))
        ),
        *((2, [{"xi_cells": n, "xi_degree": 2, **PHI} for n in (32, 64)], bounded(r0)) for r0 in (0.7, 0.0, -1.0)),
    ],
)
def test_order_is_at_least_twice_the_degree(degree, meshes, noise):
    """Also where P_s ends as a power, by rules of Gauss and Jacobi: as a square root for r₀ = −1."""
    coarse, fine = errors(meshes, noise)
    assert np.log2(coarse / fine) > 2 * degree - 0.1
