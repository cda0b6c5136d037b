"""Systems that are written as equations, against the same systems by matrices and against the paper's oscillator."""

import math
import pickle
import time
from dataclasses import replace

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    boundary,
    moment_lyapunov,
    sensitivities,
)
from fpsolve.analysis import Axis
from fpsolve.arrays import identity
from fpsolve.exponent import critical_impact_factor, critical_restitution, impact_rate
from fpsolve.model import CoefficientMatrix, CubicTerms, EquationSystem, ImpactLaw, Jump, MarkovChain
from fpsolve.model.faults import TableError
from fpsolve.model.frame import Frame
from fpsolve.theory import second_order
from tests.conftest import keeping

NOISE = OrnsteinUhlenbeck(alpha=1.0, sigma=0.6)
PAPER = "omega*v", "-omega*x + epsilon**2*c1*v + epsilon*xi*v"
LAWS = {ImpactLaw.DELTA: "exp(-epsilon**2*(1 - r))", ImpactLaw.RESTITUTION: "1 - epsilon**2*(1 - r)"}
MATHIEU = "v", "-omega**2 * x - 2*zeta*omega * v - xi*x"


def paper_and_equations(law, epsilon, omega=1.3):
    oscillator = VibroImpactOscillator(omega=omega, restitution=0.8, c1=0.1, epsilon=epsilon, impact=law)
    parameters = {"omega": omega, "r": 0.8, "c1": 0.1, "epsilon": epsilon}
    wall = {"at": "x = 0", "restitution": LAWS[law]}
    return oscillator, PlaneSystem.of_equations(("x", "v"), PAPER, parameters, walls=[wall])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("epsilon", [0.05, 1.0])
def test_the_oscillator_of_the_paper(law, epsilon):
    """Λ, λ, N, R_c, r_c, perturbation theory and all derivatives to 1e-12."""
    problems = [Problem(system, NOISE) for system in paper_and_equations(law, epsilon)]
    moments = [moment_lyapunov(problem, [-1.0, 2.0]).value for problem in problems]
    np.testing.assert_allclose(*moments, rtol=1e-12)
    solvers = [ExponentSolver(problem) for problem in problems]
    for quantity in (ExponentSolver.lyapunov_exponent, impact_rate, critical_impact_factor, critical_restitution):
        ours, mine = map(quantity, solvers)
        assert mine.value == pytest.approx(ours.value, rel=1e-12)
    theories = [vars(second_order(problem)) for problem in problems]
    for name, value in theories[0].items():
        assert theories[1][name] == pytest.approx(value, rel=1e-12)
    [ours], [mine] = (sensitivities(problem, 2.0).moments for problem in problems)
    for key, slope in ours.items():
        same = key.replace("oscillator.restitution", "system.r").replace("oscillator", "system")
        assert mine[same].value == pytest.approx(slope.value, rel=1e-11)


@pytest.mark.slow
def test_equations_take_as_long_as_the_oscillator():
    """At most 1.2 times, parsing included; the least of several times, in turns."""
    seconds = {VibroImpactOscillator: list[float](), EquationSystem: list[float]()}
    for epsilon in 0.1 + 1e-3 * np.arange(7):  # new systems each time
        for system in paper_and_equations(ImpactLaw.DELTA, float(epsilon)):
            started = time.process_time()
            at = system.at({"c1": 0.2})
            moment_lyapunov(Problem(at, NOISE), np.linspace(-1, 4, 5))
            sensitivities(Problem(at, NOISE), 2.0)
            seconds[type(system)].append(time.process_time() - started)
    ours, mine = (np.sort(each)[:3].mean() for each in seconds.values())
    assert mine <= 1.2 * ours


def by_matrices(omega, zeta, loss):
    free = CoefficientMatrix(0, ((0.0, 1.0), (-(omega**2), -2 * zeta * omega)))
    terms = [free, CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity)]
    return terms, [Jump(math.pi / 2, math.log(1 - loss))]


VALUES = {"omega": 1.2, "zeta": 0.08, "loss": 0.1}
WALLED = PlaneSystem.of_equations(
    ("x", "v"), MATHIEU, VALUES, walls=[{"at": "x = 0", "restitution": "1 - loss"}]
)  # fmt: skip


def test_a_system_without_epsilon():
    """The terms of the same system by its matrices: what is constant has the order 0, the noise the order 1."""
    terms, jumps = by_matrices(**VALUES)
    assert (WALLED.terms, WALLED.epsilon) == (tuple(terms), 1.0)
    assert [(jump.phase, jump.leading) for jump in WALLED.jumps] == [(math.pi / 2, None)]
    assert WALLED.jumps[0].log_factor == pytest.approx(jumps[0].log_factor, rel=1e-15)
    assert dict(WALLED.values) == VALUES


def test_derivatives_are_those_of_a_polynomial_through_values():
    for name, value in VALUES.items():
        terms, slopes = WALLED.derivative(name)
        points = [by_matrices(**{**VALUES, name: value + 1e-3 * k}) for k in (-2, -1, 1, 2)]
        weights = np.array([1, -8, 8, -1]) / 12e-3
        changes = sum(w * np.array(each[0].matrix) for w, (each, _) in zip(weights, points, strict=True))
        np.testing.assert_allclose(sum(np.array(each.matrix) for each in terms), changes, atol=1e-11)
        logs = [jump.log_factor for _, [jump] in points]
        np.testing.assert_allclose(slopes or (0.0,), weights @ logs, rtol=1e-10, atol=1e-12)
    problem = Problem(WALLED, NOISE)
    assert problem.differentiable == ["system.omega", "system.zeta", "system.loss", "noise.alpha", "noise.sigma"]


def test_an_infinite_derivative_is_none_to_differentiate_by():
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - sqrt(c)*v - xi*x"), {"c": 0.0})
    assert system.differentiable == ()
    assert system.at({"c": 0.01}).differentiable == ("c",)
    with pytest.raises(ValueError, match="the derivative of the system by c is not finite"):
        system.derivative("c")


def test_critical_restitution_is_a_root():
    """For a law r of its own, R itself where the parameter is no coefficient of restitution; one λ = 0 for all."""
    growing = "v", "-omega**2 * x + 0.1*v - xi*x"
    values, laws = {"omega": 1.2, "r": 0.9}, ("r", "sqrt(r)", "2*r", 0.9)
    found = []
    for law in laws:
        system = PlaneSystem.of_equations(("x", "v"), growing, values, walls=[{"at": "x = 0", "restitution": law}])
        found.append(critical_restitution(ExponentSolver(Problem(system, NOISE))).value)
    assert found[0] == pytest.approx(found[3], rel=1e-9)  # 2*r is not 1 for r = 1
    assert found[0] == pytest.approx(found[2], rel=1e-9)
    assert found[1] == pytest.approx(found[0] ** 2, rel=1e-9)
    system = PlaneSystem.of_equations(
        ("x", "v"), growing, {**values, "r": found[0]}, walls=[{"at": "x = 0", "restitution": "r"}]
    )
    assert ExponentSolver(Problem(system, NOISE)).lyapunov_exponent().value == pytest.approx(0, abs=1e-9)


def test_walls_at_rays_of_a_plane_system():
    """λ = λ₀ + Σ N_j ln R_j for two rays in different places; the rate of each is a slope of λ."""

    def walled(first, second):
        free, *_ = by_matrices(**VALUES)[0]
        driven = CoefficientMatrix(1, keeping(math.pi / 2, 0.4), identity)
        system = PlaneSystem([free, driven], [Jump(math.pi / 2, first), Jump(0.4, second)])
        return ExponentSolver(Problem(system, MarkovChain.telegraph(0.5, 1.0)))

    solver = walled(-0.1, -0.2)
    rates = [impact_rate(solver, jump).value for jump in (0, 1)]
    least = walled(0.0, 0.0).lyapunov_exponent().value
    assert solver.lyapunov_exponent().value == pytest.approx(least - 0.1 * rates[0] - 0.2 * rates[1], abs=1e-8)
    factor = critical_impact_factor(solver, 1).value
    assert walled(-0.1, math.log(factor)).lyapunov_exponent().value == pytest.approx(0, abs=1e-7)
    assert not impact_rate(solver)
    with pytest.raises(ValueError, match="got jump = 2; must be a whole number from 0 to 1"):
        impact_rate(solver, 2)


def test_the_velocity_itself_as_a_variable():
    """(x, ẋ) instead of (x, ẋ/ω) changes neither Λ nor its derivatives, nor N."""
    scaled = PlaneSystem.of_equations(
        ("x", "v"), ("omega*v", "-omega*x - 2*zeta*omega*v - xi*x/omega"), {"omega": 3.0, "zeta": 0.05},
        walls=[{"at": "x = 0", "restitution": 0.9}],
    )  # fmt: skip
    plain = PlaneSystem.of_equations(
        ("x", "v"), MATHIEU, {"omega": 3.0, "zeta": 0.05}, walls=[{"at": "x=0", "restitution": 0.9}]
    )
    values = [moment_lyapunov(Problem(system, NOISE), [-1.0, 2.0], rtol=1e-9).value for system in (scaled, plain)]
    np.testing.assert_allclose(*values, rtol=1e-8)
    [one], [other] = (sensitivities(Problem(system, NOISE), 2.0).moments for system in (scaled, plain))
    for key, slope in one.items():
        assert other[key].value == pytest.approx(slope.value, rel=1e-6)


def test_wall_where_the_second_variable_is_zero():
    """Exchanging the two variables changes nothing."""
    other = PlaneSystem.of_equations(
        ("v", "x"), MATHIEU[::-1], {"omega": 1.2, "zeta": 0.08, "loss": 0.1},
        walls=[{"at": "x = 0", "restitution": "1 - loss"}],
    )  # fmt: skip
    assert other.jumps[0].phase == 0.0
    values = [moment_lyapunov(Problem(system, NOISE), [2.0]).value[0] for system in (WALLED, other)]
    assert values[0] == pytest.approx(values[1], rel=1e-9)


CUBIC = "v", "-omega**2*x + 2*zeta*v - epsilon*k*(x + v/2)**3 - v*(c*x**2 + zeta*v**2) - xi*x"
OF_CUBIC = {"omega": 2.0, "zeta": 0.1, "k": 0.3, "c": 0.2, "epsilon": 0.5}


def test_terms_of_degree_three():
    """Their polar form from the rates themselves; what else is computed does not see them."""
    system = PlaneSystem.of_equations(("x", "v"), CUBIC, OF_CUBIC)
    linear = PlaneSystem.of_equations(("x", "v"), ("v", "-omega**2*x + 2*zeta*v - xi*x"), {"omega": 2.0, "zeta": 0.1})
    assert (system.responds, linear.responds) == (True, False)
    phi = np.linspace(0, 6, 7)
    x, v = np.cos(phi), -np.sin(phi)
    force = -0.5 * 0.3 * (x + v / 2) ** 3 - v * (0.2 * x**2 + 0.1 * v**2)
    np.testing.assert_allclose(system.cubic.h(phi), -np.cos(phi) * force, atol=1e-15)
    np.testing.assert_allclose(system.cubic.q(phi), -np.sin(phi) * force, atol=1e-15)
    assert system.aspect == 2
    matrices = [{term.matrix for term in each.terms} for each in (system, linear)]
    assert matrices[0] == matrices[1]
    assert (system.inert, system.differentiable) == (("k", "c", "epsilon"), ("omega", "zeta"))
    assert PlaneSystem.of_equations(("x", "v"), CUBIC, {**OF_CUBIC, "c": 0.0}).inert == system.inert
    driven = "v", f"{CUBIC[1]} + epsilon**2*c*v"
    assert PlaneSystem.of_equations(("x", "v"), driven, {**OF_CUBIC, "c": 0.0}).inert == ("k",)


@pytest.mark.parametrize("seed", range(3))
def test_terms_of_degree_three_in_other_coordinates(seed):
    """ẏ = S⁻¹ C m(Sy) at a point."""
    rng = np.random.default_rng(seed)
    s = np.array([[rng.uniform(0.5, 2), 0.0], [rng.normal(), rng.uniform(0.5, 2)]])
    c, y = rng.normal(size=(2, 4)), rng.normal(size=2)

    def products(x):
        return np.array([x[0] ** 3, x[0] ** 2 * x[1], x[0] * x[1] ** 2, x[1] ** 3])

    turned = np.array(Frame(s.tolist()).cubic(CubicTerms(c)).matrix)
    np.testing.assert_allclose(turned @ products(y), np.linalg.solve(s, c @ products(s @ y)), rtol=1e-12)


@pytest.mark.parametrize("matrix", [((1.0, 0.0),), "x", ((math.nan,) * 4,) * 2])
def test_what_are_no_terms_of_degree_three(matrix):
    with pytest.raises(ValueError, match="must be"):
        CubicTerms(matrix)


def test_named_noise_and_other_values():
    system = PlaneSystem.of_equations(
        ("x", "v"), ("v", "-omega**2*x - load*x"), {"omega": 1.0}, noises={"load": "noise.axial"}
    )
    problem = Problem(system, NOISE)
    assert [*problem.values] == ["system.omega", "noise.axial.alpha", "noise.axial.sigma"]
    other = problem.at({"noise.axial.alpha": 2.0, "system.omega": 3.0})
    assert (other.noise.alpha, other.system.terms[0].matrix[1][0]) == (2.0, -9.0)
    assert problem.parameters["noise.axial.alpha"].quantity.name == "noise.axial.alpha"
    assert problem.parameters["noise.axial.alpha"].field is not None
    assert problem.derivative("noise.axial.sigma").theta == NOISE.sigma
    with pytest.raises(ValueError, match=r"got noise\.alpha; the parameters are system\.omega, noise\.axial\.alpha"):
        problem.at({"noise.alpha": 2.0})
    with pytest.raises(ValueError, match="got mass; the parameters are omega"):
        system.at({"mass": 1.0})


@pytest.mark.slow
def test_charts_in_its_own_parameters():
    """ẍ + 2ζẋ + (1 + ξ)x under weak, fast noise: λ = 0 at ζ = S(2)/8, which Eq. (39) says here."""
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 2*zeta*v - size*xi*x"), {"zeta": 0.01, "size": 0.1})
    noise = OrnsteinUhlenbeck(alpha=5.0, sigma=5.0)
    line = boundary(
        Problem(system, noise), "lyapunov_exponent", Axis("system.size", 0.05, 0.1), Axis("system.zeta", 1e-4, 1e-2)
    )
    [branch] = line.branches
    expected = branch.x**2 * noise.spectral_density(2.0) / 8
    np.testing.assert_allclose(branch.y, expected, rtol=0.02)


def test_it_pickles_and_is_a_key():
    again = pickle.loads(pickle.dumps(WALLED))
    assert (again, hash(again)) == (WALLED, hash(WALLED))
    assert replace(WALLED, named=(("omega", 1.0), ("zeta", 0.1), ("loss", 0.1))) != WALLED
    with pytest.raises(TableError) as raised:
        WALLED.at({"loss": 2.0})
    assert str(pickle.loads(pickle.dumps(raised.value))) == str(raised.value)
    assert str(raised.value).startswith("walls[0].restitution: the restitution is -1; must be > 0")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"variables": ()}, "variables: got "),
        ({"variables": ("x", 3)}, "variables: got "),
        ({"drift": "v, -x"}, "drift: got "),
        ({"drift": ("v", "-x*x - xi*x")}, "drift[1]: the term -x*x of v's rate is of degree 2 in x, v"),
        ({"parameters": {"a": True}}, "parameters.a: got True; must be a finite number"),
        ({"parameters": {3: 1.0}}, "parameters.3: got the name 3; it must be a text"),
        ({"parameters": {"a": math.inf}}, "parameters.a: got inf; must be a finite number"),
        ({"noises": {"xi": 3}}, "noises.xi: got 3; must be the name of a section"),
        ({"walls": [{"at": None, "restitution": 1.0}]}, "walls[0].at: got None; must be "),
        ({"walls": [{"at": "x = 0", "restitution": None}]}, "walls[0].restitution: got None; must be a number > 0"),
        ({"walls": [{"at": "x = 0"}]}, "walls[0]: got {'at': 'x = 0'}; must have the keys at and restitution alone"),
        ({"walls": "x = 0"}, "walls[0]: got 'x = 0'; must have the keys"),
        ({"parameters": [1.0]}, "parameters: got [1.0]; must be a mapping from names"),
    ],
)
def test_odd_arguments(changed, words):
    arguments = {"variables": ("x", "v"), "drift": ("v", "-x - xi*x"), **changed}
    with pytest.raises(TableError) as raised:
        PlaneSystem.of_equations(arguments.pop("variables"), arguments.pop("drift"), **arguments)
    assert str(raised.value).startswith(words)
