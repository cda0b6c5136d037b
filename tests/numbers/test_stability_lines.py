"""Lines λ = 0, Λ(p) = 0 and δ_p = v: closed forms, solved anew, and Eqs. (36)-(39) of the paper."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from fpsolve import ExponentSolver, NonGaussianNoise, Problem, VibroImpactOscillator, boundary
from fpsolve.analysis import Axis, Boundary
from fpsolve.exponent import Budget
from fpsolve.model import MarkovChain, White
from tests.conftest import sampled
from tests.kit import rates

NOISE = NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.95)
REDUCED = NOISE.ou_reduction()
LAMBDA, SECOND, INDEX = "lyapunov_exponent = 0", "moment(2) = 0", "stability_index = -1"
OMEGA, C1 = Axis("oscillator.omega", 0.3, 4.0), Axis("oscillator.c1", -1.2, 0.8)
WEAK = 0.02
"""ε whose O(ε²) is below the tolerances of what the paper states."""


def oscillator(epsilon=0.1, noise=REDUCED, **values):
    return Problem(
        VibroImpactOscillator(**{"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": epsilon} | values), noise
    )


def line(target=LAMBDA, x=OMEGA, y=C1, noise=REDUCED, **more):
    """A line in a frame, by default of ω and c₁, on a coarse grid."""
    known = {key: more.pop(key) for key in ("nodes", "step", "budget", "progress") if key in more}
    return boundary(oscillator(noise=noise, **more), target, x, y, **{"nodes": 3, "step": 0.1, **known})


P_OF = {LAMBDA: 0.0, SECOND: 2.0, INDEX: -1.0, "stability_index = 0.5": 0.5}


def at_place(found, at, rtol=1e-11):
    """λ, Λ(p), or Λ(p)/p for an index, at shares of the sides of a frame, solved anew, with its error and its scale."""
    values = {axis.key: float(axis.value(share)) for axis, share in zip((found.x, found.y), at, strict=True)}
    solver, p = ExponentSolver(found.problem.at(values), rtol=rtol), found.target.order
    (value, error), factor = solver.method.ratio_alone(p), p if found.target.kind == "moment" else 1.0
    scale = solver.method.scale(p) / abs(p) if p else solver.method.scales.linear
    return factor * value, abs(factor) * error, abs(factor) * scale


def wanted(found, label):
    """(x, y) of the points of all branches with a label."""
    return [
        (float(branch.x[i]), float(branch.y[i]))
        for branch in found.branches
        for i, text in enumerate(branch.labels)
        if label in text.split("; ")
    ]


@pytest.mark.slow
def test_line_of_second_moments_of_a_spring_in_white_noise_is_a_parabola():
    """ẍ + 2bẋ + (1 + sξ)x = 0: Λ(2) = 0 at s² = 4b, and on the stable side at b = 0.8 all is stable."""
    problem = rates("x' = v; v' = -x - 2*b*v - xi*x", White(s=0.5), b=0.1)
    told = []
    found = boundary(
        problem,
        SECOND,
        Axis("noise.s", 0.2, 1.2, at=(1.0,)),
        Axis("system.b", 0.001, 0.5),
        progress=lambda: told.append(1),
    )
    [branch] = found.branches
    np.testing.assert_allclose(4 * branch.y, branch.x**2, atol=1e-7)
    assert wanted(found, "at noise.s = 1") == [(1.0, pytest.approx(0.25, abs=1e-8))]
    assert branch.x[[0, -1]].tolist() in ([0.2, 1.2], [1.2, 0.2])
    assert len(told) == found.scan.nodes.size**2 + branch.x.size - 1  # that at s = 1 is no step
    data = found.to_xarray()
    assert data.line.values.tolist() == [SECOND] * branch.x.size
    assert data.y.values.tolist() == branch.y.tolist()
    again = pickle.loads(pickle.dumps(found))
    assert isinstance(again, Boundary)
    assert np.array_equal(again.branches[0].x, branch.x)


FRAMES = (
    (OMEGA, C1),
    (Axis("noise.D0", 0.1, 3.0, "log"), Axis("oscillator.restitution", 0.5, 1.0)),
    (Axis("noise.tau0", 0.1, 2.0, "log"), Axis("noise.r0", -1.0, 0.98)),
    (Axis("oscillator.epsilon", 0.1, 1.0, "log"), Axis("oscillator.c1", -1.2, 0.8)),
)


@pytest.mark.parametrize(
    ("frame", "target", "noise"),
    sampled(
        (0, SECOND, REDUCED),
        (1, LAMBDA, NOISE),
        (0, LAMBDA, REDUCED),
        (0, INDEX, NOISE),
        (1, INDEX, REDUCED),
        (2, LAMBDA, NOISE),
        (3, INDEX, NOISE),
        (3, LAMBDA, REDUCED),
        keep=2,
    ),
)
def test_solves_on_a_line_give_zero_and_its_gradient(frame, target, noise):
    """Solved anew and more tightly, which moves the line by less than its width; gradients by differences."""
    damping = {0: {}, 1: {}, 2: {"c1": -0.05, "restitution": 0.95}, 3: {}}[frame]
    found = line(target, *FRAMES[frame], noise=noise, **{"epsilon": 0.5, **damping})
    [trace] = found.traces
    assert [trace.points[k].label for k in (0, -1)] == ["leaves the frame"] * 2
    for point in trace.points[1:-1:4]:
        value, error, scale = at_place(found, point.at)
        assert abs(value) < 1e-9 * scale
        slope = float(np.linalg.norm(point.gradient))
        assert (abs(value) - error) / slope <= point.width < 1e-8
    point = trace.points[len(trace.points) // 2]
    for k, step in enumerate(1e-3 * np.eye(2)):
        values = [at_place(found, point.at + m * step)[0] for m in (-2, -1, 1, 2)]
        expected = np.dot([1, -8, 8, -1], values) / 12e-3
        assert point.gradient[k] == pytest.approx(expected, rel=1e-6, abs=1e-7 * point.scale)


@pytest.mark.parametrize(
    ("target", "omega"),
    sampled((SECOND, 3.0), (LAMBDA, 1.2), (INDEX, 3.0), ("stability_index = 0.5", 2.0), keep=0),
)
def test_lines_in_weak_noise_approach_those_of_the_paper_with_the_square_of_epsilon(target, omega):
    """c₁ of Λ₂(p)/p = 0, Eq. (36)."""
    theory, off = by_paper(P_OF[target], omega, 0.8), []
    for epsilon in (0.05, 0.1, 0.2):
        [(at, c1)] = wanted(
            line(target, replace(OMEGA, at=(omega,)), epsilon=epsilon), f"at oscillator.omega = {omega:g}"
        )
        assert at == pytest.approx(omega, rel=1e-14)
        off.append(c1 - theory)
    assert np.log2(np.array(off[1:]) / off[:-1]) == pytest.approx(2, abs=0.05)
    assert abs(off[0]) < 2e-3


def density(omega):
    """S(2ω), Eqs. (12), (14) and (16) written out."""
    alpha = (5 - 3 * NOISE.r0) / (2 * (2 - NOISE.r0) * NOISE.tau0)
    return 2 * NOISE.D0 / NOISE.tau0**2 / (alpha**2 + 4 * omega**2)


def by_paper(p, omega, restitution):
    """c₁ of Λ₂(p)/p = 0, Eq. (36); almost-sure stability is that of p = 0, Section 5."""
    s2, s0 = density(omega), density(0.0)
    return 2 * omega * (1 - restitution) / math.pi - s2 / 4 - p / 8 * (s2 + 2 * s0)


def test_line_of_almost_sure_stability_has_the_damping_of_the_paper():
    """c₁ = −S(2ω)/4 + 2ω(1 − r)/π."""
    omegas = 0.5, 1.0, math.pi
    found = line(x=replace(OMEGA, at=omegas), epsilon=WEAK)
    for omega in omegas:
        [(_, c1)] = wanted(found, f"at oscillator.omega = {omega:.12g}")
        assert c1 == pytest.approx(by_paper(0.0, omega, 0.8), abs=1.5e-4)


@pytest.mark.slow
def test_line_of_a_chain_has_its_spectral_density():
    chain = MarkovChain(states=(-1.0, 1.0), rates=((-1.0, 1.0), (1.0, -1.0)))
    [(_, c1)] = wanted(line(x=replace(OMEGA, at=(1.0,)), noise=chain, epsilon=WEAK), "at oscillator.omega = 1")
    assert c1 == pytest.approx(0.4 / math.pi - 4 / (4 + 4) / 4, abs=1.5e-4)


@pytest.mark.parametrize(
    ("omega", "epsilon", "d0", "tau0", "r0", "key"),
    sampled(
        (1.0, 1.5, 0.4, 0.3, 1.3, "noise.D0"),
        (3.0, 1.0, 1.0, 0.2, 0.8, "noise.D0"),
        (3.0, 1.0, 1.0, 0.2, 0.8, "oscillator.omega"),
        (2.0, 1.0, 2.0, 0.5, 0.0, "noise.D0"),
        keep=2,
    ),
)
def test_line_of_index_minus_two_without_impacts_is_exact(omega, epsilon, d0, tau0, r0, key):
    """At p = −2 the generator is the adjoint of that at p = 0 less the trace: Λ(−2) = ε²(S(0)/2 − c₁)."""
    noise = NonGaussianNoise(D0=d0, tau0=tau0, r0=r0)
    middle, s0 = d0 if key == "noise.D0" else omega, noise.spectral_density(0.0)
    x, y = Axis(key, 0.5 * middle, 1.5 * middle), Axis("oscillator.c1", 0.2 * s0, 0.8 * s0)
    [branch] = line(
        "stability_index = -2", x, y, noise.ou_reduction(), epsilon=epsilon, omega=omega, restitution=1.0
    ).branches
    expected = 0.5 * s0 * (branch.x / d0 if key == "noise.D0" else np.ones_like(branch.x))
    assert branch.y == pytest.approx(expected, rel=1e-9)
    assert sorted(branch.x[[0, -1]]) == pytest.approx([0.5 * middle, 1.5 * middle])
    assert not any("fold" in label for label in branch.labels)  # though ∂F/∂ω = 0 all along


@pytest.mark.slow
def test_fold_of_a_line_is_that_of_the_paper_in_weak_noise():
    """For p < −2 and r near 1 the c₁ of Λ(p) = 0 is least at an ω within: there ∂F/∂ω = 0."""
    omegas = np.linspace(0.3, 4.0, 20_001)
    c1s, off = by_paper(-6.0, omegas, 0.95), []
    c1 = c1s.min()
    for epsilon in (0.05, 0.1):
        y = Axis("oscillator.c1", c1 - 0.3, c1 + 0.5)
        found = line("moment(-6) = 0", OMEGA, y, restitution=0.95, epsilon=epsilon)
        [(x_there, y_there)] = wanted(found, "fold in y")
        at = np.array([found.x.share(x_there), found.y.share(y_there)])
        value, _, scale = at_place(found, at)
        beside = [at_place(found, at + np.array([side, 0]))[0] for side in (-1e-3, 1e-3)]
        assert abs(value) < 1e-9 * scale
        assert abs(beside[1] - beside[0]) < 1e-2 * (abs(beside[0]) + abs(beside[1]))
        assert y_there == np.min(found.branches[0].y)
        off.append(y_there - c1)
    assert np.log2(abs(off[1] / off[0])) == pytest.approx(2, abs=0.1)
    assert abs(x_there - omegas[np.argmin(c1s)]) < 0.1 * x_there


@pytest.mark.parametrize(
    ("key", "values", "sign"),
    sampled(
        ("oscillator.restitution", (0.6, 1.0), 1),
        ("noise.tau0", (0.2, 2.0), -1),
        ("noise.D0", (0.3, 3.0), 1),
        ("noise.r0", (0.5, 1.2), 1),
        ("oscillator.omega", (0.5, 3.0), -1),
        keep=2,
    ),
)
def test_trends_of_stability_are_those_of_the_paper(key, values, sign):
    """Section 5: D₀, r₀, r and c₁ take stability away; ω and τ₀ add to it: the c₁ where it ends falls, or rises."""
    found = line(x=Axis(key, *values), y=Axis("oscillator.c1", -5.0, 1.0))
    [branch] = found.branches
    assert np.all(sign * np.diff(branch.y[np.argsort(branch.x)]) < 0)
    assert all(point.gradient[1] > 0 for point in found.traces[0].points)


@pytest.mark.parametrize(
    ("target", "x", "c1", "noise", "text"),
    [
        (SECOND, OMEGA, (-5.0, -4.0), REDUCED, "Λ(2) < 0 everywhere in the frame"),
        (SECOND, OMEGA, (4.0, 5.0), REDUCED, "Λ(2) > 0 everywhere in the frame"),
        ("moment(-1) = 0", OMEGA, (-5.0, -4.0), REDUCED, "Λ(-1) > 0 everywhere in the frame"),
        (INDEX, OMEGA, (-5.0, -4.0), REDUCED, "δ_p > -1 everywhere in the frame"),
        (LAMBDA, OMEGA, (4.0, 5.0), REDUCED, "λ > 0 everywhere in the frame"),
        (SECOND, Axis("noise.r0", 0.5, 1.5), (-9.0, -8.0), NOISE, "Λ(2) < 0 wherever it exists in the frame"),
        (SECOND, Axis("noise.r0", 1.1, 1.5), (-1.2, 0.8), NOISE, "Λ(2) exists nowhere in the frame"),
        (LAMBDA, OMEGA, (-1.2, 0.8), REDUCED, ""),
    ],
)
def test_a_frame_without_a_line_says_on_which_side_it_is(target, x, c1, noise, text):
    found = line(target, x, Axis("oscillator.c1", *c1), noise)
    assert bool(found.branches) == (text == "")
    assert found.remark() == text
    if "exist" in text:
        assert [each.startswith("Λ(2) is not computed: for r0 > 1") for each in found.scan.reasons] == [True]


def test_a_line_ends_where_there_is_no_problem():
    """The restitution law needs ε²(1 − r) < 1."""
    x, y = Axis("oscillator.epsilon", 0.5, 1.2), Axis("oscillator.restitution", 0.1, 0.9)
    [reason] = line(LAMBDA, x, y, impact="restitution", c1=3.0, nodes=2).scan.reasons
    assert reason.startswith("no such problem: ")
    assert "the restitution law needs 1 - epsilon^2" in reason
    assert "[type=" not in reason


@pytest.mark.slow
def test_a_line_ends_with_its_time():
    found = line(step=0.02, nodes=7, budget=Budget(line_seconds=0.3))
    assert not found.complete
    assert found.obstacles
    assert 0 < found.seconds < 0.6
    assert line(budget=Budget(line_seconds=60.0)).complete
