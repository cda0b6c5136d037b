"""Quantities of random oscillators of the paper: points of charts, slopes by parameters, proofs."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fpsolve import (
    ExponentSolver,
    FpsolveError,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    boundary,
    prove,
    sensitivities,
)
from fpsolve.analysis import Axis
from fpsolve.exponent import Budget
from fpsolve.model import Jump, MarkovChain, SineWiener, Telegraph, White
from fpsolve.proofs import Enclosure
from fpsolve.theory import scale_of
from tests.campaign.numbers import UNKNOWN, Known, Number, Solved, beside, between, elements
from tests.campaign.planar import of_paper
from tests.kit import matrices
from tests.oracles import certificate_checker


def fourth_order(theta: dict[str, float], key: str, value_at, step: float = 1e-4) -> float:
    """A central difference by a parameter, whose step is a share of it."""
    h = step * max(abs(theta[key]), 0.1)
    values = [value_at(theta | {key: theta[key] + k * h}) for k in (-2, -1, 1, 2)]
    return (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h)


# Slopes

STEPS = 1e-4, 5e-4, 2.5e-3, 1.25e-2
"""Of differences, in shares of a parameter."""


def problem_of(theta: dict[str, float], law: str, is_exact: bool) -> Problem:
    """A problem from parameters by their keys."""
    own = {key.partition(".")[2]: value for key, value in theta.items()}
    noise = NonGaussianNoise(**{name: own.pop(name) for name in ("D0", "tau0", "r0")})
    return Problem(VibroImpactOscillator(**own, impact=law), noise if is_exact else noise.ou_reduction())


def drawn(seed: int) -> tuple[dict[str, float], str, bool, float]:
    """Parameters, the law of impact, whether the noise is exact, and p: weak or strong noise."""
    rng = np.random.default_rng(seed)
    epsilon, restitution = between(0.05, 1.5, rng), rng.uniform(0.6, 0.95)
    theta = {
        "oscillator.omega": between(0.3, 5, rng),
        "oscillator.restitution": restitution,
        "oscillator.c1": rng.uniform(-0.4, 0.4),
        "oscillator.epsilon": epsilon,
        "noise.D0": between(0.05, 2, rng),
        "noise.tau0": between(0.05, 5, rng),
        "noise.r0": rng.uniform(-1, 1.4),
    }
    is_exact = theta["noise.r0"] < 0.98 and rng.random() < 0.7
    law = "restitution" if epsilon**2 * (1 - restitution) < 0.8 and rng.random() < 0.5 else "delta"
    return theta, law, bool(is_exact), float(rng.choice([-1, 1]) * rng.uniform(0.3, 5))


def numbers_of_sensitivities(seed: int) -> Iterator[Number]:
    """∂Λ(p)/∂θ at the default tolerance beside differences of Λ(p) at a tighter one."""
    theta, law, is_exact, p = drawn(seed)
    try:
        [found] = sensitivities(problem_of(theta, law, is_exact), p).moments
    except FpsolveError as failure:
        yield Number("slopes", Solved(*UNKNOWN, 0.0, str(failure)), UNKNOWN, "difference")
        return
    for key, estimate in found.items():
        errors = []

        def value_at(at: dict[str, float], errors: list[float] = errors) -> float:
            solution = ExponentSolver(problem_of(at, law, is_exact), rtol=1e-11).solution(p)
            errors.append(solution.pair.rounding)
            return solution.pair.value

        values = [fourth_order(theta, key, value_at, step) for step in STEPS]
        lost = 1.5 * max(errors) / (np.array(STEPS) * max(abs(theta[key]), 0.1))
        doubts = np.abs(np.diff(values)) + lost[:-1]  # of the finer of two neighbouring steps that differ least
        k = int(np.argmin(doubts))
        yield Number(key, Solved(estimate.value, estimate.error_estimate), (values[k], doubts[k]), "difference")


# Charts

TARGETS = "lyapunov_exponent = 0", "moment(2) = 0", "stability_index = -1"
RANGES = {
    "oscillator.omega": (0.3, 4.0),
    "oscillator.c1": (-0.5, 1.0),
    "oscillator.restitution": (0.5, 1.0),
    "oscillator.epsilon": (0.02, 1.5),
    "noise.D0": (0.02, 2.0),
    "noise.tau0": (0.05, 5.0),
}
POINTS = 5
"""Of a line, evenly."""


def numbers_of_charts(seed: int) -> Iterator[Number]:
    """F at points of a line λ = 0, Λ(2) = 0 or δ_p = −1 over two random parameters beside Fourier series."""
    rng = np.random.default_rng(seed)
    theta = {key: float(rng.uniform(*ends)) for key, ends in RANGES.items()} | {"noise.r0": float(rng.uniform(0.6, 1))}
    problem = problem_of(theta, "delta", bool(rng.random() < 0.5))
    axes = [Axis(str(key), *RANGES[str(key)]) for key in rng.choice(list(RANGES), 2, replace=False)]
    try:
        found = boundary(problem, TARGETS[seed % 3], *axes, nodes=4, step=0.1, budget=Budget(line_seconds=20.0))
    except FpsolveError:  # no line, as others of fpsolve's tests have
        return
    for trace in found.traces:
        for k in sorted({round(each) for each in np.linspace(0, len(trace.points) - 1, POINTS)}):
            sample = trace.points[k]
            at = problem.at({axis.key: float(axis.value(u)) for axis, u in zip(axes, sample.at, strict=True)})
            system, p = of_paper(at.system, at.noise, found.target.order)
            value, doubt = system.by_fourier(p)
            known = value / (p or 1.0), doubt / abs(p or 1.0)
            yield Number(f"F at {sample.at}", Solved(sample.value, sample.error), known, "Fourier")


# Proofs

WIDTH = 1e-8
"""Of bounds that are wanted, as a share of the scale of Λ(p)."""


def to_prove(seed: int) -> tuple[Problem, float]:
    """ε, D₀ and τ₀ log-uniform, the others uniform, all to three digits; r₀ < 1 as it stands, or reduced."""
    rng = np.random.default_rng(seed)

    def number(low: float, high: float, draw=between) -> float:
        return float(f"{draw(low, high, rng):.3g}")

    def even(low: float, high: float) -> float:
        return number(low, high, lambda *ends: rng.uniform(*ends[:2]))

    noise = NonGaussianNoise(D0=number(0.05, 1.5), tau0=number(0.1, 3), r0=even(0, 0.97))
    oscillator = VibroImpactOscillator(
        omega=even(0.3, 3),
        restitution=even(0.6, 1),
        c1=even(-0.3, 0.3),
        epsilon=number(0.02, 1),
        impact="delta" if rng.random() < 0.5 else "restitution",
    )
    p = float(rng.choice([-1, 1])) * even(0.3, 5)
    return Problem(oscillator, noise if rng.random() < 0.6 else noise.ou_reduction()), p


def system_to_prove(seed: int) -> tuple[Problem, float]:
    """An oscillator with normal changes of all coefficients and normal factors of the noise, of each kind in turn."""
    rng = np.random.default_rng(seed)
    omega, damping = rng.uniform(0.5, 2), rng.uniform(-0.1, 0.3)
    free = np.array([[0, 1], [-(omega**2), -2 * damping * omega]]) + 0.2 * rng.normal(size=(2, 2))
    driven = rng.uniform(0.1, 0.8) * rng.normal(size=(2, 2))
    jumps = [Jump(math.pi / 2, math.log(rng.uniform(0.6, 1.2)))] if rng.random() < 0.5 else []
    if jumps:
        driven[0, 1] = 0  # leaves the phase at the wall alone
    states = int(rng.integers(2, 6))
    rates = rng.uniform(0.1, 2, (states, states)) * (1 - np.eye(states))
    noise = [
        lambda: White(rng.uniform(0.2, 1), interpretation="ito" if rng.random() < 0.5 else "stratonovich"),
        lambda: Telegraph(rng.uniform(0.2, 1), rng.uniform(0.3, 3)),
        lambda: SineWiener(rng.uniform(0.2, 0.8), rng.uniform(0.5, 2)),
        lambda: OrnsteinUhlenbeck(rng.uniform(0.5, 2), rng.uniform(0.1, 0.4)),
        lambda: MarkovChain(0.5 * rng.normal(size=states), rates),
    ][seed % 5]()
    return matrices(free, driven, noise, jumps=jumps), round(rng.uniform(-3, 4), 2)


def proven(problem: Problem, p: float) -> Enclosure:
    """Bounds of Λ(p), to 1e-8 of its scale if that can be done."""
    [found] = elements(problem, [p])
    return prove(problem, p, width=WIDTH * max(abs(found.value), float(scale_of(problem).moment(p))))


def is_accepted(found: Enclosure, p: float) -> bool:
    """Whether the independent checker accepts a proof."""
    certificate = found.certificate.model_dump(mode="json") if found.certificate else {}
    return not certificate_checker.check(
        {"p": p, "lower": found.lower, "upper": found.upper, "certificate": certificate}
    )


def numbers_of_proofs(seed: int) -> Iterator[Number]:
    """Λ(p) by elements within the bounds of a proof, of every second seed of a system in the plane.

    The independent checker accepts these, or there are none.
    """
    is_system = seed % 2 == 1
    problem, p = (system_to_prove if is_system else to_prove)(seed // 2)
    bounds = proven(problem, p)
    known: Known = 0.5 * (bounds.lower + bounds.upper), 0.5 * bounds.width
    if is_system and not is_accepted(bounds, p):
        known = math.inf, 0.0
    yield from beside([p], elements(problem, [p]), [known], "proof")
