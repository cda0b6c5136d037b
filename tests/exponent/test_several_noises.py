"""Several independent noises at once: against their moments, by hand and by differences, and what is refused."""

import math

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    make_mesh,
    moment_lyapunov,
)
from fpsolve.analysis import furstenberg_khasminskii
from fpsolve.analysis.sensitivity import solve_sensitivities
from fpsolve.arrays import identity
from fpsolve.errors import MeshError
from fpsolve.exponent import Budget
from fpsolve.model import CoefficientMatrix, Jump, Noises, Poisson, SineWiener, Telegraph, White
from fpsolve.proofs.statement import statement_of
from fpsolve.theory import hierarchy_exponent, second_order
from tests.oracles.moment_hierarchy import chain, gaussian, rates_of_monomials, several_exponent, struck_rates
from tests.random_several import compared, drawn

RATES = "v", "-omega**2*x - 2*zeta*omega*v - load*x - sway*v"
NAMES = {"load": "noise.axial", "sway": "noise.lateral"}
GAUSSIAN = OrnsteinUhlenbeck(alpha=1.0, sigma=0.3)
STEADY, STIFFNESS, DAMPING = ((0.0, 1.0), (-1.0, -0.1)), ((0.0, 0.0), (-1.0, 0.0)), ((0.0, 0.0), (0.0, -1.0))


def beam(axial, lateral, **parameters):
    system = PlaneSystem.of_equations(("x", "v"), RATES, {"omega": 1.0, "zeta": 0.05, **parameters}, noises=NAMES)
    return Problem(system, {"axial": axial, "lateral": lateral})


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 6, pytest.param(7, marks=pytest.mark.slow)])
def test_random_systems_under_two_noises(seed):
    assert (found := compared(seed, 2.0, rtol=1e-6 if seed % 6 == 1 else 1e-8)).is_within, found


@pytest.mark.slow
def test_only_the_axis_that_lacks_functions_is_refined():
    """Λ(2) of the moment hierarchy for slow lateral and fast axial noise: some 24 x 8 x 30 functions."""
    problem = drawn(13)[0]
    found = ExponentSolver(problem, rtol=1e-6, budget=Budget(unknowns=8000)).solution(2.0)
    assert abs(found.pair.value - 3.1913285717) <= found.error + 1e-10
    _, axial, lateral = found.pair.space.shape
    assert lateral > 2 * axial


def test_a_slope_that_is_not_resolved_refuses_no_moment():
    """Of a node under two noises: T of p = 4 takes few functions, T* many. By moment equations and five differences."""
    steady = (-1.3960696175910667, 3.189804505143595), (0.2382010570421062, -1.506962933737433)
    first = (-0.14477046177438552, 0.5518157121082798), (-0.378513641896167, 0.7288815789732673)
    second = (-0.36957090671197107, -0.9142242725579968), (0.040173133735203655, -0.16123722803306492)
    terms = (
        CoefficientMatrix(0, steady),
        *(CoefficientMatrix(1, matrix, identity, name) for matrix, name in ((first, "a"), (second, "b"))),
    )
    noises = {
        "a": OrnsteinUhlenbeck(alpha=2.555306793986962, sigma=0.15016487721111638),
        "b": OrnsteinUhlenbeck(alpha=3.3054676187684944, sigma=0.1315417262470089),
    }
    found = moment_lyapunov(Problem(PlaneSystem(terms), noises), 4.0)
    assert abs(found.value[0] + 2.309419464523849) <= found.error_estimate[0]
    assert abs(found.derivative[0] + 0.5761729688) <= found.derivative_error[0]


def test_moments_of_two_and_four():
    """To 1e-8, with chains and with white noise in both senses beside coloured noise."""
    coloured = gaussian(STIFFNESS, 1.0, 0.3 / math.sqrt(2), 16)
    second = chain(DAMPING, (-0.2, 0.2), ((-0.7, 0.7), (0.7, -0.7)))
    for noise, law, white in (
        (Telegraph(a=0.2, k=0.7), [coloured, second], []),
        (White(s=0.2), [coloured], [(((0.0, 0.0), (0.0, -0.2)), "stratonovich")]),
        (White(s=0.2, interpretation="ito"), [coloured], [(((0.0, 0.0), (0.0, -0.2)), "ito")]),
    ):
        solver = ExponentSolver(beam(GAUSSIAN, noise))
        for p in (2, 4):
            expected = several_exponent(STEADY, law, white, p, 0.0)
            assert solver.solution(float(p)).pair.value == pytest.approx(expected, abs=1e-8)


def test_the_hierarchy_of_chains_and_white_noise():
    problem = beam(Telegraph(a=0.3, k=1.0), Telegraph(a=0.2, k=2.0))
    laws = [chain(matrix, (-a, a), ((-k, k), (k, -k))) for matrix, a, k in ((STIFFNESS, 0.3, 1.0), (DAMPING, 0.2, 2.0))]
    expected = several_exponent(STEADY, laws, [], 2, 0.0)
    assert hierarchy_exponent(problem, 2.0)[0] == pytest.approx(expected, abs=1e-13)
    assert ExponentSolver(problem).solution(2.0).pair.value == pytest.approx(expected, abs=1e-8)
    struck = beam(Poisson(rate=1.0, sizes=(-0.3, 0.3)), White(s=0.2))
    assert ExponentSolver(struck).solution(2.0).pair.value == pytest.approx(
        hierarchy_exponent(struck, 2.0)[0], abs=1e-8
    )


@pytest.mark.parametrize("sense", ["stratonovich", "ito"])
def test_white_noise_and_impulses(sense):
    """The 3 × 3 equations of the second moments, and the 5 × 5 ones of order 4."""
    impulses, white = Poisson(rate=1.3, sizes=(0.5, -0.8), weights=(2.0, 1.0)), White(s=0.4, interpretation=sense)
    solver = ExponentSolver(beam(impulses, white))
    drift = np.array(STEADY) - (0.5 * 0.16 * np.array(DAMPING) @ np.array(DAMPING) if sense == "ito" else 0.0)
    for p in (2, 4):
        moved = rates_of_monomials(0.4 * np.array(DAMPING), p)
        total = struck_rates(drift, STIFFNESS, impulses.rate, impulses.sizes, impulses.shares, p) + 0.5 * moved @ moved
        expected, found = float(np.linalg.eigvals(total).real.max()), solver.solution(float(p))
        assert abs(found.pair.value - expected) <= found.error + 1e-12
        assert found.error < 1e-7


def test_two_noises_of_one_term_are_one():
    """Two white noises add up their intensities, and a noise that drives nothing else leaves the other alone."""
    terms = [CoefficientMatrix(0, STEADY), *(CoefficientMatrix(1, STIFFNESS, identity, name) for name in "ab")]
    both = Problem(PlaneSystem(terms), {"a": White(s=0.3), "b": White(s=0.4)})
    one = Problem(PlaneSystem(terms[:2]), White(s=0.5))
    found = [ExponentSolver(problem).solution(2.0).pair.value for problem in (both, one)]
    assert found[0] == pytest.approx(found[1], abs=1e-12)
    beside = Problem(PlaneSystem(terms), {"a": GAUSSIAN, "b": SineWiener(amplitude=1e-9, sigma=1.0)})
    alone = Problem(PlaneSystem(terms[:2]), {"a": GAUSSIAN})
    assert alone.noise == GAUSSIAN
    found = [ExponentSolver(problem).solution(2.0).pair.value for problem in (beside, alone)]
    assert found[0] == pytest.approx(found[1], abs=1e-10)


def test_a_wall_beside_two_noises():
    """The law of the wall is that of one noise where the other hardly acts."""
    wall = [{"at": "x = 0", "restitution": 0.8}]
    system = PlaneSystem.of_equations(("x", "v"), RATES, {"omega": 1.0, "zeta": 0.05}, noises=NAMES, walls=wall)
    one = PlaneSystem.of_equations(
        ("x", "v"), (RATES[0], RATES[1].replace(" - sway*v", "")), {"omega": 1.0, "zeta": 0.05},
        noises={"load": "noise.axial"}, walls=wall,
    )  # fmt: skip
    expected = ExponentSolver(Problem(one, GAUSSIAN)).solution(2.0).pair.value
    for weak in (White(s=1e-6), OrnsteinUhlenbeck(alpha=1.0, sigma=1e-6), Telegraph(a=1e-6, k=1.0)):
        found = ExponentSolver(Problem(system, {"axial": GAUSSIAN, "lateral": weak})).solution(2.0)
        assert found.pair.value == pytest.approx(expected, abs=1e-8)


@pytest.mark.slow
def test_parameters_of_each_noise():
    problem = beam(GAUSSIAN, Telegraph(a=0.2, k=0.7))
    assert [*problem.values][2:] == ["noise.axial.alpha", "noise.axial.sigma", "noise.lateral.a", "noise.lateral.k"]
    solver = ExponentSolver(problem, rtol=1e-6)
    slopes = solve_sensitivities(solver, np.array([2.0]), problem.derivatives(), indices=()).moments[0]
    for key in problem.differentiable[1:]:
        h = 1e-3 * problem.values[key]
        above, below = (
            ExponentSolver(problem.at({key: problem.values[key] + side * h}), rtol=1e-8).solution(2.0).pair.value
            for side in (1, -1)
        )
        assert slopes[key].value == pytest.approx((above - below) / (2 * h), abs=1e-6)


def test_second_orders_add_up():
    """Λ − ε²Λ₂ falls like ε⁴, and Λ₂ is that of both noises less that of none."""
    rates = "v", "-x - epsilon**2*0.1*v - epsilon*load*x - epsilon*sway*v"
    rest = []
    for epsilon in (0.05, 0.1):
        system = PlaneSystem.of_equations(("x", "v"), rates, {"epsilon": epsilon}, noises=NAMES)
        problem = Problem(system, {"axial": GAUSSIAN, "lateral": White(s=0.2)})
        value = ExponentSolver(problem, rtol=1e-10).solution(2.0).pair.value
        rest.append(value - second_order(problem).moment_exponent(2.0))
    assert rest[1] / rest[0] == pytest.approx(16, rel=0.1)


def test_what_several_noises_may_be():
    with pytest.raises(ValueError, match="at most 2 noises may be other than white"):
        Noises({name: OrnsteinUhlenbeck(alpha=1.0, sigma=0.1) for name in "abc"})
    with pytest.raises(ValueError, match="algebraic tails"):
        Noises({"a": NonGaussianNoise(D0=0.1, tau0=0.5, r0=1.2), "b": GAUSSIAN})
    with pytest.raises(TypeError, match="one noise with a name"):
        Noises({"a": GAUSSIAN, "b": 0.1})
    with pytest.raises(ValueError, match="the noises given are 'axial', 'sideways'"):
        Problem(beam(GAUSSIAN, GAUSSIAN).system, {"axial": GAUSSIAN, "sideways": GAUSSIAN})
    with pytest.raises(ValueError, match="one without a name"):
        Problem(beam(GAUSSIAN, GAUSSIAN).system, GAUSSIAN)
    with pytest.raises(TypeError, match="got the noises axial and lateral at once; proofs are for one noise"):
        statement_of(beam(Telegraph(a=0.2, k=1.0), White(s=0.1)))
    solver = ExponentSolver(beam(GAUSSIAN, Telegraph(a=0.2, k=1.0)), rtol=1e-4)
    with pytest.raises(ValueError, match="the formula is for one noise"):
        furstenberg_khasminskii(solver.pair(0.0))
    with pytest.raises(MeshError, match="a mesh is for one noise"):
        ExponentSolver(solver.problem, make_mesh()).solution(2.0)
    turning = [CoefficientMatrix(1, ((0.0, 1.0), (0.0, 0.0)), identity, name) for name in "ab"]
    system = PlaneSystem([CoefficientMatrix(0, STEADY), *turning], [Jump(math.pi / 2, -0.1)])
    with pytest.raises(ValueError, match='the noise "a" moves the phase across the ray'):
        Problem(system, {"a": GAUSSIAN, "b": GAUSSIAN})
