"""The choice of the discretisation: any tolerance in any regime, with honest errors, or a reason why not."""

import math
import time
from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    make_mesh,
    moment_lyapunov,
)
from fpsolve.errors import NotConverged
from fpsolve.exponent import Budget, adapt, principal_pair
from fpsolve.exponent.error import truncation
from fpsolve.exponent.starts import Start, first, first_place, other_places
from fpsolve.fem import Generator
from fpsolve.fem.effects import ModeEffects
from fpsolve.fem.generator import Pencil
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space
from fpsolve.messages import Code, Message
from fpsolve.model import MarkovChain, SineWiener, White
from fpsolve.theory import frozen_noise
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE, oracle_arguments
from tests.oracles import fourier_hermite, perturbation

WEAK_NOISE = FIG1_NOISE.ou_reduction()
WEAK = Problem(FIG1, WEAK_NOISE)
OWN = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.8}
NO_LOSS = {"omega": 1.0, "restitution": 1.0, "c1": 0.0}


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("p", [-1.5, 2.0, 5.5])
def test_every_tolerance_is_met(p, rtol):
    oracle = fourier_hermite.moment_lyapunov(**oracle_arguments(FIG1, WEAK_NOISE), p=p, harmonics=10, hermite=30)
    result = moment_lyapunov(Problem(FIG1, WEAK_NOISE), p, rtol=rtol)
    scale = max(abs(oracle), perturbation.moment_scale(FIG1, WEAK_NOISE, p))
    rounding = 1e-15 * FIG1.omega  # of the oracle, which is read off a matrix of this size
    assert abs(result.value[0] - oracle) <= rtol * scale + rounding
    assert result.error_estimate[0] <= rtol * scale
    assert not result.warnings


def test_tighter_tolerances_cost_more_unknowns_but_not_many_more():
    sizes = [
        moment_lyapunov(Problem(FIG1, WEAK_NOISE), 2.0, rtol=rtol).pairs[0].space.size
        for rtol in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
    ]
    assert sizes == sorted(sizes)
    assert sizes[-1] < 20 * sizes[0]


@pytest.mark.parametrize("p", [-1.0, 1.0, 2.0, 4.0])
def test_no_digits_are_lost_in_weak_noise(p):
    """(Λ − ε²Λ₂)/ε⁴ has a limit: at ε = 1e-4 that takes Λ right to 1e-10 of itself."""
    constants = []
    for epsilon in (1e-2, 1e-3, 1e-4):
        oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=epsilon)
        value = moment_lyapunov(Problem(oscillator, WEAK_NOISE), p, rtol=1e-11).value[0]
        constants.append((value - perturbation.moment_exponent(oscillator, WEAK_NOISE, p)) / epsilon**4)
    np.testing.assert_allclose(constants, constants[1], rtol=0.01)


@pytest.mark.parametrize(
    ("epsilon", "p", "value"),
    [
        (1.0, 2.0, 0.886234813612),
        (1.0, 3.0, 3.388172823067),
        (1.0, 4.0, 6.938432719324),
        (2.0, 2.0, 7.740233350685),
        (0.5, 8.0, 3.409208991669),
    ],
)
def test_cases_that_fool_a_search_near_the_guess(epsilon, p, value):
    """α = σ = ω = 1; the values are from Fourier-Hermite computations with up to 24 000 modes."""
    result = moment_lyapunov(Problem(VibroImpactOscillator(**NO_LOSS, epsilon=epsilon), UNIT_NOISE), p, rtol=1e-9)
    assert result.value[0] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("epsilon", [0.1, 0.5, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("c1", [-0.4, 0.3])
def test_identity_at_p_minus_2_for_any_noise(epsilon, c1):
    """Λ(−2) = −ε²c₁ + ε²σ²/(2α²) without impact."""
    noise = OrnsteinUhlenbeck(alpha=1.3, sigma=0.8)
    oscillator = VibroImpactOscillator(omega=1.7, restitution=1.0, c1=c1, epsilon=epsilon)
    value = moment_lyapunov(Problem(oscillator, noise), -2.0, rtol=1e-9).value[0]
    expected = epsilon**2 * (noise.sigma**2 / (2 * noise.alpha**2) - c1)
    assert value == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("tau0", [1e-3, 1e-4, 1e-5, 1e-6])
def test_fast_noise_tends_to_white_noise(tau0):
    """p = 2 without impact and damping: λ(λ − 2κ)(λ − κ/2) + 4ω²(λ − κ) = 0, κ = ε²σ²/α² (Stratonovich)."""
    kappa = 0.25
    noise = OrnsteinUhlenbeck(alpha=1 / tau0, sigma=math.sqrt(kappa) / tau0)
    roots = np.roots([1.0, -2.5 * kappa, kappa**2 + 4.0, -4 * kappa])
    white = roots[np.abs(roots.imag) < 1e-12].real.max()
    assert white == pytest.approx(0.25198400004, abs=1e-11)
    result = moment_lyapunov(Problem(VibroImpactOscillator(**NO_LOSS, epsilon=1.0), noise), 2.0)
    assert result.value[0] == pytest.approx(white, abs=tau0 + 1e-10)
    if tau0 < 1e-4:  # the distance is of first order in τ₀
        slower = OrnsteinUhlenbeck(alpha=0.1 / tau0, sigma=math.sqrt(kappa) * 0.1 / tau0)
        distance = moment_lyapunov(Problem(VibroImpactOscillator(**NO_LOSS, epsilon=1.0), slower), 2.0).value[0] - white
        assert distance / (result.value[0] - white) == pytest.approx(10, rel=0.2)


@pytest.mark.parametrize("tilt", [3.0, 4.0, 5.0])
def test_the_tilt_changes_nothing_but_the_cost(tilt):
    oscillator = VibroImpactOscillator(omega=10.0, restitution=0.8, c1=0.1, epsilon=0.1)
    noise = NonGaussianNoise(D0=1.0, tau0=20.0, r0=0.95).ou_reduction()
    phase = PhaseAxis(make_mesh(phi_cells=2).phi_lines, np.array([12, 12]))
    chosen = Space((phase, PolynomialAxis(noise, 40, tilt / 15)))
    oracle = fourier_hermite.moment_lyapunov(**oracle_arguments(oscillator, noise), p=15.0, harmonics=8, hermite=200)
    assert principal_pair(Generator(Problem(oscillator, noise), chosen), 15.0).value == pytest.approx(oracle, rel=1e-9)


def test_slow_noise_is_followed_a_hundred_units_away():
    oscillator = VibroImpactOscillator(omega=3.0, restitution=0.9, c1=0.1, epsilon=1.0)
    noise = NonGaussianNoise(D0=1.0, tau0=20.0, r0=1.0).ou_reduction()
    result = moment_lyapunov(Problem(oscillator, noise), 10.0)
    assert result.pairs[0].space.xi.points[0] > 37  # where P_s has underflown
    finer = moment_lyapunov(Problem(oscillator, noise), 10.0, rtol=1e-10)
    assert result.value[0] == pytest.approx(finer.value[0], rel=1e-8)
    # to leading order ξ is held where p G(ξ) − ξ²/(4 D₀) is largest, G being the rate of the faster real mode
    xi = np.linspace(50, 200, 4001) * noise.standard_deviation
    rate = 0.5 * (xi + 0.1 + np.sqrt((xi + 0.1) ** 2 - 4 * oscillator.omega**2))
    assert result.value[0] == pytest.approx(np.max(10 * rate - xi**2 / 4), rel=1e-3)


@pytest.mark.parametrize(
    ("tau0", "p", "D0", "value"),
    [
        (20.0, 9.0, 1.3, 6.336967),
        (10.0, 9.0, 1.3, 6.330893),
        (5.0, 10.0, 1.0, 4.3739602720),
        (5.0, 10.0, 0.9, 2.608412),
    ],
)
def test_of_two_places_that_slow_noise_may_hold_the_faster_counts(tau0, p, D0, value):
    """The pair of the slower place, where the oscillator still turns, also has T > 0 as far as a mesh can tell.

    The third value is from 60 × 500 Fourier-Hermite modes, the others from fixed meshes over both places.
    """
    oscillator = VibroImpactOscillator(**NO_LOSS, epsilon=math.sqrt(0.1))
    noise = NonGaussianNoise(D0=D0, tau0=tau0, r0=1.0).ou_reduction()
    assert moment_lyapunov(Problem(oscillator, noise), p).value[0] == pytest.approx(value, rel=3e-7)
    along = moment_lyapunov(Problem(oscillator, noise), [p - 6, p - 3, p])
    assert along.value[-1] == pytest.approx(value, rel=3e-7)


@pytest.mark.slow
def test_a_mesh_that_leaves_the_faster_place_out_is_warned_of():
    oscillator = VibroImpactOscillator(**NO_LOSS, epsilon=math.sqrt(0.1))
    noise = NonGaussianNoise(D0=1.3, tau0=20.0, r0=1.0).ou_reduction()
    mesh = make_mesh(phi_cells=4, phi_degree=10, xi_cells=12, xi_degree=12, xi_min=-6, xi_max=18)
    result = moment_lyapunov(Problem(oscillator, noise), 9.0, mesh=mesh)
    assert result.value[0] < 3
    assert any("Λ(9) may be larger: slow noise may carry the moment near 3" in text for text in result.warnings)
    assert moment_lyapunov(Problem(oscillator, noise), 9.0).warnings == ()


@pytest.mark.slow
def test_truncation_bounds_what_a_cut_changes():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.3)
    full = moment_lyapunov(Problem(oscillator, WEAK_NOISE), 3.0, rtol=1e-12).value[0]
    for upper in (4.0, 5.0, 6.0):
        mesh = make_mesh(phi_cells=2, phi_degree=14, xi_cells=6, xi_degree=12, xi_min=-8.0, xi_max=upper)
        pair = principal_pair(Generator(Problem(oscillator, WEAK_NOISE), mesh), 3.0)
        error = abs(pair.value - full)
        assert 1e-10 < error <= 3 * truncation(pair)[1] <= 1e3 * error


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_cells_that_reach_the_ends_of_the_noise_cut_nothing_off():
    """There P_s of sine-Wiener noise is infinite, and σ² zero."""
    noise, end = SineWiener(amplitude=1.0, sigma=1.0), math.sqrt(2)
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.3)
    mesh = make_mesh(phi_cells=2, phi_degree=10, xi_cells=4, xi_degree=8, xi_min=-end, xi_max=end)
    pair = principal_pair(Generator(Problem(oscillator, noise), mesh), 3.0)
    assert truncation(pair) == (0.0, 0.0)
    assert pair.value == pytest.approx(moment_lyapunov(Problem(oscillator, noise), 3.0).value[0], rel=1e-5)


def test_while_nothing_is_resolved_the_axis_that_lacks_most_is_doubled():
    phase = PhaseAxis(np.array([0.0, 1.0]), np.array([5]))
    chosen = Space((phase, PolynomialAxis(UNIT_NOISE, 4), PolynomialAxis(UNIT_NOISE, 6)))
    small, large = (ModeEffects(np.array([5]), size * np.array([[0.5], [1.0], [5.0], [10.0]])) for size in (1e-4, 1.0))
    assert [axis.count for axis in chosen.doubled((small, large, small)).noises] == [8, 6]
    assert chosen.doubled((small, large, small)).phi.size == 6
    assert chosen.doubled().size == 8 * chosen.size


@pytest.mark.parametrize("budget", [Budget(unknowns=900), Budget(unknowns=1500), Budget(seconds=0.02)])
def test_a_budget_ends_the_search_with_the_best_value(budget, monkeypatch):
    solver = ExponentSolver(
        Problem(VibroImpactOscillator(**NO_LOSS, epsilon=1.0), UNIT_NOISE), rtol=1e-12, budget=budget
    )
    started = time.perf_counter()
    with pytest.raises(NotConverged, match=r"Λ\(2\) did not converge: .* more than budget\.") as caught:
        solver.solution(2.0)
    assert time.perf_counter() - started < 5
    if caught.value.partial is not None:
        best = caught.value.partial
        assert f"best value {best.pair.value:.6g} with an estimated error of {best.error:.1e}" in str(caught.value)
        assert abs(best.pair.value - 0.886234813612) <= 3 * best.error
    assert caught.value.partial is not None or budget.seconds < 1
    monkeypatch.setattr("fpsolve.exponent.adapt.principal_pair", None)  # nothing is sought again
    with pytest.raises(NotConverged) as again:
        solver.solution(2.0)
    assert str(again.value) == str(caught.value)


def test_a_budget_holds(monkeypatch):
    """Where each factorisation takes a second."""
    count, factorised = [0], Pencil.factorised

    def counted(pencil, shift):
        found = factorised(pencil, shift)
        count[0] += 1
        return found

    monkeypatch.setattr(Pencil, "factorised", counted)
    monkeypatch.setattr("fpsolve.budget.time.thread_time", lambda: float(count[0]))
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.5, epsilon=0.1)
    with pytest.raises(NotConverged, match=r"more than budget.seconds = 6"):
        moment_lyapunov(Problem(oscillator, FIG1_NOISE.ou_reduction()), 1e5, budget=Budget(seconds=6.0))
    assert 6 <= count[0] <= 8


def test_a_chain_of_which_all_states_are_neighbours_takes_long():
    rates = np.ones((60, 60))
    np.fill_diagonal(rates, 0.0)
    chain = MarkovChain(states=np.linspace(-1, 1, 60), rates=rates)
    with pytest.raises(NotConverged, match=r"it takes some .* more than budget.seconds = 0.05; no mesh"):
        moment_lyapunov(Problem(FIG1, chain), 2.0, budget=Budget(seconds=0.05))


def test_p_of_any_size_ends_at_once_without_a_warning():
    with pytest.raises(NotConverged, match=r"Λ\(1e\+300\) is beyond floating-point numbers"):
        moment_lyapunov(Problem(FIG1, WEAK_NOISE), 1e300)


def test_a_tolerance_below_rounding_is_refused():
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-1e16*x - 0.1*v - xi*x"))
    with pytest.raises(NotConverged, match=r"rounding alone may change it by .*; use a larger rtol") as told:
        moment_lyapunov(Problem(system, White(s=0.1)), 2.0)
    assert "budget" not in str(told.value)


@pytest.mark.parametrize("budget", [{"unknowns": 5}, {"seconds": 0.0}, {"seconds": math.inf}, {"unknowns": 1e3}])
def test_bad_budgets_are_refused(budget):
    with pytest.raises(ValueError, match=r"unknowns|seconds"):
        Budget(**budget)


def test_no_cells_are_asked_for_where_the_mesh_is_chosen():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=3.0)
    noise = NonGaussianNoise(D0=2.0, tau0=5.0, r0=0.95).ou_reduction()
    with pytest.raises(
        NotConverged, match=r"was not found on this mesh: .*; use a larger rtol or a larger budget$"
    ) as said:
        moment_lyapunov(Problem(oscillator, noise), -3.0, rtol=1e-4, budget=Budget(unknowns=200))
    assert "use more cells" not in str(said.value)


def test_a_start_that_is_of_no_use_gives_no_warning():
    """The eigenfunctions of slow noise at p = 8, carried to those near p = 0, are next to orthogonal."""
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0)
    noise = NonGaussianNoise(D0=2.0, tau0=50.0, r0=0.95).ou_reduction()
    solver = ExponentSolver(Problem(oscillator, noise), rtol=1e-4)
    found = solver.moments([-3.0, 8.0])
    assert np.all(found.value > 0)
    assert solver.lyapunov_exponent().value < 0


def test_a_place_is_a_function_that_yields_a_start(monkeypatch):
    """Of two places of slow noise the slower one alone gives a lower eigenvalue; one that is added gives Λ(p).

    Noise that is held at z standard deviations grows at about the rate that `FrozenNoise.peaks` has from the frozen
    generator, to first order in 1/τ₀.
    """
    oscillator = VibroImpactOscillator(**NO_LOSS, epsilon=math.sqrt(0.1))
    problem = Problem(oscillator, NonGaussianNoise(D0=1.3, tau0=20.0, r0=1.0).ou_reduction())
    (_, slow, fast), (_, rate, _) = frozen_noise(problem).peaks(9.0)

    def slower(question, found):
        yield Start(question.problem, first(question.problem, question.p, question.rtol, slow))

    def faster(question, found):
        assert [each.pair.p for each in found] == [9.0]
        yield Start(question.problem, first(question.problem, question.p, question.rtol, fast))

    monkeypatch.setattr(adapt, "STARTS", (slower,))
    assert moment_lyapunov(problem, 9.0).value[0] == pytest.approx(rate, rel=0.02)
    for other in (faster, other_places):
        monkeypatch.setattr(adapt, "STARTS", (slower, other))
        assert moment_lyapunov(problem, 9.0).value[0] == pytest.approx(6.336967, rel=3e-7)


def test_a_space_without_a_pair_is_followed_by_a_larger_one():
    start = Start(WEAK, first(WEAK, 2.0, 1e-8))
    assert start.doubled(None).space.size > start.space.size


def test_the_best_of_a_search_is_told(monkeypatch):
    """Whatever the order in which solutions were found."""
    pair, left = ExponentSolver(WEAK).solution(2.0).pair, iter((4.0, 2.0, 3.0))

    class Stub(Start):
        def pair(self, p, near):
            return pair

        def with_error(self, pair, allowed):
            if (size := next(left, None)) is None:
                raise adapt.Ended(Message(Code.MESHES_SPENT, count=3))
            return SimpleNamespace(pair=pair, error=size * allowed)

        def refined(self, *_):
            return self

    monkeypatch.setattr(adapt, "STARTS", (lambda *_: iter([Stub(WEAK, first(WEAK, 2.0, 1e-8))]),))
    with pytest.raises(NotConverged) as caught:
        ExponentSolver(WEAK).solution(2.0)
    assert caught.value.partial.error == pytest.approx(2.0 * ExponentSolver(WEAK).tolerance(2.0, pair.value))


def test_a_place_that_fails_tells_nothing_of_another(monkeypatch):
    """What was found at the first place may be a lower eigenvalue."""
    problem, budget = Problem(VibroImpactOscillator(**OWN), UNIT_NOISE), Budget(unknowns=3000)

    def too_large(question, found):
        space = first(question.problem, question.p, question.rtol)
        while space.size <= budget.unknowns:
            space = space.doubled()
        yield Start(question.problem, space)

    monkeypatch.setattr(adapt, "STARTS", (first_place, too_large))
    with pytest.raises(NotConverged) as caught:
        ExponentSolver(problem, rtol=1e-6, budget=budget).solution(2.0)
    assert caught.value.partial is None
