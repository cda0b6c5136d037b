"""One system written in several ways has one set of numbers, and other pairs of systems that must agree."""

import functools
import math
import random

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    make_mesh,
    moment_lyapunov,
    sensitivities,
    simulate,
)
from fpsolve.exponent import critical_impact_factor, critical_restitution, even_moment, impact_rate
from fpsolve.model import (
    Bounded,
    CoefficientMatrix,
    Filter,
    ImpactLaw,
    Jump,
    LinearSystem,
    ModalSystem,
    Noise,
    SineWiener,
    Telegraph,
    White,
    equations_of,
)
from fpsolve.theory import second_order
from tests.conftest import keeping
from tests.kit import equations, itself, matrices, rates
from tests.numbers.rows.delays import ITO
from tests.numbers.second import LOAD, even, spring

OU = OrnsteinUhlenbeck(alpha=1.0, sigma=0.6)
ROTATION, DAMPING = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[0.0, 0.0], [0.0, -0.2]])
PAPER = "x' = omega*v; v' = -omega*x + epsilon**2*c1*v + epsilon*xi*v"
LAWS = {ImpactLaw.DELTA: "exp(-epsilon**2*(1 - r))", ImpactLaw.RESTITUTION: "1 - epsilon**2*(1 - r)"}
MATHIEU = "x' = v; v' = -omega**2*x - 2*zeta*omega*v - xi*x"


def wall(restitution, at="x = 0"):
    return [{"at": at, "restitution": restitution}]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("epsilon", [0.05, pytest.param(1.0, marks=pytest.mark.slow)])
def test_equations_of_the_papers_oscillator_have_its_numbers_derivatives_and_theory(law, epsilon):
    values = {"omega": 1.3, "c1": 0.1, "epsilon": epsilon}
    oscillator = VibroImpactOscillator(restitution=0.8, impact=law, **values)
    ours, mine = Problem(oscillator, OU), rates(PAPER, OU, wall(LAWS[law]), r=0.8, **values)
    solvers = [ExponentSolver(each) for each in (ours, mine)]
    for quantity in (ExponentSolver.lyapunov_exponent, impact_rate, critical_impact_factor):
        one, other = map(quantity, solvers)
        assert other.value == pytest.approx(one.value, rel=1e-12)
    assert_allclose(*(each.moments([-1.0, 2.0]).value for each in solvers), rtol=1e-12)
    one, other = (vars(second_order(each)) for each in (ours, mine))
    for name, value in one.items():
        if name != "critical_restitution":
            assert other[name] == pytest.approx(value, rel=1e-12 if law == "delta" else epsilon**2)
    [one], [other] = (sensitivities(each, 2.0).moments for each in (ours, mine))
    for key, slope in one.items():
        same = key.replace("oscillator.restitution", "system.r").replace("oscillator", "system")
        assert other[same].value == pytest.approx(slope.value, rel=1e-11)


def test_impact_laws_of_the_papers_oscillator_are_their_formulas_and_differ_by_epsilon_to_the_fourth():
    for epsilon, r in ((0.025, 0.8), (1.0, 0.6), (1.2, 0.9)):
        delta, bounce = (VibroImpactOscillator(1.0, r, 0.0, epsilon, impact=law) for law in ImpactLaw)
        assert delta.impact_factor(3.0) == pytest.approx(math.exp(-3 * epsilon**2 * (1 - r)), rel=1e-14)
        assert bounce.impact_factor(3.0) == pytest.approx((1 - epsilon**2 * (1 - r)) ** 3, rel=1e-14)
        if epsilon < 0.1:
            off = (delta.log_impact_factor - bounce.log_impact_factor) / epsilon**4
            assert off == pytest.approx((1 - r) ** 2 / 2, rel=1e-3)
    for law in ImpactLaw:
        assert VibroImpactOscillator(1.0, 1.0, 0.0, 1.0, impact=law).impact_factor(7) == 1
    [note] = VibroImpactOscillator(1.0, 0.5, 0.0, 1.5).remarks
    assert "1 - epsilon^2 (1 - r) = -0.125 <= 0" in note
    assert "R = 0.325" in note
    oscillator = VibroImpactOscillator(1.3, 0.8, -0.4, 0.3)
    phi, ((one,), h1, q1) = np.linspace(0, 6, 9), (oscillator.jumps, oscillator.terms[1].h, oscillator.terms[1].q)
    assert_allclose(h1(phi), 0.5 * np.sin(2 * phi), atol=1e-15)  # Eqs. (17)-(18)
    assert_allclose(q1(phi), 0.5 * (1 - np.cos(2 * phi)), atol=1e-15)
    assert_allclose(
        [oscillator.terms[2].h(phi), oscillator.terms[2].q(phi)], [-0.4 * h1(phi), -0.4 * q1(phi)], atol=1e-15
    )
    assert (one.phase, one.log_factor) == (math.pi / 2, oscillator.log_impact_factor)


@pytest.mark.parametrize("seed", range(2))
def test_one_mode_matrices_and_equations_of_an_oscillator_are_one_system(seed):
    rng = np.random.default_rng([30, seed])
    m, (k, k_noise), (c, c_noise) = rng.uniform(0.5, 2.0), rng.uniform(0.5, 3.0, 2), rng.uniform(0.0, 0.4, 2)
    noise = White(s=0.5) if seed % 2 else OU
    terms = (
        CoefficientMatrix(0, ((0.0, 1.0), (-k / m, -c / m))),
        CoefficientMatrix(1, ((0.0, 0.0), (-k_noise / m, -c_noise / m)), itself),
    )
    written = "q' = v; v' = -((k + K*xi)*q + (c + C*xi)*v)/m"
    found = [
        moment_lyapunov(each, [-0.5, 1.0, 3.0], rtol=1e-11).value
        for each in (
            Problem(ModalSystem.of([[m]], [[k]], [[c]], stiffness_noise=[[k_noise]], damping_noise=[[c_noise]]), noise),
            Problem(LinearSystem(terms), noise),
            Problem(PlaneSystem(terms), noise),
            rates(written, noise, m=m, k=k, K=k_noise, c=c, C=c_noise),
        )
    ]
    for each in found[1:]:
        assert_allclose(each, found[0], rtol=1e-10, atol=1e-11)


MODES = {"m2": 0.8, "c": 0.05, "U": 1.2, "omega": 1.6, "g": 0.25}


def modes(**values):
    return ModalSystem.of(
        [[1.3, 0.2], [0.1, "m2"]],
        [["1 + 0.3*U**2", "U"], [0.4, "omega**2"]],
        [[0.1, 0.02], ["c", 0.16]],
        gyroscopic=[[0, "-g"], ["g", 0]],
        circulatory=[[0.0, 0.3], [-0.3, 0.0]],
        stiffness_noise={"wind": [[0.5, "0.3*U"], [0.3, 0.5]]},
        damping_noise={"wave": [[0.1, 0.0], [0.0, 0.2]], "wind": [[0.0, 0.1], [0.0, 0.0]]},
        parameters={**MODES, **values},
        noises={"wind": "noise.wind", "wave": "noise.wave"},
    )


def by_inverse(m2, c, U, omega, g):
    """The matrices of (q1, q1_dot, q2, q2_dot): without noise, of wind and of wave."""
    inverse = np.linalg.inv([[1.3, 0.2], [0.1, m2]])

    def state(of_q, of_speed, unit=0.0):
        total = np.zeros((4, 4))
        total[0, 1] = total[2, 3] = unit
        total[1::2, 0::2], total[1::2, 1::2] = -inverse @ of_q, -inverse @ of_speed
        return total

    stiffness = np.array([[1 + 0.3 * U**2, U + 0.3], [0.1, omega**2]])
    return {
        "": state(stiffness, np.array([[0.1, 0.02 - g], [c + g, 0.16]]), 1.0),
        "wind": state(np.array([[0.5, 0.3 * U], [0.3, 0.5]]), np.array([[0, 0.1], [0, 0]])),
        "wave": state(np.zeros((2, 2)), np.diag([0.1, 0.2])),
    }


def test_matrices_of_two_modes_and_their_derivatives_are_those_of_inverted_masses():
    assert modes().variables == ("q1", "q1_dot", "q2", "q2_dot")
    found = {term.noise: np.array(term.matrix) for term in modes().terms}
    for noise, matrix in by_inverse(**MODES).items():
        assert_allclose(found[noise], matrix, atol=1e-14)
    for name, value in MODES.items():
        less, more = (by_inverse(**{**MODES, name: value + side * 1e-5}) for side in (-1, 1))
        for noise in more:
            slope = sum(
                (np.array(term.matrix) for term in modes().derivative(name).terms if term.noise == noise),
                np.zeros((4, 4)),
            )
            assert_allclose(slope, (more[noise] - less[noise]) / 2e-5, atol=1e-9)
        assert_allclose(modes().at({name: 1.1}).terms[0].matrix, by_inverse(**{**MODES, name: 1.1})[""], atol=1e-14)


def test_impact_of_modes_obeys_the_law_of_impulses_and_keeps_energy_at_restitution_1():
    mass, c = np.array([[1, 0.3], [0.3, 2]]), np.array([1, -0.5])
    push = np.linalg.solve(mass, c)

    def stop(r):
        given = {"m": 0.3, "c": 0.5, "R": r}
        system = ModalSystem.of(
            [[1, "m"], ["m", 2]], [[2, 0], [0, 3]], stiffness_noise=[[1, 0.2], [0.2, 0]], parameters=given,
            walls=wall("R", "q1 - c*q2 = 0"),
        )  # fmt: skip
        assert equations_of(system)[-1].endswith("at q1 − 0.5 q2 = 0")
        assert system.differentiable == (("R",) if r < 1 else ())
        return system.linear().stop

    half = stop(0.6)
    jump = np.array(half.matrix)
    assert_allclose(jump[1::2, 1::2], np.eye(2) - 1.6 * np.outer(push, c) / (c @ push), atol=1e-14)
    assert_allclose(jump[::2], np.eye(4)[::2])
    assert_allclose(half.inside(jump), np.diag([1, -0.6, 1, 1]), atol=1e-12)
    elastic = np.array(stop(1.0).matrix)[1::2, 1::2]
    assert_allclose(elastic.T @ mass @ elastic, mass, atol=1e-14)


def texts(rng, depth):
    if depth == 0:
        return rng.choice(["a", "b", "c", "pi", f"{rng.uniform(0.5, 2):.3f}"])
    one, other = (texts(rng, depth - 1) for _ in range(2))
    power = rng.choice(["2", "3", "-1", "0.5", "-2.5"])
    sums = f"({one} + {other})", f"({one} - {other} / 9)", f"-({one})**2"
    return rng.choice(
        [*sums, f"{one} * {other}", f"({one}) / ({other})", f"sqrt({one})", f"({one})**{power}", "exp(-b)"]
    )


@pytest.mark.parametrize("seed", range(20))
def test_value_and_derivatives_of_a_random_expression_are_pythons_and_differences(seed):
    text, values = texts(random.Random(seed), 3), {"a": 1.3, "b": 0.7, "c": 2.1}

    def plain(**own):
        try:
            return eval(text, {"pi": math.pi, "exp": math.exp, "sqrt": math.sqrt}, own)
        except ValueError:
            return 1j

    if isinstance(plain(**values), complex):
        with pytest.raises(ValueError, match="is no real number"):
            equations(f"x' = v; v' = -x + ({text})*v - xi*x", **values)
        return
    system = equations(f"x' = v; v' = -x + ({text})*v - xi*x", **values)
    assert system.terms[0].matrix[1][1] == pytest.approx(plain(**values), rel=1e-13)
    for name, value in values.items():
        slope = sum(each.matrix[1][1] for each in system.derivative(name).terms)
        ahead, behind = (plain(**{**values, name: value + h}) for h in (1e-5, -1e-5))
        assert slope == pytest.approx((ahead - behind) / 2e-5, rel=1e-6, abs=1e-6 * max(1, abs(plain(**values))))


def test_powers_of_epsilon_in_equations_are_orders_of_their_matrices():
    system = equations("x' = v; v' = -(a + epsilon)**3*x - 2*xi*v/a", a=2.0, epsilon=0.1)
    found = {term.order: term.matrix[1][0] for term in system.terms if term.matrix[1][0]}
    assert found == {k: -math.comb(3, k) * 2.0 ** (3 - k) for k in range(4)}
    assert sum(term.matrix[1][1] for term in system.terms) == -1.0
    for law, exact in (
        ("exp(-epsilon**2*(1 - r))", lambda e: -0.2 * e**2),
        ("1 - epsilon**2*(1 - r)", lambda e: math.log1p(-0.2 * e**2)),
        ("1/(1 + epsilon**2)", lambda e: -math.log1p(e**2)),
    ):
        for epsilon in (0.5, 1e-5):
            [jump] = equations("x' = v; v' = -x - epsilon*xi*x", wall(law), r=0.8, epsilon=epsilon).jumps
            assert jump.log_factor == pytest.approx(exact(epsilon), rel=1e-14, abs=1e-16 * ("/" in law))
    for r in (1e-300, 1e-17, 1e-9, 0.3, 0.9, 1 - 1e-12, 1.7, 40.0):
        [jump] = equations("x' = v; v' = -x - xi*x", wall(r)).jumps
        assert jump.log_factor == pytest.approx(math.log(r), rel=1e-15)


def walled(first=-0.1, second=-0.2):
    """Two walls that telegraph noise does not move the phase across."""
    load = CoefficientMatrix(1, keeping(math.pi / 2, 0.4), itself)
    system = PlaneSystem(
        [CoefficientMatrix(0, spring(1.44, 0.096)), load], [Jump(math.pi / 2, first), Jump(0.4, second)]
    )
    return ExponentSolver(Problem(system, Telegraph(0.5, 1.0)))


def test_exponent_with_two_walls_is_that_without_and_the_rates_of_impacts_times_ln_R():
    solver = walled()
    crossing = [impact_rate(solver, jump).value for jump in (0, 1)]
    least = walled(0.0, 0.0).lyapunov_exponent().value
    assert solver.lyapunov_exponent().value == pytest.approx(least - 0.1 * crossing[0] - 0.2 * crossing[1], abs=1e-8)
    factor = critical_impact_factor(solver, 1).value
    assert walled(-0.1, math.log(factor)).lyapunov_exponent().value == pytest.approx(0, abs=1e-7)
    assert not impact_rate(solver)


def test_rate_of_impacts_under_white_noise_in_itos_sense_is_the_slope_of_the_exponent_by_ln_R():
    first, second = (rates("x' = v; v' = -x + 0.1*v + xi*v", White(0.5, "ito"), wall(r)) for r in (0.8, 0.9))
    solver = ExponentSolver(first, rtol=1e-10)
    change = ExponentSolver(second, rtol=1e-10).lyapunov_exponent().value - solver.lyapunov_exponent().value
    assert impact_rate(solver).value == pytest.approx(change / math.log(0.9 / 0.8), rel=1e-8)


def test_critical_restitution_is_a_root_of_the_exponent_whatever_the_law_of_the_wall():
    at = functools.partial(rates, "x' = v; v' = -1.44*x + 0.1*v - xi*x", White(s=0.6))
    for law in ("r", "sqrt(r)"):
        found = critical_restitution(ExponentSolver(at(wall(law), r=0.9))).value
        assert lyapunov_exponent(at(wall(found))).value == pytest.approx(0, abs=1e-9)


def test_sense_of_white_noise_is_half_a_square_of_its_matrix_in_the_drift():
    def value(rate, sense):
        return moment_lyapunov(rates(f"x' = v; v' = {rate}", White(0.5, sense)), 3.0, rtol=1e-10).value[0]

    ito, other = ("-x - 0.2*v - xi*x", "-x - 0.2*v + xi*v"), "-x - (0.2 + 0.125)*v + xi*v"
    assert value(ito[0], "ito") == pytest.approx(value(ito[0], "stratonovich"), rel=1e-12)
    assert value(ito[1], "ito") == pytest.approx(value(other, "stratonovich"), rel=1e-9)
    delayed = "x' = -x + 0.2*x(t - 1) + xi*(0.5*x + 0.3*x(t - 1))"
    found = even_moment(rates(delayed, White(s=1.0)), 2).value
    assert found == pytest.approx(even_moment(rates(f"{delayed} + 0.125*x + 0.075*x(t - 1)", ITO), 2).value, abs=1e-13)


def test_delays_are_one_chain_of_parts_and_a_wave_that_forces_leaves_growth_alone():
    def value(rate):
        return even_moment(rates(rate, ITO), 2).value

    for one, other in (
        ("x' = -x + 0.3*x(t - 1) + 0.4*xi*x(t - 1)", " + 1e-18*x(t - 1/3)"),
        ("x' = -x + 0.3*x(t - 2) + 0.4*xi*x(t - 1)", " + 1e-18*x(t - 3)"),
        ("x' = v; v' = -x - 0.3*v + 0.2*xi*x + 0.1*x(t - 2)", " + 0.3*cos(t)"),
    ):
        assert value(one) == pytest.approx(value(one + other), abs=1e-12)


def blocks(problem):
    """The variables of each of the blocks that it is solved by."""
    return [{*name.strip("()").split(", ")} for name in getattr(ExponentSolver(problem).method, "names", ())]


@pytest.mark.parametrize("order", ["xvz", "zxv"])
def test_moment_of_a_cascade_is_the_larger_of_its_blocks_in_any_order_of_variables(order):
    """x and v drive z; a coupling back leaves no blocks, and changes little."""
    own = {"x": "v", "v": "-x - 0.2*v + kappa*z - xi1*x", "z": "x - 2*z + xi2*z"}
    noises = OrnsteinUhlenbeck(1.0, 0.5), White(s=0.3)

    def cascade(kappa):
        return rates("; ".join(f"{name}' = {own[name]}" for name in order), noises, kappa=kappa)

    assert blocks(cascade(0.0)) == [{"x", "v"}, {"z"}]
    assert blocks(cascade(1e-9)) == []
    expected = even(2, spring(1.0, 0.1), (LOAD, noises[0]))
    for kappa in (0.0, 1e-9):
        assert even_moment(cascade(kappa), 2).value == pytest.approx(expected, abs=1e-8)


def test_bounded_noise_without_a_mean_frequency_is_sine_wiener_noise():
    at, sine = (matrices(spring(), LOAD, each) for each in (Bounded(0.4, 0.0, 0.3), SineWiener(0.4, 0.3)))
    near = matrices(spring(), LOAD, Bounded(0.4, 1e-6, 0.3))
    own, other, close = (moment_lyapunov(each, [1.0, 2.0], rtol=1e-11).value for each in (at, sine, near))
    assert_allclose(own, other, rtol=1e-14)
    assert_allclose(close, other, atol=1e-10)
    [slopes], [of_sine] = (sensitivities(each, 2.0).moments for each in (at, sine))
    assert slopes["noise.nu"].value == 0
    for name, same in (("mu", "amplitude"), ("sigma", "sigma")):
        assert slopes[f"noise.{name}"].value == pytest.approx(of_sine[f"noise.{same}"].value, rel=1e-12)


FAST = {  # a noise of a rate with S(0) = 0.25, and the power of the rate by which it nears white noise
    "telegraph": (lambda k: Telegraph(a=0.5 * math.sqrt(k), k=k), (2048.0, 4096.0, 8192.0), 1),
    "OU": (lambda k: OrnsteinUhlenbeck(alpha=k, sigma=0.5 * k), (256.0, 512.0, 1024.0), 1),
    "filter": (lambda w: Filter(w, 0.3, 0.5 * w**2, 1.0, 0.0), (64.0, 128.0, 256.0), 1),
    "sine-Wiener": (lambda s: SineWiener(amplitude=s / math.sqrt(8), sigma=s), (32.0, 64.0, 128.0), 2),
    "bounded": (lambda s: Bounded(s / math.sqrt(8), 2.0, s), (64.0, 128.0, 256.0), 2),
}


@pytest.mark.parametrize(
    "name",
    [each if each in ("telegraph", "OU", "filter") else pytest.param(each, marks=pytest.mark.slow) for each in FAST],
)
def test_fast_noise_nears_white_noise_by_a_power_of_its_rate(name):
    """Λ(2) is that of white noise, a/rate^n and b/rate^2n."""
    made, sizes, power = FAST[name]
    white = even(2, spring(), (LOAD, White(s=0.5)))
    assert all(made(each).spectral_density(0.0) == pytest.approx(0.25, rel=0.01) for each in sizes)
    gaps = [moment_lyapunov(matrices(spring(), LOAD, made(each)), 2.0, rtol=1e-10).value[0] - white for each in sizes]
    first, second = np.diff(np.array(gaps) * np.array(sizes) ** power)
    limit = gaps[-1] * sizes[-1] ** power + second
    assert abs(limit) > 1e-3
    assert second == pytest.approx(0.5**power * first, abs=0.05 * abs(first) + 1e-4 * abs(limit))


class Gain:
    """A function that cannot be hashed, as it compares by value."""

    def __call__(self, xi):
        return xi

    def __eq__(self, other):
        return isinstance(other, Gain)


@pytest.mark.parametrize(
    "g",
    [
        Gain(),
        pytest.param(lambda xi: xi, marks=pytest.mark.slow),
    ],
)
def test_any_callable_is_the_coefficient_that_it_computes(g):
    """g = 2ξ is ξ with twice the matrix, and a constant function no noise."""

    def driven(g, load, still=lambda xi: 3.0, rest=DAMPING):
        terms = CoefficientMatrix(0, ROTATION), CoefficientMatrix(0, rest, still), CoefficientMatrix(1, load, g)
        return Problem(PlaneSystem(terms, epsilon=0.3), OU)

    plain = driven(itself, 2 * LOAD, lambda xi: 1.0, 3 * DAMPING)
    for one in (driven(g, 2 * LOAD), driven(lambda xi: 2 * g(xi), LOAD)):
        assert second_order(one).moment_exponent(2.0) == pytest.approx(
            second_order(plain).moment_exponent(2.0), rel=1e-14
        )
        assert ExponentSolver(one).method.scale(2.0) == pytest.approx(
            ExponentSolver(plain).method.scale(2.0), rel=1e-14
        )
        assert_allclose(moment_lyapunov(one, [1.0, 2.0]).value, moment_lyapunov(plain, [1.0, 2.0]).value, rtol=1e-13)
    [slopes], [others] = (sensitivities(each, 2.0).moments for each in (driven(g, 2 * LOAD), plain))
    assert slopes["noise.sigma"].value == pytest.approx(others["noise.sigma"].value, rel=1e-12)


def test_problem_has_its_parameters_by_keys_with_units_and_other_values():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
    problem = Problem(oscillator, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction())
    told = problem.parameters
    assert told["noise.D0"].quantity.title == "noise intensity $D_0$ (1/time)"
    assert set(problem.differentiable) == {key for key in told if not isinstance(told[key].value, str)} - {
        "oscillator.c2", "oscillator.c3",
    }  # fmt: skip
    other = problem.at({"noise.D0": 2.0, "noise.treatment": "exact", "oscillator.omega": 3.0})
    assert (other.noise, other.system.omega) == (NonGaussianNoise(D0=2.0, tau0=0.5, r0=0.95), 3.0)
    units = [
        each.parameters["noise.s"].quantity.unit
        for each in (Problem(oscillator, White(0.6)), rates(MATHIEU, White(0.6), omega=1.0, zeta=0.1))
    ]
    assert units == ["1/time^(1/2)", "unknown"]
    named = PlaneSystem.of_equations(
        ("x", "v"), ("v", "-omega**2*x - load*x"), {"omega": 1.0}, noises={"load": "noise.axial"}
    )
    axial = Problem(named, OU)
    assert [*axial.values] == ["system.omega", "noise.axial.alpha", "noise.axial.sigma"]
    other = axial.at({"noise.axial.alpha": 2.0, "system.omega": 3.0})
    assert (other.noise.alpha, other.system.terms[0].matrix[1][0]) == (2.0, -9.0)
    assert axial.derivative("noise.axial.sigma").theta == 0.6
    assert equations("x' = v; v' = -x - sqrt(c)*v - xi*x", c=0.0).differentiable == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "noise", "more"),
    [
        ("x' = -x + 0.4*x(t - 1) + 0.05*xi*(x + x(t - 0.5))", ITO, {"paths": 4096, "time": 26.0}),
        ("x' = -x + 0.15*xi*x + 0.4*x(t - 1)", OrnsteinUhlenbeck(1.0, 0.8), {"paths": 2048, "time": 30.0}),
    ],
)
def test_simulated_mean_square_with_delays_is_that_of_the_moments(text, noise, more):
    problem = rates(text, noise)
    (found,) = simulate(problem, 2.0, estimator="population", **more).estimates
    assert abs(found.value - even_moment(problem, 2, rtol=1e-9).value) <= 4 * found.standard_error
    assert found.standard_error <= 1e-2


@pytest.mark.slow
def test_simulated_exponent_with_a_delay_lacks_the_bias_of_its_step():
    """Of hardly any noise λ is the root of s = −1 + 0.4 e^(−s): a step alone is off by 3e-5."""
    found = simulate(
        rates("x' = -x + 0.4*x(t - 1) + 0.0001*xi*x", ITO), (), estimator="direct", paths=1024, time=64.0, step=1 / 24
    )
    root = -1.0
    for _ in range(200):
        root -= 0.2 * (root + 1 - 0.4 * math.exp(-root))
    assert abs(found.lyapunov_exponent - root) <= 4 * found.lyapunov_exponent_error
    assert found.lyapunov_exponent_error <= 1e-5


def test_unit_of_the_noise_changes_no_digit_of_three_variables():
    """ε is stated, so that the noise, not multiplied by it, has the order 0 of the motion without noise."""
    text = "x' = v; v' = -x - 0.2*v + k*xi*x + 0.2*y; y' = epsilon*x - 0.5*y"
    values = [
        moment_lyapunov(rates(text, OrnsteinUhlenbeck(1.0, unit), k=0.3 / unit, epsilon=0.3), 1.0, rtol=1e-3).value
        for unit in (1.0, 1e-3)
    ]
    assert_allclose(*values, rtol=1e-12)


class Uniform(Noise):
    """Noise on (−1, 1) of the density ½, σ² = (1 − ξ²)^power; where it does not vanish ξ is reflected at the ends."""

    kind, values, half_width, standard_deviation, correlation_time, diffusion = "u", {}, 1.0, 3**-0.5, 1.0, 1.0

    def __init__(self, power):
        self.power = power

    def spectral_density(self, omega):
        return 1.0

    def squared_diffusion(self, xi):
        return np.maximum(1 - np.asarray(xi) ** 2, 0) ** self.power

    def log_density(self, xi):
        return np.where(np.abs(xi) < 1, -math.log(2), -math.inf)


@pytest.mark.parametrize("power", [0.0, 1.0])
def test_noise_of_any_power_at_its_ends_has_the_number_of_a_mesh(power):
    problem = rates("x' = v; v' = -x - 0.2*v - xi*x", Uniform(power))
    found, by_cells = (moment_lyapunov(problem, 2.0, mesh=mesh) for mesh in (None, make_mesh(xi_cells=8)))
    assert abs(found.value - by_cells.value) <= found.error_estimate + by_cells.error_estimate < 1e-6
