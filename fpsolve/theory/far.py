"""Heavy tails: the place far out where noise is held at next to no cost, and what Λ(p) then means."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy.linalg

from fpsolve.arrays import finite
from fpsolve.errors import NotConverged
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem, kept
from fpsolve.theory.frozen import FURTHEST, FrozenNoise, eigenvalues_at, frozen_noise

NEAR = 4.0
"""z up to which a place is reached from 0 with ease."""
POINTS, FEWEST_POINTS, PASSES = 2000, 20, 4
"""Of finite differences, those that must hold a place, and how often they are taken anew."""
WIDEST = 100.0
"""The furthest z looked at, over that of the place."""
NEGLIGIBLE = 1e-10
"""Share of its maximum where the tilted density of a place is said to end."""
MOST_ACTION = 50.0
"""Of ψ² no more than exp(−100) is beyond."""
FAR_OUT = 1e6, 1e9
"""z at which tails are compared."""


class Place(NamedTuple):
    """Where paths that hold the noise carry a moment.

    Attributes:
        rate: about how fast they make E‖x‖^p grow.
        lower, upper: z between which they hold it.
    """

    rate: float
    lower: float
    upper: float


class Outlook(NamedTuple):
    """Where a moment may be carried besides the place nearest to ξ = 0.

    Attributes:
        places: those of algebraic tails, well off ξ = 0, see `far_places`.
        highest: the highest rate of noise that is held at a z looked at, but for rounding.
        beyond: about how fast ‖x‖^p grows on paths that hold the noise beyond all z looked at, or −∞.
    """

    places: tuple[Place, ...] = ()
    highest: float = math.inf
    beyond: float = -math.inf

    def refuse(self, p: float, reached: float) -> None:
        """Refuse a p where paths that hold the noise beyond all z looked at grow as fast as all others, or faster."""
        if self.beyond > 0 and self.beyond >= reached:
            raise NotConverged(Message(Code.HELD_BEYOND, p=p, rate=self.beyond, z=FURTHEST))


def far_places(problem: Problem, p: float) -> tuple[Place, ...]:
    """The places of the p-th moment, −1 ≤ p < 0, well off ξ = 0, for noise with algebraic tails.

    The noise (7) with r₀ > 1 can be held far out at a cost of D m(m + 1)/ξ², D = D₀/τ₀² and m = 1/(r₀ − 1). On the
    damping side, ξ < −2ω/ε, the phase rests, without impacts, and the displacement creeps in so slowly that ‖x‖^p,
    p < 0, grows at |p|ω²/(ε|ξ|). The rate of these paths is the largest eigenvalue of a hydrogen atom,

        D ψ″ − D m(m + 1)/ξ² ψ + |p|ω²/(ε|ξ|) ψ = Λ ψ,    Λ = p²ω⁴τ₀²(r₀ − 1)²/(4ε²D₀r₀²),

    at |ξ| ~ 2εD₀r₀²/(|p|ω²τ₀²(r₀ − 1)²), where that is well beyond 2ω/ε. Here it is solved with the growth rate G(ξ) of
    noise that rests instead of its tail, and paths are killed at the least favourable ξ on the way to the next place.

    *For these tails Λ(p) > 0 for every p ≠ 0.* For p > 0 and p < −1 it is infinite. For −1 ≤ p < 0 take paths that stay
    in the slab a < −ξ < Ka, a > 2ω/ε (with c₁ ≠ 0 for ξ + εc₁ instead of ξ). There y = ẋ/(ωx) obeys
    ẏ = −ω(1 + y²) − ε|ξ|y, which at y = −1 is ε|ξ| − 2ω > 0 and at y = −ω/(εKa) is at most −ωy² < 0: between the two y
    stays. So |x| falls at a rate of at least ω²/(εKa), meets no impact, and ‖x‖ is |x| to a factor √2. The noise stays
    in the slab with a probability that falls at a rate of at most C(K)D/a², as P_s is a power. The slab with these y is
    reached from everywhere with a positive probability. So Λ(p) ≥ |p|ω²/(εKa) − C(K)D/a², positive for large a. ∎

    So Λ has no second root. Where λ, the rate of almost every path, is positive, it is not Λ′(0⁻), which is then 0. And
    e^{Λt} shows up only once the rare paths count, after ln(1/P) over the difference of the rates.
    """
    return outlook(problem, p).places


def outlook(problem: Problem, p: float) -> Outlook:
    """Where to look for the largest eigenvalue besides ξ = 0: nowhere but for algebraic tails and p ≠ 0."""
    if p == 0 or not problem.has_algebraic_tails:
        return Outlook()
    return _outlook(problem, p)


@kept(64)
def _outlook(problem: Problem, p: float) -> Outlook:
    frozen = frozen_noise(problem)
    assert frozen is not None
    z, _ = frozen.peaks(p)
    places = tuple(_held(problem, p, *_well(problem, frozen, p, float(each))) for each in z[np.abs(z) > NEAR])
    return Outlook(places, (1 - 1e-6) * float(np.max(frozen.rate(p)[1:-1])), frozen.at_the_ends(p))


def grows_far_out(problem: Problem) -> bool:
    """Whether Λ(p) > 0 for all −1 ≤ p < 0, as noise with algebraic tails is held at a cost ~1/ξ², see `far_places`.

    It is so where the growth rate G(ξ) of noise that rests is negative far out, on one side, and |G|ξ² → ∞.
    """
    if not problem.has_algebraic_tails:
        return False
    z = np.array(FAR_OUT)
    for side in (-1.0, 1.0):
        growth = -eigenvalues_at(problem, side * problem.noise.standard_deviation * z)[0] * z**2
        if growth[1] > 10 * growth[0] > 0:
            return True
    return False


def heavy_tail_note(problem: Problem, exponent: float | None) -> Message | None:
    """What λ, Λ(p) and δ_p mean for noise with algebraic tails, see `far_places`."""
    is_no_slope = exponent is not None and exponent > 0
    return Message(Code.HEAVY_TAILS, is_no_slope=is_no_slope) if grows_far_out(problem) else None


def simulated_tail_note(problem: Problem) -> Message | None:
    """What a simulation cannot see."""
    return Message(Code.UNSEEN_TAILS) if grows_far_out(problem) else None


def variance_tail(problem: Problem) -> float:
    """s with which what noise beyond z adds to Λ″(0) falls like z^(−s); s ≤ 0 where Λ″(0) is infinite.

    Noise of size ξ stays so for times ~ξ², so that ln ‖x‖ takes |ξ|^(a + 2) from it where G ~ |ξ|^a: on that side, with
    P_s ~ |ξ|^(−d), s = d − 2a − 3. For the paper's oscillator a is 1 where it is fed with energy, and Λ″(0) is finite
    for r₀ < 7/5.
    """
    if not problem.has_algebraic_tails:
        return math.inf
    xi, least = problem.noise.standard_deviation * np.array(FAR_OUT), math.inf
    for side in (-1.0, 1.0):
        density = problem.noise.log_density(side * xi)
        growth = np.log(np.maximum(np.abs(eigenvalues_at(problem, side * xi)[0]), 1e-300))
        fall = float(density[0] - density[1] - 2 * (growth[1] - growth[0])) / math.log(FAR_OUT[1] / FAR_OUT[0])
        least = min(least, fall - 3)
    return least


def log_tail(problem: Problem, z: float) -> float:
    """About the logarithm of the probability that noise with algebraic tails lies beyond z: that of |ξ| P_s."""
    xi = problem.noise.standard_deviation * z
    return float(problem.noise.log_density(xi)) + math.log(abs(xi))


def _well(problem: Problem, frozen: FrozenNoise, p: float, center: float) -> tuple[float, float]:
    """z from the least favourable one on the way inwards to that on the way outwards.

    Or to where −ln ψ ~ ∫ √(2(F(center) − F))/σ dξ exceeds `MOST_ACTION`: few paths are held so far from the center.
    """
    side = math.copysign(1.0, center)
    order = np.argsort(side * frozen.z)
    z, rate = side * frozen.z[order], frozen.rate(p)[order]
    z, rate = z[z > 0], rate[z > 0]
    at = int(np.argmin(np.abs(z - abs(center))))
    inward, outward = np.diff(rate[: at + 1]) <= 0, np.diff(rate[at:]) >= 0
    first = int(np.flatnonzero(inward)[-1]) + 1 if inward.any() else 0
    last = at + int(np.argmax(outward)) if outward.any() else z.size - 1
    fall = np.sqrt(2 * np.maximum(rate[at] - rate, 0)) * problem.noise.standard_deviation / problem.noise.diffusion
    action = np.cumsum(0.5 * (fall[1:] + fall[:-1]) * np.diff(z))
    before, beyond = action[at - 1] - action[:at], action[at:] - action[at - 1]
    first = max(first, int(np.count_nonzero(before > MOST_ACTION)))
    last = min(last, at + 1 + int(np.count_nonzero(beyond <= MOST_ACTION)))
    return side * float(z[first]), side * float(min(z[last], WIDEST * abs(center)))


def _held(problem: Problem, p: float, inner: float, outer: float) -> Place:
    """The largest eigenvalue of ½σ²∂² with P_s and p G(ξ), and where it is, by finite differences even in s = ln |ξ|.

    It is that of (a ψ′)′ − (a χ′)′ψ/χ + p G ψ with a = ½σ²/ξ² and χ = √(P_s |ξ|), of which only ln χ is needed: next to
    r₀ = 1 P_s falls by thousands of orders of magnitude from point to point. There a place has a relative width
    ~√(r₀ − 1), and the points are taken again where it is until enough of them hold it.
    """
    noise, unit = problem.noise, problem.noise.standard_deviation
    for _ in range(PASSES):
        step = math.log(outer / inner) / (POINTS + 1)
        fine = inner * np.exp(0.5 * step * np.arange(2 * POINTS + 3))
        z, log = fine[::2], 0.5 * (noise.log_density(unit * fine) + np.log(np.abs(fine)))
        slope = (log[2:] - log[:-2])[1::2] / step
        bend = (log[2:] - 2 * log[1:-1] + log[:-2])[1::2] * (2 / step) ** 2
        a, beside = (0.5 * (noise.diffusion / unit / each) ** 2 for each in (z[1:-1], fine[1::2]))
        growth = p * eigenvalues_at(problem, unit * z[1:-1])[0] - a * (slope**2 - 2 * slope + bend)
        diagonal, beside = growth - (beside[:-1] + beside[1:]) / step**2, beside[1:-1] / step**2
        last = (POINTS - 1, POINTS - 1)
        value, vector = scipy.linalg.eigh_tridiagonal(finite(diagonal), finite(beside), select="i", select_range=last)
        tilted = vector[:, 0] ** 2 / np.abs(z[1:-1])
        held = np.flatnonzero(tilted > NEGLIGIBLE * np.max(tilted)) + 1
        if held.size >= FEWEST_POINTS:
            break
        inner, outer = z[max(held[0] - 2, 0)], z[min(held[-1] + 2, z.size - 1)]
    ends = z[held[[0, -1]]]
    return Place(float(value[0]), float(np.min(ends)), float(np.max(ends)))
