"""Bounds as results."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from fpsolve.proofs.balls import ball, in_balls
from fpsolve.proofs.certificate import BasisRecord, Certificate, SideRecord
from fpsolve.proofs.statement import Parameters


@dataclass(frozen=True)
class Enclosure:
    """What is proven of a number: lower ≤ it ≤ upper.

    The bounds hold for the floats, and for the decimals that they are printed as.

    Attributes:
        certificate: from which they follow; None where nothing is proven. A bound that is not proven is infinite.
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
        """Whether there is a bound."""
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
    """mu − lower.delta and mu + upper.delta, rounded outward; infinite where there is none."""
    lower, upper = _ends(certificate)
    return Enclosure(
        -math.inf if lower is None else _outward(lower, -math.inf),
        math.inf if upper is None else _outward(upper, math.inf),
        certificate,
    )


@in_balls
def follows(lower: Fraction | None, upper: Fraction | None, certificate: Certificate) -> bool:
    """Whether bounds hold if the certificate does; None claims nothing."""
    low, high = _ends(certificate)
    if (lower is not None and low is None) or (upper is not None and high is None):
        return False
    return (lower is None or bool(ball(lower) <= low)) and (upper is None or bool(ball(upper) >= high))


def _ends(certificate: Certificate) -> tuple[Any, Any]:
    """The bounds of a certificate as balls."""
    mu, lower, upper = ball(certificate.mu), certificate.lower, certificate.upper
    return (
        None if lower is None else mu - ball(lower.delta),
        None if upper is None else mu + ball(upper.delta),
    )


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
    side = SideRecord(delta=0.0, nodes=[-0.5, 0.5], values=[0.0, 0.0], tails=[0.0, 0.0])
    unit = Certificate(
        quantity="moment",
        p="0.0",
        parameters=dict(stated),
        mu=0.0,
        basis=BasisRecord(kind="core"),
        cosine=[[1.0]],
        sine=[[0.0]],
        upper=side,
        lower=side,
        phases=4,
    )
    return enclosure_of(unit)


@in_balls
def around(low: str, high: str) -> tuple[float, float]:
    """Two decimals as floats, rounded outward."""
    return _outward(ball(low), -math.inf), _outward(ball(high), math.inf)
