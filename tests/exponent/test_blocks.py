"""Systems of three and four variables that are solved by blocks: moment equations, the plane, and other coordinates."""

import math
from functools import partial

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    boundary,
    moment_lyapunov,
    sensitivities,
    stability_index,
)
from fpsolve.analysis import Axis
from fpsolve.arrays import identity
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent import Budget
from fpsolve.exponent.adapt import WholeProblem
from fpsolve.exponent.root import nonzero_root
from fpsolve.exponent.solver import tolerated
from fpsolve.messages import Code
from fpsolve.model import CoefficientMatrix, LinearSystem, ModalSystem, Telegraph, White
from fpsolve.theory import scale_of
from tests.oracles import kronecker
from tests.random_modes import by_simulation

PAIRS = (
    np.array([[0, 1, 0, 0], [-1, -0.1, 0, 0], [0, 0, 0, 1], [0, 0, -2.56, -0.16]]),
    -0.5 * np.eye(4, k=-1) * [1, 0, 1, 0],
)
"""q̈₁ + 0.1q̇₁ + q₁ + 0.5 q₁ ξ = 0 and q̈₂ + 0.16q̇₂ + 2.56q₂ + 0.5q₂ ξ = 0."""
DRIVES = np.array([[0, 1, 0], [-1, -0.3, 0], [0.5, 0, -0.4]]), np.array([[0, 0, 0], [-0.8, 0, 0], [0.3, 0, 0.5]])
DRIVEN = np.array([[-0.2, 0, 0], [0, 0, 1], [0.7, -1, -0.3]]), np.array([[0.4, 0, 0], [0, 0, 0], [0.3, -0.8, 0]])
CASCADE = (
    np.array([[0, 1, 0, 0], [-1, -0.1, 0, 0], [0, 0, 0, 1], [0.6, 0.2, -2.56, -0.16]]),
    np.array([[0, 0, 0, 0], [-0.5, 0, 0, 0], [0, 0, 0, 0], [0.4, 0, -0.8, 0]]),
)
SYSTEMS = {"pairs": PAIRS, "oscillator drives": DRIVES, "filter drives": DRIVEN, "oscillators": CASCADE}
OU = OrnsteinUhlenbeck(alpha=1.0, sigma=0.5 * math.sqrt(2))
NOISES = {"white": White(s=1.0), "ornstein-uhlenbeck": OU, "telegraph": Telegraph(a=0.7, k=0.6)}
OSCILLATOR = [[0, 1], [-1, -0.3]], [[0, 0], [-0.8, 0]]


def problem(noise, steady, driven):
    terms = (
        CoefficientMatrix(0, np.asarray(steady).tolist()),
        CoefficientMatrix(1, np.asarray(driven).tolist(), identity),
    )
    return Problem(LinearSystem(terms), noise)


def turned(noise, steady, driven):
    """The same in other coordinates, for variables of unlike units."""
    turn, _ = np.linalg.qr(np.random.default_rng(3).standard_normal(steady.shape))
    turn *= np.array([1.0, 1e3, 1.0, 1e-2])[: len(turn), None]
    return problem(noise, *(turn @ matrix @ np.linalg.inv(turn) for matrix in (steady, driven)))


def as_one(own, p, rtol):
    """The solution without looking for blocks."""
    tolerance = partial(tolerated, rtol, 0.0, scale_of(own))
    return WholeProblem(own, rtol=rtol, budget=Budget(), tolerance=tolerance).solution(p)


def by_moments(noise, steady, driven, p):
    if noise is NOISES["white"]:
        return kronecker.white(steady, driven, p)
    if noise is OU:
        return kronecker.ornstein_uhlenbeck(steady, driven, 1.0, 0.5, p, 44 // len(steady))
    return kronecker.chain(steady, driven, (-0.7, 0.7), ((0, 0.6), (0.6, 0)), p)


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("kind", NOISES)
def test_even_moments_are_those_of_moment_equations(name, kind):
    found = moment_lyapunov(problem(NOISES[kind], *SYSTEMS[name]), [2.0, 4.0], rtol=1e-8)
    expected = [by_moments(NOISES[kind], *SYSTEMS[name], p) for p in (2, 4)]
    assert len(found.classes) == 2
    assert np.all(np.abs(found.value - expected) <= found.error_estimate + 1e-11)
    assert np.all(found.error_estimate < 1e-8)


def test_uncoupled_pairs_by_blocks_and_as_two_systems():
    solver, order = ExponentSolver(problem(White(s=1.0), *PAIRS)), [0, 2, 1, 3]
    found, planes = solver.solution(1.0), []
    assert abs(found.pair.value + 0.003473874) <= found.error + 5e-10
    for at in (slice(0, 2), slice(2, 4)):
        terms = (
            CoefficientMatrix(0, PAIRS[0][at, at].tolist()),
            CoefficientMatrix(1, PAIRS[1][at, at].tolist(), identity),
        )
        planes.append(ExponentSolver(Problem(PlaneSystem(terms), White(s=1.0))))
    assert found.pair.value == pytest.approx(max(each.solution(1.0).pair.value for each in planes), abs=1e-9)
    rate = max(each.lyapunov_exponent().value for each in planes)
    assert solver.lyapunov_exponent().value == pytest.approx(rate, abs=1e-9)
    assert solver.variance_rate().value == pytest.approx(planes[0].variance_rate().value, abs=1e-8)
    permuted = (matrix[np.ix_(order, order)] for matrix in PAIRS)
    again = moment_lyapunov(problem(White(s=1.0), *permuted), 1.0, rtol=1e-8)
    assert again.value[0] == pytest.approx(found.pair.value, abs=1e-12)


@pytest.mark.parametrize("name", SYSTEMS)
def test_blocks_that_other_coordinates_hide(name):
    for noise in (White(s=1.0), OU):
        found, expected = (
            ExponentSolver(make(noise, *SYSTEMS[name])).moments([1.0, 3.0]).value for make in (turned, problem)
        )
        np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize("seed", range(6))
def test_where_there_are_none(seed):
    steady, driven = np.random.default_rng([7, seed]).standard_normal((2, 3 + seed % 2, 3 + seed % 2))
    assert not problem(OU, steady, driven).blocks
    steady[1:, 0] = driven[1:, 0] = 0.0
    assert len(turned(OU, steady, driven).blocks) == 2
    steady[1:, 0] = 1e-6
    assert not turned(OU, steady, driven).blocks


@pytest.mark.slow
@pytest.mark.parametrize(("name", "p", "rtol"), [("oscillator drives", 1.0, 1e-4), ("oscillator drives", 3.0, 1e-4)])
def test_blocks_as_one_system(name, p, rtol):
    """By the sphere of directions: a second method."""
    own = problem(White(s=1.0), *SYSTEMS[name])
    found = as_one(own, p, rtol)
    assert abs(found.pair.value - ExponentSolver(own).solution(p).pair.value) <= found.error < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-2, 1e-3])
def test_a_driven_block_as_one_system_states_a_true_error(rtol):
    """T* is not smooth where a decaying part drives the fastest block: degrees of waves help as a power only."""
    own = problem(White(s=1.0), *SYSTEMS["filter drives"])
    expected = ExponentSolver(own).solution(1.0).pair.value
    try:
        found = as_one(own, 1.0, rtol)
    except NotConverged as failure:
        found = failure.partial
    assert abs(found.pair.value - expected) <= found.error


@pytest.mark.slow
def test_blocks_against_a_simulation():
    """λ and Λ(1) where one block decays much sooner than the other, so that paths forget it."""
    steady, driven = (matrix.copy() for matrix in CASCADE)
    steady[3, 3] = -1.2
    whole = problem(White(s=1.0), steady, driven)
    solver, made = ExponentSolver(whole), by_simulation(whole, path_steps=5e6)
    rate = solver.lyapunov_exponent().value
    assert abs(made.lyapunov_exponent - rate) < 4 * made.lyapunov_exponent_error
    found = next(each for each in made.estimates if each.p == 1.0)
    assert abs(found.value - solver.solution(1.0).pair.value) < 4 * found.standard_error


def test_the_largest_class_changes_with_p():
    """λ and Λ(p) for small p are those of ż = −0.05z, and for larger p those of an oscillator, for a kink between."""
    plane = ExponentSolver(problem(White(s=1.0), *OSCILLATOR))
    steady, driven = np.diag([0.0, 0.0, -0.05]), np.zeros((3, 3))
    steady[:2, :2], driven[:2, :2], steady[2, 0] = *OSCILLATOR, 1.0
    solver = ExponentSolver(problem(White(s=1.0), steady, driven))
    found = solver.moments([0.0, 0.25, 1.0, 2.0])
    expected = [0.0, -0.05 * 0.25, *(plane.solution(p).pair.value for p in (1.0, 2.0))]
    np.testing.assert_allclose(found.value, expected, atol=1e-9)
    np.testing.assert_allclose(found.derivative[:2], -0.05, atol=1e-9)
    assert solver.lyapunov_exponent().value == pytest.approx(-0.05, abs=1e-9)
    assert solver.variance_rate().value == pytest.approx(0.0, abs=1e-9)
    index = stability_index(solver.problem)
    assert index.value == pytest.approx(stability_index(plane.problem).value, rel=1e-7)


@pytest.mark.parametrize("name", SYSTEMS)
def test_negative_moments_are_refused_alone(name):
    """One sentence for all p < 0; the other p, and each block by itself stay."""
    solver = ExponentSolver(problem(White(s=1.0), *SYSTEMS[name]))
    with pytest.raises(NotConverged, match=r"for p < 0 is not computed: .* choose p >= 0, or solve each") as failure:
        moment_lyapunov(solver.problem, [-1.0, -1e-6, 0.5, 2.0])
    assert str(failure.value).count("\n") == 0
    assert failure.value.partial.p.tolist() == [0.5, 2.0]
    assert {each.reason.code for each in solver.moments([-1.0, 0.5]).failures} == {Code.NEGATIVE_OF_SEVERAL}
    for refused in (solver.ratio, solver.leading):
        with pytest.raises(NotConverged, match="for p < 0 is not computed"):
            refused(-0.5)
    assert [each.value.size for each in solver.by_class([-1.0, 2.0])] == [2, 2]


def test_a_moment_takes_no_other_solve():
    """What a message would advise needs no λ."""
    solver = ExponentSolver(problem(White(s=1.0), *PAIRS))
    assert solver.moments([2.0]).value.size == 1
    assert [[*each.whole.known] for each in solver.classes] == [[2.0], [2.0]]


def test_a_negative_index_is_absent():
    """λ > 0: δ_p is below 0, and is not looked for; λ is that of the faster block."""
    solver = ExponentSolver(problem(White(s=2.0), *PAIRS))
    assert solver.lyapunov_exponent().value > 0
    index = nonzero_root(solver)
    assert not index
    assert index.reason.code is Code.NEGATIVE_OF_SEVERAL


def of_equations(**changed):
    """A filter y drives an oscillator, which drives z; kappa would let z drive y."""
    values = {"a": 0.5, "zeta": 0.1, "b": 1.0, "kappa": 0.0, "c": 0.5} | changed
    rates = "-a*y - 0.3*xi*y + kappa*z", "v", "-x - 2*zeta*v - xi*x + c*y", "-b*z + x"
    return PlaneSystem.of_equations(("y", "x", "v", "z"), rates, values)


@pytest.mark.slow
def test_sensitivities_are_those_of_the_largest_block():
    whole = Problem(of_equations(), White(s=0.6))
    found, step = sensitivities(whole, [1.0, 2.5], rtol=1e-9), 1e-4
    assert [str(note) for note in found.notes if "system.kappa" in note and "any other value" in note]
    assert set(found.theta) == {"system.a", "system.zeta", "system.b", "system.c", "noise.s"}
    for key, value in found.theta.items():
        sides = [ExponentSolver(whole.at({key: value + side}), rtol=1e-10) for side in (-step, step)]
        for p, slopes in zip(found.p, found.moments, strict=True):
            low, high = (each.solution(float(p)).pair.value for each in sides)
            assert slopes[key].value == pytest.approx((high - low) / (2 * step), abs=1e-6)
        low, high = (each.lyapunov_exponent().value for each in sides)
        assert found.indices["lyapunov_exponent"][key].value == pytest.approx((high - low) / (2 * step), abs=1e-6)


def test_sensitivities_to_what_turns_the_modes():
    """Modes of K = ((1, k), (k, 2)) with noise in all stiffness alike do not couple, but change with k."""
    unit, matrix = [[1.0, 0.0], [0.0, 1.0]], [[1.0, "k"], ["k", 2.0]]
    system = ModalSystem.of(unit, matrix, [[0.2, 0.0], [0.0, 0.2]], stiffness_noise=matrix, parameters={"k": 0.4})
    whole, step = Problem(system, White(s=0.6)), 1e-4
    found = sensitivities(whole, 1.0, rtol=1e-9)
    sides = [moment_lyapunov(whole.at({"system.k": 0.4 + side}), 1.0, rtol=1e-10).value[0] for side in (-step, step)]
    assert found.moments[0]["system.k"].value == pytest.approx((sides[1] - sides[0]) / (2 * step), abs=1e-6)
    assert abs(found.moments[0]["system.k"].value) > 0.01


def test_two_blocks_that_are_alike_have_no_derivatives():
    rates = "v", "-x - 2*zeta*v - xi*x", "w", "-y - 2*zeta*w - xi*y"
    system = PlaneSystem.of_equations(("x", "v", "y", "w"), rates, {"zeta": 0.1})
    solver = ExponentSolver(Problem(system, White(s=0.6)))
    with pytest.raises(NoSuchExponent, match=r"Λ″\(p\) jumps"):
        solver.variance_rate()
    found = sensitivities(solver.problem, 1.0)
    assert not found.moments[0]
    assert not found.indices.get("lyapunov_exponent")
    assert [note for note in found.notes if "either may be the larger one" in note]


@pytest.mark.slow
def test_a_line_of_a_chart():
    """Λ(2) = 0 by the moment equations."""
    line = boundary(
        Problem(of_equations(), White(s=0.6)),
        {"moment": 2.0},
        Axis("system.zeta", 0.05, 0.2),
        Axis("noise.s", 0.3, 0.8),
        nodes=3,
    )
    [branch] = line.branches
    for k in range(0, branch.x.size, 5):
        steady, driven = (
            np.array(next(t.matrix for t in of_equations(zeta=branch.x[k]).terms if (t.g is identity) is is_driven))
            for is_driven in (False, True)
        )
        assert kronecker.white(steady, branch.y[k] * driven, 2) == pytest.approx(0.0, abs=1e-9)


def test_there_is_no_common_eigenfunction():
    solver = ExponentSolver(problem(White(s=1.0), *PAIRS))
    with pytest.raises(NotConverged, match="do not all drive each other"):
        solver.pair(1.0)
    names = [each.name for each in solver.by_class([1.0])]
    assert names == ["x₁, x₂", "x₃, x₄"]
