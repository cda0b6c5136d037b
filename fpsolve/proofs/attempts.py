"""Bounds on Λ(p) and λ that hold with certainty: trial functions are enlarged until the bounds are close enough."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from fpsolve.proofs.balls import ball, in_balls
from fpsolve.proofs.basis import Basis, Core, Whole
from fpsolve.proofs.bounds import Trial
from fpsolve.proofs.certificate import BasisRecord, Certificate, SideRecord
from fpsolve.proofs.enclosure import NOTHING, Enclosure, enclosure_of
from fpsolve.proofs.galerkin import Galerkin, Pair
from fpsolve.proofs.search import Found, search
from fpsolve.proofs.statement import Cylinder, Parameters, cylinder
from fpsolve.proofs.verify import objection

GROWTH = 1.35
MOST_UNKNOWNS, ABSENT = 25_000, 1e9
PATIENCE, PROGRESS, FAR = {False: 2, True: 6}, 0.7, 1e-2
"""Enlargements that do not bring the bounds closer by this factor, after which no more are tried; more of them where
the bounds are farther apart than this share of the number."""
WHOLE_BELOW = 6.0
"""End exponents a below which the ends of the support carry too much weight to be cut off."""


@dataclass(frozen=True)
class Size:
    """Modes −waves … waves and polynomials below degrees."""

    waves: int
    degrees: int

    @property
    def unknowns(self) -> int:
        """Of the eigenproblem."""
        return (2 * self.waves + 1) * self.degrees

    def larger(self, edges: tuple[float, float]) -> Size:
        """More of what is not yet small, by the coefficients of the highest mode and of the highest degree."""
        sizes = zip((self.waves, self.degrees), edges, strict=True)
        return Size(*(math.ceil(GROWTH * n) + 1 if edge > 0.1 * max(edges) else n for n, edge in sizes))


SMALLEST = Size(5, 9)


@dataclass(frozen=True)
class Attempt:
    """Bounds, and the size of the trial that gave them."""

    enclosure: Enclosure
    size: Size

    @property
    def delta(self) -> float:
        """How far the bounds are apart."""
        certificate = self.enclosure.certificate
        return math.inf if certificate is None else apart(certificate)


@in_balls
def enclose(stated: Parameters, p: str | None, width: float, guess: float = 0.0) -> Enclosure:
    """Bounds on Λ(p), or on λ where p is None, that are at most `width` apart, if that can be done.

    Args:
        stated: parameters as decimals.
        p: the moment as a decimal.
        guess: Λ(p), about.

    Returns:
        The closest bounds that were found.

    Raises:
        NoSuchExponent: the noise has algebraic tails, r₀ > 1.
    """
    noise, best = cylinder(stated), Attempt(NOTHING, SMALLEST)
    for basis in bases(noise, p):
        for found in _enlarged(stated, noise, basis, p, guess, best.size):
            best = found if found.delta < best.delta else best
            if best.enclosure.width <= width:
                return best.enclosure
    return best.enclosure


def _enlarged(
    stated: Parameters, noise: Cylinder, basis: Basis, p: str | None, guess: float, size: Size
) -> Iterator[Attempt]:
    """Bounds by larger and larger trials, as long as they come closer."""
    delta, idle, value = math.inf, 0, math.inf
    while idle < PATIENCE[delta > FAR * abs(value)] and size.unknowns <= MOST_UNKNOWNS:
        try:
            pair, basis = _solved(noise, basis, p, guess, size)
        except ArithmeticError:
            return
        value = pair.value
        certificate = _certificate(stated, noise, basis, p, pair)
        if certificate is not None and not objection(certificate):
            idle = 0 if apart(certificate) < PROGRESS * delta else idle + 1
            delta = min(delta, apart(certificate))
            yield Attempt(enclosure_of(certificate), size)
        elif delta < math.inf:
            idle += 1
        size = size.larger(pair.edges)


def bases(noise: Cylinder, p: str | None) -> Iterator[Basis]:
    """What is worth trying, in this order: the whole support, or a core about where the noise is in the moment."""
    slope = float(noise.slope)
    if noise.is_bounded and slope < WHOLE_BELOW:
        yield Whole()
        return
    driven = 2 * float(noise.q[1].mean)
    gauge = 0.0 if p is None else float(p) * driven / (2 * float(noise.nu) * slope)  # by perturbation theory
    yield _core(noise, _balance(noise, gauge))
    if noise.is_bounded and slope < 2 * WHOLE_BELOW:
        yield Whole()


def _balance(noise: Cylinder, gauge: float) -> float:
    """z with b(z) = β."""
    slope = float(noise.slope)
    if not noise.is_bounded:
        return gauge / slope
    return 2 * gauge / (slope + math.hypot(slope, 2 * gauge))


def _core(noise: Cylinder, centre: float) -> Core:
    """Polynomials about a centre, with the gauge that puts their weight there; none for λ, at 0."""
    slope = float(noise.slope)
    if not noise.is_bounded:
        return Core(centre, 1.0, slope * centre)
    return Core(centre, 1 / math.sqrt(2 * slope + 3), slope * centre / (1 - centre**2))


def _solved(noise: Cylinder, basis: Basis, p: str | None, guess: float, size: Size) -> tuple[Pair, Basis]:
    """A trial, about the place where the noise is in the moment."""
    if p is None:
        return Galerkin(noise, basis, None, size.waves, size.degrees).drift(), basis
    pair = Galerkin(noise, basis, float(p), size.waves, size.degrees).pair(guess)
    if isinstance(basis, Core) and 0.3 * basis.scale < abs(pair.centre - basis.centre) < 3 * basis.scale:
        basis = _core(noise, pair.centre)
        pair = Galerkin(noise, basis, float(p), size.waves, size.degrees).pair(guess)
    return pair, basis


def _certificate(stated: Parameters, noise: Cylinder, basis: Basis, p: str | None, pair: Pair) -> Certificate | None:
    """The closest bounds that a trial gives, before they are verified."""
    if not math.isfinite(pair.value):
        return None
    trial = Trial(noise, None if p is None else ball(p), pair.value, basis, pair.cosine, pair.sine)
    phases = max(128, 16 * len(pair.cosine))
    upper, lower = map(_record, search(trial, phases))
    if upper is None and lower is None:
        return None
    return Certificate(
        quantity="lyapunov_exponent" if p is None else "moment",
        p=p,
        parameters=dict(stated),
        mu=pair.value,
        basis=BasisRecord.of(basis),
        cosine=pair.cosine.tolist(),
        sine=pair.sine.tolist(),
        upper=upper,
        lower=lower,
        phases=phases,
    )


def _record(found: Found | None) -> SideRecord | None:
    """A bound as it stands in a certificate."""
    if found is None:
        return None
    tails = None if found.tails is None else [float(each) for each in found.tails]
    return SideRecord(delta=found.delta, nodes=found.nodes.tolist(), values=found.values.tolist(), tails=tails)


def apart(certificate: Certificate) -> float:
    """How far the bounds of a certificate are apart; one that is missing counts as far away."""
    return sum(ABSENT if side is None else side.delta for side in (certificate.upper, certificate.lower))
