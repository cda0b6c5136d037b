"""Noise with algebraic tails, r₀ > 1: λ and N, and what is refused.

The references are finite differences on another grid (asinh_grid), a simulation, and the Gaussian limit r₀ → 1.
"""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from fpsolve import (
    ExponentSolver,
    MomentLyapunovFunction,
    NonGaussianNoise,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    moment_lyapunov,
    simulate,
    stability_index,
)
from fpsolve.analysis import excursion
from fpsolve.errors import NoSuchExponent
from fpsolve.exponent import impact_rate
from fpsolve.fem import make_mesh
from tests.oracles import asinh_grid

REASON = "for r0 > 1 the noise has algebraic tails, so that Λ\\(p\\) is infinite for p > 0 and p < -1, and between"


def problem(D0, tau0, r0, epsilon, omega=1.0, restitution=1.0, c1=0.0):
    oscillator = VibroImpactOscillator(omega=omega, restitution=restitution, c1=c1, epsilon=epsilon)
    return Problem(oscillator, NonGaussianNoise(D0=D0, tau0=tau0, r0=r0))


HEAVY = problem(0.5, 1.0, 1.1, 0.5)
FALLING = problem(0.5, 1.0, 1.1, 0.2, c1=-0.5)
"""With λ < 0."""


def by_differences(case, phases=96, steps=400):
    """λ and N on the other grid, extrapolated, and three times of what that changes in them."""
    ends = 200 * case.noise.standard_deviation
    coarse, fine, around = (
        np.array(asinh_grid.exponents(case.system, case.noise, phases=m, steps=n, lower=-ends, upper=ends))
        for m, n in ((phases, steps), (phases, 2 * steps), (2 * phases, steps))
    )
    changes = (fine - coarse) / 3, (around - coarse) / 7
    return fine + sum(changes), 3 * np.sum(np.abs(changes), axis=0)


def both(case, rtol=1e-8):
    """λ and N."""
    solver = ExponentSolver(case, rtol=rtol)
    return solver.lyapunov_exponent(), impact_rate(solver)


def check(case, rtol):
    known, doubt = by_differences(case)
    for estimate, other, open_ in zip(both(case, rtol), known, doubt, strict=True):
        assert abs(estimate.value - other) <= estimate.error_estimate + open_
        assert open_ < 1e-3 * max(abs(other), estimate.scale)


@pytest.mark.slow
def test_what_lies_beyond_an_interval_is_in_the_error():
    """Far out noise is slow beside the motion, and ‖x‖ grows at the largest rate of each ξ, to 2 %."""
    noise = NonGaussianNoise(D0=0.5, tau0=0.4, r0=1.35)
    given = Problem(PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.1*v - 0.6*xi*v")), noise)
    mesh = make_mesh(phi_cells=6, phi_degree=9, xi_cells=12, xi_degree=9, xi_min=-40, xi_max=40, grading=3.0)
    inside = lyapunov_exponent(given, mesh=mesh)

    def excess(xi):
        rate = np.linalg.eigvals([[0, 1], [-1, -0.1 - 0.6 * xi]]).real.max()
        return (rate - inside.value) * math.exp(noise.log_density(xi))

    end = 40 * noise.standard_deviation
    beyond = sum(quad(excess, *ends, epsrel=1e-9, epsabs=0)[0] for ends in ((-math.inf, -end), (end, math.inf)))
    assert beyond <= inside.error_estimate < 2 * beyond
    for rtol in 1e-2, 1e-4, 1e-6:
        solved = lyapunov_exponent(given, rtol=rtol)
        assert abs(solved.value - inside.value - beyond) <= solved.error_estimate + 0.02 * beyond


@pytest.mark.slow
def test_an_interval_is_wide_enough_for_any_tolerance():
    """Finite volumes between sinh-spaced points give 0.13917269 ± 9e-7."""
    given = problem(1.0, 0.5, 1.3, 0.7, restitution=0.8, c1=0.1)
    for rtol in 1e-2, 1e-4, 1e-6:
        solved = lyapunov_exponent(given, rtol=rtol)
        assert abs(solved.value - 0.13917269) <= solved.error_estimate + 9e-7


@pytest.mark.slow
def test_by_finite_differences():
    check(HEAVY, 1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0])
def test_random_sets(seed):
    rng = np.random.default_rng(1000 + seed)
    case = problem(
        *np.exp(rng.uniform(np.log([0.2, 0.3]), np.log([2.0, 3.0]))),
        1 + np.exp(rng.uniform(np.log(0.02), np.log(0.3))),
        np.exp(rng.uniform(np.log(0.05), np.log(0.5))),
        restitution=rng.uniform(0.6, 1.0),
        c1=rng.uniform(-0.3, 0.3),
    )
    check(case, 1e-5)


@pytest.mark.parametrize("departure", [1e-12, 1e-7, 1e-4])
def test_next_to_gaussian_noise(departure):
    """λ tends to that for r₀ = 1, linearly; no warning, as pytest makes errors of them."""
    exponents = [lyapunov_exponent(problem(0.5, 1.0, r0, 0.1, restitution=0.8)).value for r0 in (1.0, 1 + departure)]
    assert exponents[1] == pytest.approx(exponents[0], abs=4e-3 * departure + 1e-13)


def test_the_exponent_is_that_of_almost_every_path():
    assert "almost every path" in lyapunov_exponent(FALLING).meaning
    result = moment_lyapunov(FALLING, [0.0])
    assert (result.value[0], np.isnan(result.derivative[0])) == (0.0, True)


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        (r"Λ\(2\)", lambda: moment_lyapunov(FALLING, 2.0)),
        (r"Λ\(-0.5\)", lambda: moment_lyapunov(FALLING, [0.0, -0.5])),
        (r"Λ\(-1.5\)", lambda: ExponentSolver(FALLING).pair(-1.5)),
        (r"Λ\(-0.9\)", lambda: MomentLyapunovFunction(FALLING, (-0.9, -0.1))),
        (r"Λ\(-0.4\)", lambda: simulate(FALLING, [-0.4])),
        ("Λ″\\(0\\)", lambda: ExponentSolver(FALLING).variance_rate()),
        ("P\\(sup ‖x‖ ≥ A\\)", lambda: excursion(FALLING)),
    ],
)
def test_what_depends_on_other_moments_is_refused(name, refused):
    with pytest.raises(NoSuchExponent, match=f"^{name} is not computed: {REASON}.*; take λ, or choose r0 <= 1, or"):
        refused()


def test_there_is_no_stability_index():
    found = stability_index(FALLING)
    assert not found
    assert str(found.reason).startswith("δ_p is not computed: for r0 > 1 the noise has algebraic tails")


@pytest.mark.slow
def test_excursions_of_growing_paths_are_certain():
    assert excursion(HEAVY).is_certain
