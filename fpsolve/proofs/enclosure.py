"""Bounds as results."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from fpsolve.proofs.balls import ball, in_balls
from fpsolve.proofs.certificate import BasisRecord, Certificate
from fpsolve.proofs.statement import Parameters


@dataclass(frozen=True)
class Enclosure:
    """What is proven of a number: lower ≤ it ≤ upper.

    The bounds hold for the floats, and for the decimals that they are printed as.

    Attributes:
        certificate: from which they follow; None where nothing is proven and the bounds are infinite.
        wanted: how far they may be apart.
    """

    lower: float
    upper: float
    certificate: Certificate | None = None
    wanted: float = math.inf

    @property
    def width(self) -> float:
        """upper − lower, rounded up."""
        return math.nextafter(self.upper - self.lower, math.inf) if self.upper > self.lower else 0.0

    @property
    def is_met(self) -> bool:
        """Whether the bounds are as close as they are wanted."""
        return self.is_proven and self.width <= self.wanted

    @property
    def is_proven(self) -> bool:
        """Whether there are bounds."""
        return self.certificate is not None

    @property
    def sign(self) -> int:
        """1 or −1 where that is proven, else 0."""
        return int(self.lower > 0) - int(self.upper < 0)

    def __str__(self) -> str:
        return f"[{self.lower!r}, {self.upper!r}]" if self.is_proven else "not proven"


NOTHING = Enclosure(-math.inf, math.inf)


@in_balls
def enclosure_of(certificate: Certificate) -> Enclosure:
    """mu ± delta, rounded outward."""
    mu, delta = ball(certificate.mu), ball(certificate.delta)
    return Enclosure(_outward(mu - delta, -math.inf), _outward(mu + delta, math.inf), certificate)


@in_balls
def follows(lower: Fraction, upper: Fraction, certificate: Certificate) -> bool:
    """Whether bounds hold if the certificate does."""
    mu, delta = ball(certificate.mu), ball(certificate.delta)
    return bool(ball(lower) <= mu - delta and mu + delta <= ball(upper))


def _outward(bound: object, direction: float) -> float:
    """A float beyond a ball, and so is the decimal that it is printed as."""
    found = float(bound)  # type: ignore[arg-type]
    while not _is_beyond(found, bound, direction):
        found = math.nextafter(found, direction)
    return found


def _is_beyond(found: float, bound: object, direction: float) -> bool:
    read = (ball(found), ball(repr(found)))
    return all((each >= bound) if direction > 0 else (each <= bound) for each in read)  # type: ignore[operator]


def trivial(stated: Parameters) -> Enclosure:
    """Λ(0) = 0, as T = 1."""
    unit = Certificate(
        quantity="moment",
        p="0.0",
        parameters=dict(stated),
        mu=0.0,
        delta=0.0,
        basis=BasisRecord(kind="core"),
        cosine=[[1.0]],
        sine=[[0.0]],
        nodes=[-0.5, 0.5],
        values=[0.0, 0.0],
        tails=[0.0, 0.0],
        phases=4,
    )
    return enclosure_of(unit)


@in_balls
def around(low: str, high: str) -> tuple[float, float]:
    """Two decimals as floats, rounded outward."""
    return _outward(ball(low), -math.inf), _outward(ball(high), math.inf)
