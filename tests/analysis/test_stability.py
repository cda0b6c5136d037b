"""Lines of stability of the oscillator: solved anew, in closed form, and against Eqs. (38)-(39) of weak noise."""

import math
import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    boundary,
    sensitivities,
)
from fpsolve.analysis import Axis, Boundary
from fpsolve.analysis.continuation import FRAME
from fpsolve.analysis.scan import Sample, scan_row
from fpsolve.analysis.stability import begun, crossed
from fpsolve.analysis.zero import ZeroField, zero_of
from fpsolve.budget import charge
from fpsolve.errors import FpsolveError
from fpsolve.exponent import Budget
from fpsolve.fem import generator
from fpsolve.messages import Code, Message
from fpsolve.model import MarkovChain
from tests.conftest import sampled

NOISE = NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.95)
LAMBDA, SECOND, INDEX = "lyapunov_exponent", {"moment": 2.0}, {"stability_index": -1.0}
COARSE = {"nodes": 3, "step": 0.1}
OMEGA, C1 = Axis("oscillator.omega", 0.3, 4.0), Axis("oscillator.c1", -1.2, 0.8)


def oscillator(epsilon=0.1, **values):
    return VibroImpactOscillator(**{"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": epsilon} | values)


def line(zero=LAMBDA, x=OMEGA, y=C1, *, noise=NOISE, exact=False, **values):
    """A line in a frame, by default of ω and c₁, for noise that is reduced or not."""
    known = {key: values.pop(key) for key in ("nodes", "step", "budget", "progress") if key in values}
    problem = Problem(oscillator(**values), noise if exact else noise.ou_reduction())
    return boundary(problem, zero, x, y, **(COARSE | known))


def growth(found, at, rtol=1e-11):
    """F at a point of a frame, solved anew, with its error and its scale."""
    values = {axis.key: float(axis.value(share)) for axis, share in zip((found.x, found.y), at, strict=True)}
    solver, p = ExponentSolver(found.problem.at(values), rtol=rtol), found.zero.p
    value, error = solver.ratio_alone(p)
    return value, error, solver.scale(p) / abs(p) if p else solver.scales.linear


def wanted(found, label):
    """(x, y) of the points of all branches with a label."""
    return [
        (float(branch.x[i]), float(branch.y[i]))
        for branch in found.branches
        for i, text in enumerate(branch.labels)
        if label in text.split("; ")
    ]


@pytest.mark.parametrize("zero", sampled(LAMBDA, SECOND, INDEX))
def test_f_is_zero_on_a_line(zero):
    """Also if it is solved anew and more tightly, which moves the line by less than its width."""
    found = line(zero, epsilon=0.5)
    [trace] = found.traces
    assert [trace.points[k].label for k in (0, -1)] == [FRAME, FRAME]
    for point in trace.points[::4]:
        value, error, scale = growth(found, point.sample.at)
        assert abs(value) < 1e-9 * scale
        slope = float(np.linalg.norm(point.sample.gradient))
        assert (abs(value) - error) / slope <= point.sample.width < 1e-8


@pytest.mark.parametrize(("zero", "omega"), sampled((SECOND, 3.0), (LAMBDA, 1.2), (INDEX, 3.0)))
def test_weak_noise_has_the_lines_of_the_paper(zero, omega):
    """c₁ of Λ₂(p)/p = 0, Eq. (36), is off by O(ε²)."""
    s0, s2 = NOISE.spectral_density(0.0), NOISE.spectral_density(2 * omega)
    p = zero_of(zero).p
    theory = 2 * omega * 0.2 / math.pi - s2 / 4 - p / 8 * (s2 + 2 * s0)
    x, label = replace(OMEGA, at=(omega,)), f"at oscillator.omega = {omega:g}"
    off = []
    for epsilon in (0.05, 0.1, 0.2):
        [(at, c1)] = wanted(line(zero, x, epsilon=epsilon), label)
        assert at == pytest.approx(omega, rel=1e-14)
        off.append(c1 - theory)
    orders = np.log2(np.array(off[1:]) / off[:-1])
    assert np.all(abs(orders - 2) < 0.05), orders
    assert abs(off[0]) < 1e-3 * (C1.stop - C1.start)


@pytest.mark.parametrize(
    ("omega", "epsilon", "d0", "tau0", "r0"),
    sampled(
        (1.0, 1.5, 0.4, 0.3, 1.3),
        (3.0, 1.0, 1.0, 0.2, 0.8),
        (2.0, 1.0, 2.0, 0.5, 0.0),
        keep=2,
    ),
)
@pytest.mark.parametrize("key", sampled("noise.D0", "oscillator.omega"))
def test_without_impacts_the_line_of_index_minus_two_is_exact(omega, epsilon, d0, tau0, r0, key):
    """At p = −2 the generator is the adjoint of that at p = 0 less the trace: Λ(−2) = ε²(S(0)/2 − c₁)."""
    noise = NonGaussianNoise(D0=d0, tau0=tau0, r0=r0)
    middle = d0 if key == "noise.D0" else omega
    s0 = noise.spectral_density(0.0)
    x, y = Axis(key, 0.5 * middle, 1.5 * middle), Axis("oscillator.c1", 0.2 * s0, 0.8 * s0)
    found = line({"stability_index": -2.0}, x, y, noise=noise, epsilon=epsilon, omega=omega, restitution=1.0)
    [branch] = found.branches
    expected = 0.5 * s0 * (branch.x / d0 if key == "noise.D0" else np.ones_like(branch.x))
    assert branch.y == pytest.approx(expected, rel=1e-9)
    assert branch.x[[0, -1]] == pytest.approx([0.5 * middle, 1.5 * middle])
    assert not any("fold" in label for label in branch.labels)  # though ∂F/∂ω = 0 all along


@pytest.mark.parametrize("zero", sampled(LAMBDA, INDEX))
@pytest.mark.parametrize(
    ("x", "y", "at"),
    [
        (OMEGA, C1, (0.2, 0.6)),
        (Axis("noise.D0", 0.1, 3.0, "log"), Axis("oscillator.restitution", 0.5, 1.0), (0.7, 0.3)),
        (Axis("noise.tau0", 0.1, 2.0, "log"), Axis("noise.r0", -1.0, 1.3), (0.4, 0.8)),
        (Axis("oscillator.epsilon", 0.1, 1.0, "log"), Axis("noise.tau0", 0.1, 2.0), (0.6, 0.5)),
    ],
)
@pytest.mark.parametrize("exact", [False, True])
def test_the_gradient_is_that_of_central_differences(zero, x, y, at, exact):
    at = np.array(at) if not (exact and y.key == "noise.r0") else np.array([at[0], 0.5])
    noise = NOISE if not exact else replace(NOISE, r0=0.5)
    problem = Problem(oscillator(0.6), noise if exact else noise.ou_reduction())
    of = ZeroField(zero_of(zero), problem, (x, y), Budget(), rtol=1e-11)
    sample, h = of(at), 1e-3
    for k, step in enumerate(h * np.eye(2)):
        values = [of(at + m * step).value for m in (-2, -1, 1, 2)]
        expected = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h)
        assert sample.gradient[k] == pytest.approx(expected, rel=1e-6, abs=1e-7 * sample.scale)


@pytest.fixture(scope="module")
def weak():
    return line()


def shares(found):
    return np.concatenate([trace.at for trace in found.traces])


def held(found, at):
    """Whether points, in shares of its sides, are on the branches of a line."""
    return all(any(np.linalg.norm(trace.nearest(each)[0] - each) < 1e-4 for trace in found.traces) for each in at)


def folded_by_theory(p=-6.0, restitution=0.95):
    """(ω, c₁) where c₁ of Λ₂(p) = 0, 2ω(1 − r)/π − S(2ω)(p + 2)/8 − S(0)p/4, is least; p < −2."""
    omega = np.linspace(0.3, 4.0, 200_001)
    s2 = np.array(NOISE.ou_reduction().sigma ** 2 / (NOISE.ou_reduction().alpha ** 2 + 4 * omega**2))
    c1 = 2 * omega * (1 - restitution) / math.pi - s2 * (p + 2) / 8 - NOISE.spectral_density(0.0) * p / 4
    k = int(np.argmin(c1))
    assert 0 < k < omega.size - 1
    return float(omega[k]), float(c1[k])


@pytest.mark.slow
def test_a_fold():
    """For p < −2 and r near 1 the c₁ of Λ(p) = 0 is least at an ω within: there ∂F/∂ω = 0, near that of Eq. (36)."""
    omega, c1 = folded_by_theory()
    y = Axis("oscillator.c1", c1 - 0.3, c1 + 0.5)
    off = []
    for epsilon in (0.05, 0.1):
        found = line({"moment": -6.0}, Axis("oscillator.omega", 0.3, 4.0), y, restitution=0.95, epsilon=epsilon)
        [(x_there, y_there)] = wanted(found, "fold in y")
        at = np.array([found.x.share(x_there), found.y.share(y_there)])
        sample = ZeroField(found.zero, found.problem, (found.x, found.y), Budget(), 1e-11)(at)
        assert abs(sample.value) < 1e-9 * sample.scale
        assert abs(sample.gradient[0]) < 1e-8 * abs(sample.gradient[1])
        [branch] = found.branches
        assert y_there == np.min(branch.y)
        off.append((x_there - omega, y_there - c1))
    assert np.log2(abs(off[1][1] / off[0][1])) == pytest.approx(2, abs=0.1)
    assert abs(off[0][0]) < 0.1 * omega


@pytest.mark.slow
def test_a_fold_of_strong_noise():
    """Against Eq. (38), where the c₁ of δ_p = −4 falls with τ₀, it first rises for ε = 1."""
    noise = NonGaussianNoise(D0=0.3, tau0=0.5, r0=0.9)
    x, y = Axis("noise.tau0", 0.05, 2.0, "log"), Axis("oscillator.c1", 0.6, 0.9)
    zero, values = {"stability_index": -4.0}, {"noise": noise, "omega": 0.3, "restitution": 0.9}
    found = line(zero, x, y, epsilon=1.0, **values)
    [(tau0, c1)] = wanted(found, "fold in y")
    sample = ZeroField(found.zero, found.problem, (x, y), Budget(), 1e-11)(np.array([x.share(tau0), y.share(c1)]))
    assert abs(sample.value) < 1e-9 * sample.scale
    assert abs(sample.gradient[0]) < 1e-8 * abs(sample.gradient[1])
    for beside in (0.9 * tau0, 1.1 * tau0):  # where the line is lower, so that Λ(−4) has fallen below 0
        problem = found.problem.at({"noise.tau0": beside, "oscillator.c1": c1})
        assert ExponentSolver(problem).solution(-4.0).pair.value < -1e-6
    weak = line(zero, x, y, epsilon=0.1, **values)
    assert not wanted(weak, "fold in y")
    assert len(weak.traces) == 1


def test_a_line_pickles(weak):
    again = pickle.loads(pickle.dumps(weak))
    assert isinstance(again, Boundary)
    assert np.array_equal(again.branches[0].x, weak.branches[0].x)
    assert again.branches[0].labels == weak.branches[0].labels
    at = np.array([0.3, 0.4])
    assert again.zero_field(at).value == pytest.approx(weak.zero_field(at).value, rel=1e-9)
    assert len(pickle.dumps(weak)) < 50_000


@pytest.mark.slow
def test_crossings_are_on_both_lines(weak):
    """Of two problems: those of one, Λ(p)/p = 0 for two p, never cross, as Λ is strictly convex."""
    other = line(SECOND, restitution=0.5)
    one, two = crossed([weak, other])
    [(x, y)] = wanted(one, "crossing with moment 2")
    [(other_x, other_y)] = wanted(two, "crossing with lyapunov_exponent")
    assert (x, y) == (other_x, other_y)
    at = np.array([OMEGA.share(x), C1.share(y)])
    for each in (weak, other):
        value, _, scale = growth(each, at)
        assert abs(value) < 1e-9 * scale
    s0, s2 = NOISE.spectral_density(0.0), NOISE.spectral_density(2 * x)
    assert 2 * x * 0.3 / math.pi == pytest.approx((s2 + 2 * s0) / 4, rel=0.01)  # Eq. (36)
    assert len(one.traces[0].points) == len(weak.traces[0].points) + 1
    of_one = crossed([weak, line(SECOND), line(INDEX)])
    assert not any("crossing" in label for each in of_one for branch in each.branches for label in branch.labels)


@pytest.mark.slow
def test_each_line_of_a_higher_moment_is_on_the_stable_side():
    """Λ(p)/p increases with p, so that at any ω the c₁ of δ_p = −1, λ = 0, Λ(2) = 0 fall in this order."""
    x = replace(OMEGA, at=(0.7, 2.0))
    *found, second = (line(zero, x, epsilon=0.5) for zero in (INDEX, LAMBDA, SECOND))
    for omega in x.at:
        c1 = [wanted(each, f"at oscillator.omega = {omega:g}")[0][1] for each in found]
        [(_, of_second)] = wanted(second, f"at oscillator.omega = {omega:g}") or [(0, -math.inf)]
        assert c1[0] > c1[1] > of_second


WEAK = 0.02
"""ε whose O(ε²) is below the tolerances of what the paper states."""


def density(omega, noise=NOISE):
    """S(2ω), Eqs. (12), (14) and (16) written out."""
    alpha = (5 - 3 * noise.r0) / (2 * (2 - noise.r0) * noise.tau0)
    return 2 * noise.D0 / noise.tau0**2 / (alpha**2 + 4 * omega**2)


def test_almost_sure_stability_ends_at_the_paper_s_damping():
    """Section 5: almost-sure stable if c₁ < −S(2ω)/4 + 2ω(1 − r)/π."""
    omegas = (0.5, 1.0, math.pi)
    found = line(LAMBDA, replace(OMEGA, at=omegas), epsilon=WEAK)
    for omega in omegas:
        [(_, c1)] = wanted(found, f"at oscillator.omega = {omega:.12g}")
        assert c1 == pytest.approx(-density(omega) / 4 + 2 * omega * 0.2 / math.pi, abs=1e-4)


@pytest.mark.slow
def test_almost_sure_stability_ends_at_the_paper_s_restitution():
    """Section 5: almost-sure stable if r < 1 − π(S(2ω) + 4c₁)/(8ω)."""
    y = Axis("oscillator.restitution", 0.5, 1.0)
    omegas = (1.0, 2.0, math.pi)
    found = line(LAMBDA, replace(OMEGA, at=omegas), y, epsilon=WEAK)
    for omega in omegas:
        [(_, r)] = wanted(found, f"at oscillator.omega = {omega:.12g}")
        assert r == pytest.approx(1 - math.pi * (density(omega) + 4 * 0.1) / (8 * omega), abs=1e-4)


@pytest.mark.slow
def test_almost_sure_stability_ends_at_the_paper_s_spectral_density():
    """Section 5: almost-sure stable if S(2ω) < −4c₁ + 8ω(1 − r)/π, here reached by D₀."""
    dampings = (-0.1, 0.0, 0.1)
    x, y = Axis("oscillator.c1", -0.2, 0.2, at=dampings), Axis("noise.D0", 0.1, 10.0, "log")
    found = line(LAMBDA, x, y, epsilon=WEAK, omega=1.5)
    for c1 in dampings:
        [(_, d0)] = wanted(found, f"at oscillator.c1 = {c1:g}")
        assert density(1.5, replace(NOISE, D0=d0)) == pytest.approx(-4 * c1 + 8 * 1.5 * 0.2 / math.pi, rel=1e-3)


@pytest.mark.parametrize("index", sampled(-1.0, 0.5))
def test_moment_stability_ends_at_the_paper_s_index(index):
    """Eq. (38): the moments 0 < p < δ_p are stable, so that δ_p = v is where that of p = v ceases to be."""
    omega = 2.0
    found = line({"stability_index": index}, replace(OMEGA, at=(omega,)), epsilon=WEAK)
    [(_, c1)] = wanted(found, f"at oscillator.omega = {omega:g}")
    s0 = NOISE.spectral_density(0.0)
    delta = (16 * omega / math.pi * 0.2 - 2 * density(omega) - 8 * c1) / (density(omega) + 2 * s0)
    assert delta == pytest.approx(index, abs=1e-3)


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
def test_what_the_paper_says_of_each_parameter(key, values, sign):
    """Section 5: D₀, r₀, r and c₁ take stability away; ω and τ₀ add to it: the c₁ where it ends falls, or rises."""
    found = line(x=Axis(key, *values), y=Axis("oscillator.c1", -5.0, 1.0))
    [branch] = found.branches
    order = np.argsort(branch.x)
    assert np.all(sign * np.diff(branch.y[order]) < 0)
    assert all(point.sample.gradient[1] > 0 for point in found.traces[0].points)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"start": 2.0, "stop": 1.0}, "start = 2.0, stop = 1.0; must be start < stop; exchange the two"),
        ({"start": 1.0, "stop": 1.0}, "must be start < stop"),
        (
            {"start": 0.0, "stop": 1.0, "scale": "log"},
            'start: got 0.0; must be > 0 where scale = "log"; use a positive start, or scale = "linear"',
        ),
        ({"start": 0.0, "stop": 1.0, "at": (2.0,)}, "at: got 2.0; must be from start = 0.0 to stop = 1.0; remove it"),
        ({"start": 0.0, "stop": math.inf}, "finite"),
        ({"start": math.nan, "stop": 1.0}, "finite"),
        ({"start": "0", "stop": 1.0}, "finite number"),
        ({"start": 0.0, "stop": 1.0, "scale": "cubic"}, 'must be one of "linear", "log"'),
        ({"start": 0.0, "stop": 1.0, "steps": 3}, "steps"),
    ],
)
def test_bad_axes_are_refused(change, text):
    with pytest.raises(ValueError, match=text):
        Axis("noise.D0", **change)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            {"x": Axis("oscillator.mass", 0.0, 1.0)},
            "got oscillator.mass as an axis; the parameters are oscillator.omega",
        ),
        ({"x": Axis("oscillator.c2", 0.0, 1.0)}, "got oscillator.c2 as an axis"),
        ({"x": C1}, "both axes are oscillator.c1; choose another parameter for one of them"),
        ({"x": "oscillator.omega"}, "got 'oscillator.omega' as an axis; must be an Axis"),
        (
            {"x": Axis("oscillator.omega", 0.0, 1.0)},
            "got oscillator.omega with start = 0: omega: .* greater than or equal",
        ),
        (
            {"x": Axis("oscillator.restitution", 0.5, 1.5)},
            "got oscillator.restitution with stop = 1.5: .* less than or",
        ),
        ({"zero": "lambda"}, "got 'lambda'; must be \"lyapunov_exponent\", "),
        ({"zero": {"moment": 0.0}}, "with a number != 0"),
        ({"zero": {"moment": "2"}}, "with a number != 0"),
        ({"zero": {"moment": math.inf}}, "with a number != 0"),
        ({"zero": {"moment": True}}, "with a number != 0"),
        ({"zero": {"moment": 1.0, "stability_index": 1.0}}, "with a number != 0"),
        ({"zero": 2.0}, "got 2.0; must be"),
        ({"step": 0.0}, "got step = 0; must be above 1e-05 and up to 0.1 sides of the frame"),
        ({"step": -0.1}, "got step = -0.1"),
        ({"step": 0.5}, "got step = 0.5"),
        ({"step": math.nan}, "step must be a finite number"),
        ({"nodes": 1}, "got nodes = 1; must be a whole number from 2"),
        ({"nodes": 2.5}, "got nodes = 2.5"),
    ],
)
def test_bad_lines_are_refused(change, text):
    with pytest.raises(ValueError, match=text) as caught:
        line(**change)
    assert "\n" not in str(caught.value)


def test_a_problem_without_such_parameters_is_refused():
    chain = MarkovChain(states=(-1.0, 1.0), rates=((-1.0, 1.0), (1.0, -1.0)))
    with pytest.raises(ValueError, match=r"got noise\.D0 as an axis; the parameters are oscillator\.omega, .*epsilon$"):
        boundary(Problem(oscillator(), chain), LAMBDA, OMEGA, Axis("noise.D0", 0.1, 1.0))


@pytest.mark.slow
def test_noise_of_its_own_and_chains_have_lines_too():
    gaussian = boundary(Problem(oscillator(), NOISE.ou_reduction()), LAMBDA, OMEGA, C1, **COARSE)
    assert held(gaussian, shares(line()))
    noise = OrnsteinUhlenbeck(alpha=NOISE.ou_reduction().alpha, sigma=1.2)
    x = Axis("noise.sigma", 0.1, 3.0, at=(1.0,))
    [(_, c1)] = wanted(boundary(Problem(oscillator(WEAK), noise), LAMBDA, x, C1, **COARSE), "at noise.sigma = 1")
    assert c1 == pytest.approx(2 * 0.2 / math.pi - 0.25 / (noise.alpha**2 + 4), abs=1e-4)
    chain = MarkovChain(states=(-1.0, 1.0), rates=((-1.0, 1.0), (1.0, -1.0)))  # S(ω) = 4/(4 + ω²)
    x = replace(OMEGA, at=(1.0,))
    [(_, c1)] = wanted(boundary(Problem(oscillator(WEAK), chain), LAMBDA, x, C1, **COARSE), "at oscillator.omega = 1")
    assert c1 == pytest.approx(2 * 0.2 / math.pi - 0.25 * 4 / (4 + 4), abs=1e-4)


@pytest.mark.parametrize(
    ("zero", "c1", "text"),
    [
        (SECOND, (-5.0, -4.0), "Λ(2) < 0 everywhere in the frame"),
        (SECOND, (4.0, 5.0), "Λ(2) > 0 everywhere in the frame"),
        ({"moment": -1.0}, (-5.0, -4.0), "Λ(-1) > 0 everywhere in the frame"),
        (INDEX, (-5.0, -4.0), "δ_p > -1 everywhere in the frame"),
        (LAMBDA, (4.0, 5.0), "λ > 0 everywhere in the frame"),
    ],
)
def test_a_frame_without_a_line(zero, c1, text):
    found = line(zero, y=Axis("oscillator.c1", *c1))
    assert found.traces == found.branches == ()
    assert found.remark() == text


def test_a_remark_only_speaks_of_where_f_exists():
    """For r₀ > 1 Λ(2) is infinite, and refused."""
    found = line(SECOND, Axis("noise.r0", 0.5, 1.5), Axis("oscillator.c1", -9.0, -8.0), exact=True)
    assert found.remark() == "Λ(2) < 0 wherever it exists in the frame"
    assert len(found.scan.reasons) == 1
    assert found.scan.reasons[0].startswith("Λ(2) is not computed: for r0 > 1")
    nowhere = line(SECOND, Axis("noise.r0", 1.1, 1.5), exact=True)
    assert nowhere.remark() == "Λ(2) exists nowhere in the frame"
    assert line().remark() == ""


def test_a_line_ends_where_there_is_no_problem():
    """The restitution law needs ε²(1 − r) < 1; the sentence is one line."""
    law = VibroImpactOscillator(omega=1.0, restitution=0.5, c1=0.3, epsilon=0.5, impact="restitution")
    of = ZeroField(
        zero_of(LAMBDA),
        Problem(law, NOISE.ou_reduction()),
        (Axis("oscillator.epsilon", 0.5, 3.0), Axis("oscillator.restitution", 0.1, 0.9)),
        Budget(),
    )
    with pytest.raises(FpsolveError, match=r"^no such problem: .*the restitution law needs 1 - epsilon\^2") as caught:
        of(np.array([1.0, 0.0]))
    assert "\n" not in str(caught.value)
    assert "[type=" not in str(caught.value)


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_an_axis_is_invertible(scale):
    axis = Axis("noise.D0", 0.1, 7.0, scale)
    for share in (0.0, 0.3, 1.0):
        assert axis.share(axis.value(share)) == pytest.approx(share, abs=1e-14)
        h = 1e-6
        slope = (axis.value(min(share + h, 1)) - axis.value(max(share - h, 0))) / (
            min(share + h, 1) - max(share - h, 0)
        )
        assert axis.slope(share) == pytest.approx(slope, rel=1e-5)
    assert axis.value(np.array([0.0, 1.0])).tolist() == [0.1, 7.0]
    assert axis.value(0.5) == pytest.approx(math.sqrt(0.7) if scale == "log" else 3.55)
    assert axis.share(-1.0) < 0


@pytest.mark.slow
def test_rows_are_the_same_in_other_processes():
    """Bit for bit; tasks and what they bring are small."""
    problem = Problem(oscillator(0.5), NOISE.ou_reduction())
    c1 = Axis("oscillator.c1", -1.2, 0.8)
    of = begun(zero_of(SECOND), Axis("noise.r0", 0.5, 1.2), c1, problem, nodes=4)
    here = next(of.solve()).scan
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        there = next(of.solve(pool.map(scan_row, of.rows()))).scan
    assert np.array_equal(there.values, here.values)
    assert np.array_equal(there.gradients, here.gradients)
    assert all(len(pickle.dumps(row)) < 4000 for row in of.rows())
    assert all(len(pickle.dumps(scan_row(row))) < 1000 for row in of.rows())


def test_a_row_does_not_depend_on_others():
    of = begun(zero_of(SECOND), OMEGA, C1, Problem(oscillator(), NOISE.ou_reduction()))
    rows = of.rows()
    forth, back = [scan_row(row) for row in rows[:2]], [scan_row(row) for row in rows[1::-1]]
    for one, other in zip(forth, reversed(back), strict=True):
        assert np.array_equal(one.values, other.values)
        assert np.array_equal(one.gradients, other.gradients)


def test_f_is_solved_in_one_thread(monkeypatch):
    """More only wait for each other: with two λ of strong noise took four times as long."""
    threads = []

    def factorised(*given, **named):
        threads.extend(pool["num_threads"] for pool in ThreadpoolController().info())
        return known(*given, **named)

    known = generator.factorised
    monkeypatch.setattr(generator, "factorised", factorised)
    problem = Problem(oscillator(0.5), NOISE.ou_reduction())
    with threadpool_limits(2):
        ZeroField(zero_of(LAMBDA), problem, (OMEGA, C1), Budget())(np.array([0.2, 0.6]))
        sensitivities(problem, 2.0)
    assert threads
    assert set(threads) == {1}


def test_each_row_and_each_point_is_told_as_it_is_found(monkeypatch):
    told, seen, sample = [], [], ZeroField._at
    monkeypatch.setattr(ZeroField, "_at", lambda self, *given: (seen.append(len(told)), sample(self, *given))[1])
    found = line(progress=lambda: told.append(1))
    assert found.scan.nodes.size == 3
    assert seen[:9] == [0, 0, 0, 3, 3, 3, 6, 6, 6]
    assert len(told) == 9 + sum(branch.x.size for branch in found.branches)


class Worked:
    """Solves that take some seconds of the processor, in factorisations of half a second."""

    def __init__(self, monkeypatch, cost):
        self.now, self.cost = 0.0, cost
        monkeypatch.setattr(ZeroField, "_at", lambda _, at: self.sample(at))
        monkeypatch.setattr("fpsolve.budget.time.thread_time", lambda: self.now)

    def sample(self, at):
        end = self.now + self.cost(at)
        while self.now < end:
            charge(100)
            self.now = min(self.now + 0.5, end)
        return Sample(at, at[0] + at[1] - 0.8, np.ones(2), 0.0, 1.0)


@pytest.mark.parametrize(("most", "key"), [(None, "seconds"), (78.0, "line_seconds")])
def test_the_nodes_of_a_row_share_its_time(monkeypatch, most, key):
    """Nodes that cannot be solved, here three of each row, leave time for the others: 60 s, or 78 s · ½ / 13 = 3 s."""
    work = Worked(monkeypatch, lambda at: 1e9 if 0.1 < at[1] < 0.3 else 0.02)
    of = begun(zero_of(SECOND), OMEGA, C1, Problem(oscillator(), NOISE), budget=Budget(line_seconds=most))
    share = 3.0 if most else 60.0
    for row in of.rows():
        started = work.now
        found = scan_row(row)
        assert np.isnan(found.values).tolist() == [False, False, True, True, *[False] * 9]
        assert found.reasons == (Message(Code.ROW_SPENT, most=share, key=f"budget.{key}"),)
        assert work.now - started <= share + 9 * 0.5


@pytest.mark.parametrize("cost", [0.01, 15.0, 1e9])
def test_a_line_ends_with_its_time(monkeypatch, cost):
    """What is traced is kept, and said to be not all; before, a line took any time."""
    work = Worked(monkeypatch, lambda _: 0.5)
    of = begun(zero_of(SECOND), OMEGA, C1, Problem(oscillator(), NOISE), budget=Budget(line_seconds=600.0))
    lines = of.solve()
    assert not next(lines).complete
    work.cost = lambda _: cost
    *_, whole = lines
    spent = Message(Code.LINE_SPENT, most=600.0)
    assert whole.complete == (cost == 0.01)
    assert whole.obstacles == (() if whole.complete else (spent,))
    assert work.now <= 600.5
    assert whole.seconds == pytest.approx(work.now)
    if cost == 0.01:
        assert [point.label for point in whole.traces[0].points if point.label] == [FRAME, FRAME]
    elif cost == 15.0:
        assert len(whole.traces) == 1
    else:
        assert not whole.traces
        assert whole.remark() == Message(Code.LINE_STOPPED, line="Λ(2) = 0", reason=spent)


@pytest.mark.slow
def test_real_lines_end_with_their_time():
    found = line(step=0.02, nodes=7, budget=Budget(line_seconds=0.3))
    assert not found.complete
    assert found.obstacles
    assert 0 < found.seconds < 0.6
    assert line(budget=Budget(line_seconds=60.0)).complete
