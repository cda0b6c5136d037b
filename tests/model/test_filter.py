"""Filtered noise: law and step, Λ(p) against moments over Hermite polynomials, limits, derivatives, case files."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import HermiteE
from scipy.integrate import quad
from scipy.linalg import expm, solve_continuous_lyapunov

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, make_mesh, moment_lyapunov, sensitivities
from fpsolve.analysis.sensitivity import Changed
from fpsolve.arrays import identity
from fpsolve.errors import CaseError, MeshError, NotConverged
from fpsolve.exponent import Budget, principal_pair
from fpsolve.exponent.eigen import PairDerivatives
from fpsolve.fem.generator import Generator
from fpsolve.fem.pairs import PairAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space
from fpsolve.model import CoefficientMatrix, Filter, ParametricOscillator, White, noise_kind
from fpsolve.simulation.motions import draw
from tests import random_filters
from tests.conftest import sampled
from tests.kit import case_in
from tests.oracles import filtered

OUTPUTS = {"y": lambda z: (1.0, 0.0), "y'": lambda z: (0.0, 1.0), "Kanai-Tajimi": lambda z: (4.0, 4 * z)}
MATRICES = ((0.0, 1.0), (-1.0, -0.1)), ((0.0, 0.0), (-1.0, 0.0))
MIXED = Filter(omega=1.3, zeta=0.4, s=0.5, c0=0.7, c1=-0.8)


def oscillator(noise, damping=0.05):
    return Problem(ParametricOscillator(stiffness=1.0, damping=damping), noise)


def law_of(output, zeta, omega=2.0, deviation=0.3):
    c0, c1 = OUTPUTS[output](zeta)
    return omega, zeta, filtered.strength(omega, zeta, c0, c1, deviation), c0, c1


def solved(noise, p=2.0, **chosen):
    return ExponentSolver(oscillator(noise), **chosen).solution(p)


@pytest.mark.parametrize(
    ("output", "zeta", "expected"),
    [
        ("y", 0.1, 0.0649417356782),
        ("y", 0.3, -0.0280940333946),
        ("y'", 0.1, 0.0652619833015),
        ("y'", 0.3, -0.0302021587304),
        ("Kanai-Tajimi", 0.1, 0.0649108396287),
        ("Kanai-Tajimi", 0.3, -0.0291082620432),
    ],
)
def test_the_mean_square_of_a_spring(output, zeta, expected):
    law = law_of(output, zeta)
    assert filtered.moment_lyapunov(*MATRICES, law, 2, 14) == pytest.approx(expected, abs=2e-12)
    found = solved(Filter(*law))
    assert found.pair.value == pytest.approx(expected, abs=found.error)
    assert found.error < 1e-8


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("zeta", sampled(0.3, 0.1))
def test_fourth_moments(output, zeta):
    law = law_of(output, zeta)
    found = solved(Filter(*law), 4.0, rtol=1e-6 if zeta < 0.2 else 1e-8)
    expected = filtered.moment_lyapunov(*MATRICES, law, 4, 18 if zeta < 0.2 else 12)
    assert found.pair.value == pytest.approx(expected, abs=found.error + 1e-11)


def test_the_law():
    """∫S dω/2π is the variance, of y, y′ and the ground motion in closed form; S(ω) is that of the formula."""
    omega, zeta, s = 1.7, 0.35, 0.6
    variances = {
        (1.0, 0.0): s**2 / (4 * zeta * omega**3),
        (0.0, 1.0): s**2 / (4 * zeta * omega),
        (omega**2, 2 * zeta * omega): s**2 * omega * (1 + 4 * zeta**2) / (4 * zeta),
    }
    for output, expected in variances.items():
        noise = Filter(omega, zeta, s, *output)
        assert noise.standard_deviation**2 == pytest.approx(expected, rel=1e-14)
        total = sum(quad(noise.spectral_density, *ends, limit=200)[0] for ends in ((0, 5), (5, math.inf))) / math.pi
        assert total == pytest.approx(expected, rel=1e-7)
    gain = abs((0.7 - 0.8j * 0.9) / (1.3**2 - 0.9**2 + 2j * 0.4 * 1.3 * 0.9))
    assert MIXED.spectral_density(0.9) == pytest.approx((0.5 * gain) ** 2, rel=1e-14)
    assert Filter(2.0, 5.0, 1.0, 1.0, 0.0).correlation_time == pytest.approx(1 / (10 - math.sqrt(96)), rel=1e-14)


def test_the_turned_state():
    """du = −Mu dt + N dW: the covariance is 1, and ξ = std u₁ has the spectral density of the filter."""
    for noise in (MIXED, Filter(0.8, 2.5, 0.3, 0.0, -1.0)):
        drift = noise.drift_matrix
        covariance = solve_continuous_lyapunov(drift, drift + drift.T)
        np.testing.assert_allclose(covariance, np.eye(2), atol=1e-12)
        assert np.linalg.det(drift + drift.T) == pytest.approx(0, abs=1e-12)  # one W
        for omega in (0.0, 0.5, 3.0):
            spectrum = 2 * np.linalg.inv(1j * omega * np.eye(2) + drift).real[0, 0] * noise.standard_deviation**2
            assert noise.spectral_density(omega) == pytest.approx(spectrum, rel=1e-11, abs=1e-14)


def test_the_functions():
    """∫v Lu, L = −(Mu)·∇ + ½NNᵀ:∇∇, and ∫g u v of products of Hermite polynomials, by a rule for two numbers."""
    axis, m = PairAxis(MIXED, 4), MIXED.drift_matrix
    x, weights = np.polynomial.hermite_e.hermegauss(8)
    u, v, measure = np.repeat(x, 8), np.tile(x, 8), np.outer(weights, weights).ravel() / (2 * math.pi)

    def along(at, degree, order):
        """He^(order) over √degree!."""
        return HermiteE.basis(degree).deriv(order)(at) / math.sqrt(math.factorial(degree))

    pairs = [(degree - k, k) for degree in range(4) for k in range(degree + 1)]
    values, by_u, by_v, by_uu, by_uv, by_vv = (
        np.stack([along(u, j, of_u) * along(v, k, of_v) for j, k in pairs], axis=1)
        for of_u, of_v in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    )
    moved = -(m @ [u, v])[0][:, None] * by_u - (m @ [u, v])[1][:, None] * by_v
    moved += m[0, 0] * by_uu + (m[0, 1] + m[1, 0]) * by_uv + m[1, 1] * by_vv
    np.testing.assert_allclose(axis.generator(), (values * measure[:, None]).T @ moved, atol=1e-12)
    g = (MIXED.standard_deviation * u) ** 3
    np.testing.assert_allclose(axis.mass(lambda xi: xi**3), (values * (measure * g)[:, None]).T @ values, atol=1e-12)


def test_the_factors_of_the_functions():
    """(L + gu₁) e^{r·u} = ½g²S(0)/Var(ξ) e^{r·u}, also of the adjoint."""
    axis, pull = PairAxis(MIXED, 5, 0.7), 0.7
    driven = axis.generator() + pull / MIXED.standard_deviation * axis.mass(lambda xi: xi)
    rate = 0.5 * pull**2 * MIXED.spectral_density(0.0) / MIXED.standard_deviation**2
    for matrix in (driven, driven.T):
        np.testing.assert_allclose(matrix[:, 0], rate * np.eye(axis.size)[0], atol=1e-12)
    np.testing.assert_allclose(axis.generator_of_one(), axis.generator()[0], atol=0)
    assert axis.mass(lambda xi: xi)[0, 0] == pytest.approx(MIXED.standard_deviation * axis.center, rel=1e-12)


@pytest.mark.parametrize("noise", [MIXED, Filter(0.8, 2.5, 0.3, 0.0, -1.0), Filter(2.0, 1.0, 0.3, 1.0, 0.2)])
def test_a_step_has_the_transition_of_the_filter(noise):
    """The flow and the covariance of (w₁, u₁, ū), from du = ωw dt and dw = −ω(u + 2ζw) dt + 2√(ζω) dW."""
    h, omega, zeta = 0.5 * noise.largest_step, noise.omega, noise.zeta
    drift = np.array([[-2 * zeta * omega, -omega, 0], [omega, 0, 0], [0, 1 / h, 0]])
    intensity = np.diag([4 * zeta * omega, 0, 0])
    loan = expm(h * np.block([[-drift, intensity], [np.zeros((3, 3)), drift.T]]))
    step = noise.step(h)
    np.testing.assert_allclose(step.flow, loan[3:, 3:].T[:, :2], rtol=1e-12, atol=1e-13)
    covariance = loan[3:, 3:].T @ loan[:3, 3:]
    np.testing.assert_allclose(step.kicks @ step.kicks.T, covariance, rtol=1e-8, atol=1e-13)
    tiny = noise.step(1e-9).kicks  # of W, ∫W dt and ∬W dt² over h: 1, h²/3, h²/20
    scale = 2 * math.sqrt(zeta * omega * 1e-9) * np.array([1, omega * 1e-9, omega * 1e-9])
    np.testing.assert_allclose(np.diagonal(tiny @ tiny.T) / scale**2, [1, 1 / 3, 1 / 20], rtol=1e-6)


@pytest.mark.slow
def test_drawn_paths(rng):
    """One step from the stationary law: ξ keeps its variance, and ξ̄ has that of the mean of ξ."""
    n, h = 200_000, 0.6
    state, (mean, end, push) = MIXED.start(n, rng), np.zeros((3, n))
    np.testing.assert_allclose(state[0].std(), MIXED.standard_deviation, rtol=0.01)
    before = state[0].copy()
    draw(MIXED.step(h), state, mean, end, push, rng)
    assert end.std() == pytest.approx(MIXED.standard_deviation, rel=0.01)
    m = MIXED.drift_matrix
    lagged = MIXED.standard_deviation**2 * expm(-h * m)[0, 0]
    assert np.mean(before * end) == pytest.approx(lagged, abs=0.01 * MIXED.standard_deviation**2)
    variance = quad(lambda t: 2 * (1 - t / h) / h * MIXED.standard_deviation**2 * expm(-t * m)[0, 0], 0, h)[0]
    assert mean.var() == pytest.approx(variance, rel=0.02)
    assert np.mean(mean * end) == pytest.approx(np.mean(mean * before), rel=0.05)  # its C(t) is even


@pytest.mark.slow
def test_as_an_overdamped_filter_it_is_ornstein_uhlenbeck_noise():
    """ω = 2ζα, ζ → ∞: y′/α + y = white noise but for y″/(2ζα)², of order 2."""
    alpha, deviation = 0.7, 0.5
    limit = solved(OrnsteinUhlenbeck(alpha=alpha, sigma=deviation * math.sqrt(2 * alpha)), rtol=1e-10).pair.value
    off = []
    for zeta in (4.0, 8.0, 16.0):
        law = 2 * zeta * alpha, zeta
        noise = Filter(*law, filtered.strength(*law, 1.0, 0.0, deviation), 1.0, 0.0)
        off.append(solved(noise, rtol=1e-10).pair.value - limit)
    assert np.log2(np.array(off[:-1]) / off[1:]) == pytest.approx([2, 2], abs=0.02)


@pytest.mark.parametrize("output", ["y", "Kanai-Tajimi"])
def test_fast_filters_are_white_noise(output):
    """ω → ∞ with S(0) = s²: a/ω + b/ω², whose two parts may have two signs."""
    limit, scaled = solved(White(s=0.4), rtol=1e-11).pair.value, []
    for omega in (64.0, 128.0, 256.0):
        c0, c1 = (1.0, 0.0) if output == "y" else (omega**2, 0.6 * omega)
        noise = Filter(omega, 0.3, 0.4 * omega**2 / c0, c0, c1)
        assert noise.spectral_density(0.0) == pytest.approx(0.16, rel=1e-14)
        scaled.append(omega * (solved(noise, rtol=1e-11).pair.value - limit))
    first, second = np.diff(scaled)
    assert second / first == pytest.approx(0.5, abs=0.02)
    assert abs(scaled[-1] + second) > 1e-3  # a


def test_derivatives_of_the_law():
    for noise in (MIXED, Filter(0.8, 2.5, 0.3, 0.0, -1.0)):
        for name in noise.differentiable:
            value = noise.values[name]
            h = 1e-6 * max(abs(value), 1.0)
            more, less = (noise.at({name: value + side * h}) for side in (1, -1))
            change = noise.derivative(name)
            drift = np.array(change.drift) if change.drift else np.zeros((2, 2))
            np.testing.assert_allclose(drift, (more.drift_matrix - less.drift_matrix) / (2 * h), atol=1e-8)
            logs = math.log(more.standard_deviation / less.standard_deviation) / (2 * h)
            assert change.log_scale == pytest.approx(logs, abs=1e-8)


@pytest.mark.slow
def test_derivatives_of_the_mean_square():
    """With ∂Λ/∂θ by parameters of the filter and of the oscillator, against differences."""
    problem, h = oscillator(MIXED), 3e-4
    pair = ExponentSolver(problem, rtol=1e-9).solution(2.0).pair
    for key in ("noise.omega", "noise.c1", "system.damping"):
        more, less = (problem.at({key: problem.values[key] + side * h}) for side in (1, -1))
        values = [ExponentSolver(each, rtol=1e-10).solution(2.0).pair.value for each in (more, less)]
        slope = Changed(PairDerivatives(pair), problem.derivative(key)).value.value
        assert slope == pytest.approx((values[0] - values[1]) / (2 * h), abs=1e-7)


@pytest.mark.slow
def test_sensitivities():
    problem = oscillator(MIXED)
    found = sensitivities(problem, [2.0], rtol=1e-6).to_xarray()
    pair = ExponentSolver(problem, rtol=1e-8).solution(2.0).pair
    for key in ("omega", "zeta", "s", "c0", "c1"):
        slope = found.moment_by_theta.sel(parameter=f"noise.{key}").item()
        assert slope == pytest.approx(
            Changed(PairDerivatives(pair), problem.derivative(f"noise.{key}")).value.value, abs=1e-6
        )


def test_a_given_mesh():
    """Without lines of ξ; its degree is that of the products."""
    mesh = make_mesh(phi_cells=2, phi_degree=12, xi_degree=12)
    noise = Filter(*law_of("y", 0.3))
    found = solved(noise, mesh=replace(mesh, z_lines=np.zeros(0)))
    assert found.pair.space.shape[1] == 12 * 13 // 2
    assert found.pair.value == pytest.approx(-0.0280940333946, abs=found.error + 1e-12)
    with pytest.raises(MeshError, match="of a filter needs a mesh without z_lines"):
        solved(noise, mesh=mesh)


def test_the_lyapunov_exponent_of_a_saddle():
    """Λ′(0) with an output that damps y by way of y′ alone, against Λ(±h)/h by the same functions."""
    terms = CoefficientMatrix(0, ((0.0, 1.0), (1.0, -0.2))), CoefficientMatrix(1, ((0.2, -0.1), (0.4, -0.3)), identity)
    problem = Problem(PlaneSystem(terms), Filter(3.0, 0.9, 3.0, 0.0, 1.0))
    phase = PhaseAxis.of(np.linspace(0, np.pi, 3), np.array([12, 12]))
    generator = Generator(problem, Space((phase, PairAxis(problem.noise, 5))))
    pairs = [principal_pair(generator, p) for p in (0.0, 0.0025, -0.0025, 0.005, -0.005)]
    slopes = [(pairs[k].value - pairs[k + 1].value) / (2 * pairs[k].p) for k in (1, 3)]
    assert pairs[0].derivative == pytest.approx((4 * slopes[0] - slopes[1]) / 3, abs=1e-9)
    assert pairs[0].residual < 1e-13


def test_the_sign_of_the_output_has_no_part():
    values = [solved(Filter(1.3, 0.4, 0.5, 0.7 * side, -0.8 * side)).pair.value for side in (1, -1)]
    assert values[0] == pytest.approx(values[1], abs=1e-11)


def test_what_is_too_strong_is_refused_in_words():
    with pytest.raises(NotConverged, match=r"more than budget.unknowns = 3000; .* larger budget"):
        ExponentSolver(
            oscillator(Filter(*law_of("y", 0.02, deviation=1.5))), rtol=1e-8, budget=Budget(unknowns=3000)
        ).solution(4.0)


@pytest.mark.parametrize("seed", [1, 6, 15])
def test_random_filters(seed):
    """Twenty: `python -m tests.random_filters`."""
    assert (found := random_filters.compared(seed)).is_within, found


@pytest.mark.slow
def test_a_filter_that_needs_a_high_degree():
    """Of a few waves of φ each, which T of a filter needs no more than."""
    found = random_filters.compared(10)
    assert found.is_within, found
    assert found.shape[1] > 150
    assert math.prod(found.shape) < 5000


@pytest.mark.slow
def test_a_strong_slow_filter():
    """The functions carry a factor, with which a twentieth of the unknowns does; and ∂Λ/∂θ where they do."""
    assert (found := random_filters.compared(20)).is_within, found
    assert math.prod(found.shape) < 6000
    problem, h = random_filters.problem_of(*random_filters.drawn(20)), 3e-3
    pair = ExponentSolver(problem, rtol=1e-7).solution(2.0).pair
    key = "noise.zeta"
    sides = [problem.at({key: problem.values[key] + side * h}) for side in (1, -1)]
    more, less = (ExponentSolver(each, rtol=1e-7).solution(2.0).pair.value for each in sides)
    slope = Changed(PairDerivatives(pair), problem.derivative(key)).value.value
    assert slope == pytest.approx((more - less) / (2 * h), rel=1e-4)


CASE = """title = "A filter"
[system]
kind = "parametric"
stiffness = 1.0
damping = 0.05
[noise]
kind = "filter"
omega = 2.0
zeta = 0.3
s = 0.5
{output}
[moments]
p = [2.0]
"""


def read(tmp_path, output):
    return case_in(tmp_path, CASE.format(output=output), name="case")


def test_a_case_file_states_the_output_either_way(tmp_path):
    first, second = (read(tmp_path, text).noise for text in ("output = [4.0, 1.2]", "c0 = 4.0\nc1 = 1.2"))
    assert first == second == Filter(2.0, 0.3, 0.5, 4.0, 1.2)
    assert noise_kind("filter") is Filter
    assert list(oscillator(first).values)[-2:] == ["noise.c0", "noise.c1"]


@pytest.mark.parametrize(
    ("output", "words"),
    [
        ("output = [4.0, 1.2]\nc1 = 1.0", "got output and c1"),
        ("output = [0.0, 0.0]", "got c0 = 0 and c1 = 0"),
        ("output = [1.0]", "noise.output"),
        ('output = "y"', "noise.output"),
        ("output = [1e99, 0.0]", "c0"),
        ("c0 = 1.0", "got c0 alone"),
    ],
)
def test_bad_outputs_are_refused_in_words(tmp_path, output, words):
    with pytest.raises(CaseError, match=words) as failure:
        read(tmp_path, output)
    print(failure.value)


@pytest.mark.slow
def test_moments_at_several_p_share_what_is_known():
    found = moment_lyapunov(oscillator(Filter(*law_of("y", 0.3))), [-1.0, 0.0, 1.0, 2.0], rtol=1e-6)
    assert found.value[1] == 0
    assert np.all(np.diff(found.value, 2) > 0)  # Λ is convex
    assert found.value[3] == pytest.approx(-0.0280940333946, abs=1e-7)
