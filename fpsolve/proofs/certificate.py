"""Bounds, and certificates: everything from which a bound follows, so that others can check it without the solver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from fpsolve.errors import FpsolveError
from fpsolve.proofs.balls import above, ball, below, precision
from fpsolve.proofs.basis import OTHERS, Basis, Core
from fpsolve.proofs.forms import FormCertificate
from fpsolve.proofs.statement import BasisKind, Record, Statement

if TYPE_CHECKING:
    from flint import arb


class MalformedProof(FpsolveError):
    """A file that is no proof of this program."""


Table = Annotated[list[Annotated[list[float], Field(min_length=1)]], Field(min_length=1)]


class BasisRecord(Record):
    """Which functions of the noise are used, see `fpsolve.proofs.basis`."""

    kind: BasisKind
    centre: float = 0.0
    scale: Annotated[float, Field(gt=0)] = 1.0
    gauge: float = 0.0

    @property
    def basis(self) -> Basis:
        """The basis."""
        return Core(self.centre, self.scale, self.gauge) if self.kind == "core" else OTHERS[self.kind]


class SideRecord(Record):
    """One of the two bounds.

    Attributes:
        delta: how far it is from mu.
        nodes, values, tails: W of `verify`, linear between nodes, from left to right; its constants beyond. Without
            nodes W is 0.
    """

    delta: Annotated[float, Field(ge=0)]
    nodes: list[float]
    values: list[float]
    tails: Annotated[list[float], Field(min_length=2, max_length=2)] | None

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if len(self.nodes) != len(self.values) or np.any(np.diff(self.nodes) <= 0):
            raise ValueError("nodes must increase, with one of values for each")
        return self


class Certificate(Record):
    """That mu − lower.delta ≤ Λ(p) ≤ mu + upper.delta, or the same of λ.

    Attributes:
        p: the moment; None for λ.
        stated: of what.
        cosine, sine: the trial function, as `bounds.Trial` has it.
        upper, lower: the two bounds; None where one is not proven.
        phases: how many cells of φ suffice.
    """

    p: float | None
    stated: Statement
    mu: float
    basis: BasisRecord
    cosine: Table
    sine: Table
    upper: SideRecord | None
    lower: SideRecord | None
    phases: Annotated[int, Field(gt=0)]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        shapes = {np.shape(row) for table in (self.cosine, self.sine) for row in table}
        if len(shapes) != 1 or len(self.cosine) != len(self.sine):
            raise ValueError("cosine and sine must be tables of one shape")
        sides = [each for each in (self.upper, self.lower) if each is not None]
        basis = self.basis.basis
        if not sides:
            raise ValueError("neither bound is there")
        if any((each.tails is None) == basis.is_core for each in sides):
            raise ValueError("a core has tails; nothing else has")
        is_covered = basis.cover(1) is not None
        if any(bool(each.nodes) == is_covered or len(each.nodes) == 1 for each in sides):
            raise ValueError("a core and a whole support have two nodes at least; nothing else has any")
        _ = self.stated.directions
        if self.basis.kind not in self.stated.noise.bases:
            raise ValueError(f"the basis {self.basis.kind} is of other noise")
        if self.stated.noise.states and len(self.stated.noise.states) != len(self.cosine[0]):
            raise ValueError("a chain has a column of coefficients for each state")
        return self


@dataclass(frozen=True)
class Enclosure:
    """Proven bounds of a number: lower ≤ it ≤ upper.

    Attributes:
        certificate: from which they follow; None where nothing is proven. A bound that is not proven is infinite.
        wanted: how far they may be apart.
    """

    lower: float
    upper: float
    certificate: Certificate | FormCertificate | None = None
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


@precision()
def enclosure_of(certificate: Certificate | FormCertificate) -> Enclosure:
    """mu − lower.delta and mu + upper.delta, rounded outward; infinite where there is none."""
    lower, upper = _ends(certificate)
    return Enclosure(below(lower), above(upper), certificate)


@precision()
def follows(lower: float | None, upper: float | None, certificate: Certificate | FormCertificate) -> bool:
    """Whether bounds hold if the certificate does; None claims nothing."""
    low, high = _ends(certificate)
    return (lower is None or bool(ball(lower) <= low)) and (upper is None or bool(ball(upper) >= high))


def _ends(certificate: Certificate | FormCertificate) -> tuple[arb, arb]:
    """The bounds of a certificate as balls, infinite where there is none."""
    low, high = (math.inf if side is None else side.delta for side in (certificate.lower, certificate.upper))
    return ball(certificate.mu) - ball(low), ball(certificate.mu) + ball(high)


def trivial(stated: Statement) -> Enclosure:
    """Λ(0) = 0, as T = 1."""
    kind, columns = stated.noise.bases[0], max(len(stated.noise.states), 1)
    if kind == "core":
        side = SideRecord(delta=0.0, nodes=[-0.5, 0.5], values=[0.0, 0.0], tails=[0.0, 0.0])
    else:
        side = SideRecord(delta=0.0, nodes=[], values=[], tails=None)
    unit = Certificate(
        p=0.0,
        stated=stated,
        mu=0.0,
        basis=BasisRecord(kind=kind),
        cosine=[[1.0] * columns],
        sine=[[0.0] * columns],
        upper=side,
        lower=side,
        phases=4,
    )
    return enclosure_of(unit)
