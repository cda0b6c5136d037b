"""The claims of a proof.json, and which of them do not follow from their certificates."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationError

from fpsolve.proofs.certificate import Certificate, Enclosure, MalformedProof, follows
from fpsolve.proofs.forms import FormCertificate
from fpsolve.proofs.statement import Record
from fpsolve.proofs.verify import objection


class Bound(Record):
    """lower ≤ a number ≤ upper; null where nothing is proven. λ has no p."""

    p: float | None = None
    lower: float | None
    upper: float | None
    certificate: Certificate | FormCertificate | None

    @property
    def bounds(self) -> Sequence[Bound]:
        """Itself."""
        return [self]

    @property
    def sign(self) -> int:
        """That of the number as claimed, 0 where it is open."""
        return int(self.lower is not None and self.lower > 0) - int(self.upper is not None and self.upper < 0)

    def objections(self) -> Iterator[str]:
        """Why the bounds need not hold."""
        certificate = self.certificate
        if certificate is None:
            if (self.lower, self.upper) != (None, None):
                yield "there is no certificate"
        elif certificate.p != self.p:
            yield "the certificate is of another p"
        elif not follows(self.lower, self.upper, certificate):
            yield "the bounds are closer than those of the certificate"
        else:
            with np.errstate(all="ignore"):  # what overflows proves nothing
                yield from filter(None, [objection(certificate)])


class MomentBound(Bound):
    """Of Λ(p)."""

    p: float


class StabilityIndexBound(Record):
    """Of δ_p, from Λ at two p beside it."""

    lower: float | None
    upper: float | None
    moments: list[MomentBound]

    @property
    def bounds(self) -> Sequence[Bound]:
        """Those from which it follows."""
        return self.moments

    def objections(self) -> Iterator[str]:
        """Why the bounds need not hold."""
        if not self.moments and (self.lower, self.upper) == (None, None):
            return
        if len(self.moments) != 2 or self.lower is None or self.upper is None:
            yield "δ_p needs both bounds, and Λ at two p"
            return
        for moment in self.moments:
            yield from moment.objections()
        low, high = (each.p for each in self.moments)
        if self.moments[0].sign * self.moments[1].sign >= 0 or not (0 < low < high or low < high < 0):
            yield "Λ does not change its sign between two p of one sign"
        elif not self.lower <= low < high <= self.upper:
            yield "the bounds of δ_p are closer than the two p"


class SetClaims(Record):
    """What is claimed for one parameter set.

    Attributes:
        parameters: labels; what the bounds are of is stated by the certificates.
    """

    parameters: dict[str, float | str]
    moments: list[MomentBound]
    lyapunov_exponent: Bound | None
    stability_index: StabilityIndexBound | None
    verdicts: list[str]

    @property
    def claims(self) -> Mapping[str, Bound | StabilityIndexBound]:
        """All bounds, by the places where they stand."""
        found: dict[str, Bound | StabilityIndexBound] = {f"moments.{i}": each for i, each in enumerate(self.moments)}
        if self.lyapunov_exponent is not None:
            found["lyapunov_exponent"] = self.lyapunov_exponent
        if self.stability_index is not None:
            found["stability_index"] = self.stability_index
        return found

    def objections(self) -> Iterator[str]:
        """What does not follow, after the place where it stands."""
        bounds = [each for claim in self.claims.values() for each in claim.bounds]
        stated = [each.certificate.stated for each in bounds if each.certificate is not None]
        if any(each != stated[0] for each in stated):
            yield "its certificates are of several systems"
        for place, claim in self.claims.items():
            yield from (f"{place}: {text}" for text in claim.objections())
        path = 0 if self.lyapunov_exponent is None else self.lyapunov_exponent.sign
        proven = verdicts([(each.p, each.sign) for each in self.moments], path)
        yield from (f"verdicts: {text!r} does not follow" for text in self.verdicts if text not in proven)


class Claims(Record):
    """What a proof.json claims."""

    fpsolve: str
    case: str
    complete: bool
    sets: Annotated[list[SetClaims], Field(min_length=1)]

    @property
    def count(self) -> int:
        """How many numbers are bounded."""
        return sum(each.lower is not None for parameter_set in self.sets for each in parameter_set.claims.values())

    def objections(self) -> Iterator[str]:
        """What does not follow, after the place where it stands."""
        for i, parameter_set in enumerate(self.sets):
            yield from (f"sets.{i}.{text}" for text in parameter_set.objections())


def bound_of(found: Enclosure | None) -> Bound:
    """What is claimed of bounds that were found, or were not sought."""
    certificate = None if found is None else found.certificate
    if found is None or certificate is None:
        return Bound(lower=None, upper=None, certificate=None)
    lower, upper = (end if math.isfinite(end) else None for end in (found.lower, found.upper))
    return Bound(lower=lower, upper=upper, certificate=certificate)


def moment_of(p: float, found: Enclosure | None) -> MomentBound:
    """The same of Λ(p)."""
    return MomentBound(**dict(bound_of(found)) | {"p": p})


def claims_from(text: str) -> Claims:
    """The claims of a file.

    Raises:
        MalformedProof: it is no proof.json.
    """
    try:
        return Claims.model_validate(json.loads(text))
    except ValidationError as failure:
        first = failure.errors(include_url=False)[0]
        raise MalformedProof(f"{'.'.join(map(str, first['loc']))}: {first['msg']}".removeprefix(": ")) from None
    except ValueError as failure:
        raise MalformedProof(f"is no JSON ({failure})") from None


def verdicts(moments: Sequence[tuple[float, int]], exponent: int) -> list[str]:
    """What the signs of λ and of Λ at some p say of paths and moments."""
    words = {1: "grows", -1: "decays"}
    found = [f"almost every path {words[exponent]}"] if exponent else []
    return found + [f"the moment of order {plain(p)} {words[sign]}" for p, sign in moments if sign and p]


def plain(number: float) -> str:
    """A number without digits that say nothing: 2.0 as "2"."""
    short = f"{number + 0.0:g}"
    return short if float(short) == number else repr(number)
