"""Noise with algebraic tails, r₀ > 1: the place far out that carries Λ(p) for −1 ≤ p < 0, and what the numbers mean.

The references are finite differences on another grid (asinh_grid), the hydrogen atom of `far_places` in closed form,
and a simulation of paths that are killed (killed_paths).
"""

import math

import numpy as np
import pytest

from fpsolve import (
    MomentLyapunovFunction,
    NonGaussianNoise,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    moment_lyapunov,
    stability_index,
)
from fpsolve.arrays import identity
from fpsolve.errors import MeshError, NoSuchExponent, NotConverged
from fpsolve.exponent.adapt import is_far_out
from fpsolve.exponent.fields import Nodes
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.discretisation import Discretisation, PhaseCells
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import make_mesh
from fpsolve.model import CoefficientMatrix
from fpsolve.theory import far_places, frozen_noise
from fpsolve.theory.far import grows_far_out, variance_tail
from tests import random_heavy_tails
from tests.conftest import sampled
from tests.oracles import asinh_grid, killed_paths

SETS = 1
"""Random sets; thirty of them take three minutes."""


def problem(D0, tau0, r0, epsilon, omega=1.0, restitution=1.0, c1=0.0):
    oscillator = VibroImpactOscillator(omega=omega, restitution=restitution, c1=c1, epsilon=epsilon)
    return Problem(oscillator, NonGaussianNoise(D0=D0, tau0=tau0, r0=r0))


def hydrogen(noise, epsilon, p, omega=1.0):
    """Λ and |ξ| of the held problem where the place lies well beyond 2ω/ε."""
    share = abs(p) * omega**2 * noise.tau0 * (noise.r0 - 1) / (2 * epsilon * noise.r0)
    return share**2 / noise.D0, noise.D0 * noise.r0 / (noise.tau0 * (noise.r0 - 1) * share)


def by_differences(case, p, value, phases=128):
    """Λ(p) on the other grid, extrapolated from two steps in ξ."""
    unit, places = case.noise.standard_deviation, far_places(case, p)
    lower = min([-30.0, *(3 * place.lower for place in places)]) * unit
    coarse, fine = (
        asinh_grid.moment_lyapunov(
            case.system, case.noise, p, phases=phases, steps=steps, lower=lower, upper=15 * unit, above=1.02 * value
        )
        for steps in (300, 600)
    )
    return (4 * fine - coarse) / 3


@pytest.mark.parametrize(
    ("case", "p", "known"),
    [
        *sampled(
            (problem(0.5, 1.0, 1.1, 0.1), -0.1, 0.004209),
            (problem(0.5, 1.0, 1.1, 0.2, restitution=0.8, c1=0.1), -0.5, None),
            keep=0,
        )
    ],
)
def test_the_far_place_counts(case, p, known):
    result = moment_lyapunov(case, p)
    value, error = result.value[0], result.error_estimate[0]
    assert error < 2e-8 * value
    assert value == pytest.approx(by_differences(case, p, value), rel=1e-3)
    if known:
        assert value == pytest.approx(known, rel=1e-2)
    assert "rare paths carry the moment" in result.notes[0]


@pytest.mark.parametrize("p", [*sampled(-0.9, -0.1)])
def test_where_the_phase_rests_an_arc_of_it_will_do(p):
    """By another code; at p = −0.9 T has peaks at other phases that no mesh resolves."""
    case = problem(1.0, 0.5, 1.05, 0.1, restitution=0.8, c1=0.1)
    solution = ExponentSolver(case).solution(p)
    known, doubt = random_heavy_tails.by_rest(case, p)
    assert solution.pair.generator.chosen.phase.is_arc
    assert solution.error < 2e-8 * known
    assert doubt < 1e-3 * known
    assert abs(solution.pair.value - known) < solution.error + doubt


def test_nothing_beyond_an_arc_counts():
    """The matrix of the half circle has that of the arc, and nothing beside it in its rows."""
    case, p = problem(1.0, 0.5, 1.05, 0.1, restitution=0.8, c1=0.1), -0.5
    pair = ExponentSolver(case).pair(p)
    arc, part = pair.generator.chosen.phase, pair.generator.chosen.noise
    inside = math.pi / 2 + np.mod(arc.lines - math.pi / 2, math.pi)
    lines = np.array([math.pi / 2, *inside, 3 * math.pi / 2])
    whole = Generator(case, Discretisation(PhaseCells(lines, np.array([5, *arc.degrees, 5])), (part,)))
    matrix, kept = whole.matrix(p), (whole.phi.cells > 0) & (whole.phi.cells < lines.size - 2)
    own = pair.generator.matrix(p).toarray()
    assert np.allclose(matrix.on(0, kept).toarray(), own, rtol=1e-12, atol=1e-12 * np.max(np.abs(own)))
    rng = np.random.default_rng(1)
    beside = np.where(np.repeat(kept, part.size), 0.0, rng.standard_normal(whole.size))
    assert np.max(np.abs((matrix @ beside)[np.repeat(kept, part.size)])) < 1e-14 * matrix.norm
    assert np.max(np.abs((matrix.T @ beside)[np.repeat(kept, part.size)])) > 1e-3
    for lines in (arc.lines + 0.3, arc.lines - 0.3):
        with pytest.raises(MeshError, match="paths leave the arc"):
            Generator(case, Discretisation(PhaseCells(lines, arc.degrees), (part,)))
    with pytest.raises(MeshError, match="the ray of a jump"):
        Generator(case, Discretisation(PhaseCells(np.array([1.5, 4.0]), arc.degrees), (part,)))
    nodes = Nodes.of(pair)
    found, phi = nodes.fields(pair), nodes.phi.mean(axis=1)
    is_inside = np.mod(phi - arc.lines[0], math.pi) < np.ptp(arc.lines)
    assert np.count_nonzero(is_inside) >= 2
    known = np.repeat(is_inside, nodes.phi.shape[1])
    assert np.array_equal(np.isnan(found.right).any(axis=1), ~known)
    assert np.all(found.adjoint[~known] == 0)


@pytest.mark.slow
def test_a_place_where_the_phase_begins_to_rest():
    """Nearly all of the way out the phase turns: the place is at −2ω/ε, 130 standard deviations."""
    case = problem(1.0, 0.5, 1.1, 0.01)
    value, unit = moment_lyapunov(case, -0.5).value[0], case.noise.standard_deviation
    differences = [
        asinh_grid.moment_lyapunov(
            case.system, case.noise, -0.5, phases=phases, steps=800, lower=-300 * unit, upper=-40 * unit, above=0.45
        )
        for phases in (96, 192)
    ]
    assert value == pytest.approx(0.4410, rel=1e-2)
    assert value == pytest.approx((8 * differences[1] - differences[0]) / 7, rel=1e-4)


def test_far_out_it_is_a_hydrogen_atom():
    """Beyond 2ω/ε by a factor x the closed form is right to ~1/x², down to where the phase layers are 1e-9 wide."""
    case = problem(0.5, 1.0, 1.1, 0.1)
    previous = math.inf
    for p in (-0.1, -0.01, -0.001, -3e-4):
        result = moment_lyapunov(case, p, rtol=1e-7)
        closed, place = hydrogen(case.noise, 0.1, p)
        departure = result.value[0] / closed - 1
        assert abs(departure) < 2 * (20 / place) ** 2 + result.error_estimate[0] / closed
        assert departure < previous / 50 or abs(departure) < 1e-6
        previous = departure


@pytest.mark.slow
def test_killed_paths_are_a_lower_bound():
    """Of paths that stay in a slab; the next eigenvalue is left behind after a few times 243."""
    case, p = problem(0.5, 1.0, 1.1, 0.2), -0.5
    unit, value = case.noise.standard_deviation, moment_lyapunov(case, p).value[0]
    slab = -200 * unit, -13.5 * unit
    rate, error = killed_paths.growth(case.system, case.noise, p, slab, paths=2048, time=400, transient=400)
    assert error < 0.01 * value
    assert 0.97 * value < rate < value


@pytest.mark.slow
def test_convex_and_continuous_over_the_change_of_place():
    """The place near 0, λp + ½Λ″p², carries large |p|, the one far out, Kp², the rest; λ > 0 is not the slope at 0."""
    case, p = problem(0.5, 1.0, 1.1, 0.5), np.linspace(-0.9, 0.0, 13)
    result = moment_lyapunov(case, p, rtol=1e-6)
    solver, value, error = result.solver, result.value, result.error_estimate
    far = np.array([is_far_out(solver.pair(each)) for each in p])
    exponent, variance = solver.lyapunov_exponent(), solver.variance_rate()
    closed, _ = hydrogen(case.noise, 0.5, 1.0)
    assert np.array_equal(far[:-1], p[:-1] > -exponent.value / (variance.value / 2 - closed))
    assert np.all(value[:-1] > 0)
    assert value[-1] == pytest.approx(0, abs=1e-14)
    second = value[2:] - 2 * value[1:-1] + value[:-2]
    assert np.all(second > -(error[2:] + 2 * error[1:-1] + error[:-2]))
    slack, steps = error[1:] + error[:-1], np.diff(p)
    assert np.all(
        value[1:] > value[:-1] + result.derivative[:-1] * steps - slack
    )  # above the tangents from both sides,
    assert np.all(value[:-1] > value[1:] - result.derivative[1:] * steps - slack)  # which leaves no room for a jump
    assert exponent.value > 0.007
    assert "almost every path" in exponent.meaning
    assert result.derivative[-1] == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(SETS))
def test_random_sets(seed):
    rng = np.random.default_rng(1000 + seed)
    case = problem(
        *np.exp(rng.uniform(np.log([0.2, 0.3]), np.log([2.0, 3.0]))),
        1 + np.exp(rng.uniform(np.log(0.05), np.log(0.4))),
        np.exp(rng.uniform(np.log(0.05), np.log(0.5))),
        restitution=rng.uniform(0.6, 1.0),
        c1=rng.uniform(-0.3, 0.3),
    )
    p = rng.uniform(-0.95, -0.05)
    value = moment_lyapunov(case, p, rtol=1e-6).value[0]
    assert value == pytest.approx(by_differences(case, p, value), rel=5e-3)


def test_negative_exponents_are_slopes():
    """c₁ < 0: λ < 0 is the slope of Λ at 0, and the near place carries small |p|."""
    case = problem(0.5, 1.0, 1.1, 0.2, c1=-0.5)
    result = moment_lyapunov(case, [-0.01, 0.0])
    exponent = lyapunov_exponent(case).value
    assert exponent < 0
    assert result.derivative[1] == pytest.approx(exponent)
    assert result.value[0] == pytest.approx(-0.01 * exponent, rel=0.02)


def test_there_is_no_stability_index():
    case = problem(0.5, 1.0, 1.1, 0.2)
    assert grows_far_out(case)
    assert "rare paths" in str(stability_index(case))


def test_no_smooth_function():
    with pytest.raises(NotConverged, match="not smooth in p: for some p the noise"):
        MomentLyapunovFunction(problem(0.5, 1.0, 1.1, 0.2), (-0.9, -0.1))


def test_a_given_mesh_is_warned_of():
    mesh = make_mesh(phi_cells=4, phi_degree=8, xi_cells=8, xi_degree=8, xi_min=-12, xi_max=12)
    result = moment_lyapunov(problem(0.5, 1.0, 1.1, 0.2), [-0.5], mesh=mesh)
    assert any(
        "may be larger: noise with heavy tails may carry the moment near -54" in text for text in result.warnings
    )


def test_what_cannot_be_reached_is_refused():
    """Noise in the stiffness, with damping: at ξ → ∞ ‖x‖ falls at the rate of the damping, however far out."""
    rotation, stiffness, damping = ((0.0, 1.0), (-1.0, 0.0)), ((0.0, 0.0), (-1.0, 0.0)), ((0.0, 0.0), (0.0, -0.4))
    system = PlaneSystem(
        [CoefficientMatrix(0, rotation), CoefficientMatrix(1, stiffness, identity), CoefficientMatrix(2, damping)],
        epsilon=0.8,
    )
    case = Problem(system, NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.1))
    assert grows_far_out(case)
    with pytest.raises(NotConverged, match=r"at least 0\.0128, the growth rate of paths whose noise stays beyond"):
        moment_lyapunov(case, -0.1)


@pytest.mark.parametrize("r0", [0.3, 0.7, 0.95, 1.0])
@pytest.mark.parametrize("p", [-8.0, -0.5, 3.0, 20.0])
def test_lighter_tails_have_no_place_far_out(r0, p):
    """For r₀ ≤ 1 noise that is held beyond all z looked at makes ‖x‖^p grow less than in the best place among them.

    The rate is computed anew: p times the larger real part of the eigenvalues, less (drift)²/(2σ²).
    """
    for tau0, epsilon in ((0.1, 0.2), (1.0, 1.0), (20.0, 0.3)):
        case = problem(0.5, tau0, r0, epsilon)
        assert far_places(case, p) == ()
        frozen, noise = frozen_noise(case), case.noise
        unit = noise.standard_deviation
        end = min(1e4 * frozen.z[-1] * unit, 0.999999999 * noise.half_width)
        for side in (-1.0, 1.0):
            for xi in side * np.geomspace(frozen.z[-1] * unit, end, 500):
                motion = [[0.0, 1.0], [-1.0, epsilon * xi]]
                slow, fast = np.sort(np.linalg.eigvals(motion).real)
                gain = max(p * fast, (p + 1) * slow - fast) if p < -1 else p * fast
                assert gain - 0.5 * (noise.drift(xi) / noise.diffusion) ** 2 < np.max(frozen.rate(p))


@pytest.mark.slow
def test_the_variance_of_the_growth_is_infinite_for_the_heaviest_tails():
    """From r₀ = 7/5 on; below, an interval four times as wide changes it within its error."""
    assert variance_tail(problem(0.5, 1.0, 1.4, 0.3)) == pytest.approx(0, abs=1e-6)
    with pytest.raises(NoSuchExponent, match="the variance of ln ‖x‖ grows faster than time"):
        ExponentSolver(problem(0.5, 1.0, 1.45, 0.3), rtol=1e-5).variance_rate()
    found = ExponentSolver(problem(0.5, 1.0, 1.3, 0.3), rtol=1e-6).variance_rate()
    wide = make_mesh(phi_cells=8, phi_degree=6, xi_cells=20, xi_degree=6, xi_min=-80, xi_max=80, grading=1.2)
    better = ExponentSolver(problem(0.5, 1.0, 1.3, 0.3), wide).variance_rate()
    assert abs(found.value - better.value) < found.error_estimate


@pytest.mark.slow
def test_rare_moments_are_told_whatever_else_is_asked():
    """At p = −0.9 the place nearest to ξ = 0 is that far out; the solve at −½ must not follow it there."""
    oscillator = VibroImpactOscillator(omega=2.0, restitution=0.7, c1=-0.05, epsilon=0.3)
    case = Problem(oscillator, NonGaussianNoise(D0=0.5, tau0=5.0, r0=1.1))
    alone, together = (moment_lyapunov(case, p, rtol=1e-5) for p in ([-0.5], [-0.9, -0.5]))
    assert alone.rare.tolist() == [-0.5]
    assert together.rare.tolist() == [-0.9, -0.5]
    rates = [result.notes[0].rpartition("grows at the rate ")[2] for result in (alone, together)]
    assert float(rates[0]) == pytest.approx(float(rates[1]), rel=1e-2)
    assert float(rates[0]) < 0.05 * alone.value[0]


@pytest.mark.parametrize("departure", [1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4])
def test_next_to_gaussian_noise(departure):
    """Λ(p) > 0 tends to that for r₀ = 1, linearly; no warning, as pytest makes errors of them."""
    limit, close = (moment_lyapunov(problem(0.5, 1.0, r0, 0.1, restitution=0.8), -0.5) for r0 in (1.0, 1 + departure))
    assert abs(close.value[0] - limit.value[0]) < 2e-3 * departure + 1e-13
    exponents = [lyapunov_exponent(problem(0.5, 1.0, r0, 0.1, restitution=0.8)).value for r0 in (1.0, 1 + departure)]
    assert exponents[1] == pytest.approx(exponents[0], abs=4e-3 * departure + 1e-13)


@pytest.mark.parametrize("departure", [1e-6, 1e-5, 1e-4, 1e-3])
def test_next_to_gaussian_noise_the_place_is_far_out_and_narrow(departure):
    case, p = problem(0.5, 1.0, 1 + departure, 0.1, restitution=0.8), -0.5
    place = min(far_places(case, p), key=lambda each: each.lower)
    closed, xi = hydrogen(case.noise, 0.1, p)
    assert place.rate == pytest.approx(closed, rel=1e-3)
    assert place.lower < -xi / case.noise.standard_deviation < place.upper < 0


@pytest.mark.parametrize("departure", [1e-12, 1e-6, 1e-4])
def test_what_is_not_positive_is_no_value_of_heavy_tails(departure):
    """With c₁ > 0 the place around 0 has Λ < 0; that far out is too narrow, or too far, for any mesh."""
    with pytest.raises(NotConverged):
        moment_lyapunov(problem(0.5, 1.0, 1 + departure, 0.1, restitution=0.8, c1=1.0), -0.5)


@pytest.mark.parametrize("seed", sampled(10, 8, 94, keep=0))
def test_random_sets_next_to_gaussian_noise(seed):
    """A hundred, up to r₀ = 1.6: `python -m tests.random_heavy_tails`."""
    found = random_heavy_tails.outcome(seed)
    assert not isinstance(found, str)
    assert found[1] < 1
