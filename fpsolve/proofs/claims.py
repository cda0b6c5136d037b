"""The claims of a proof.json, and which of them do not follow from their certificates."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from decimal import Decimal
from fractions import Fraction
from typing import Any

from pydantic import ValidationError

from fpsolve.proofs.certificate import MOMENT, Certificate, MalformedProof, Record, first_fault
from fpsolve.proofs.enclosure import follows
from fpsolve.proofs.statement import IMPACT, TREATMENT
from fpsolve.proofs.verify import objection

ENDS = "lower", "upper"
FARTHEST = 400
"""Powers of ten beyond which a bound is none."""
Place = tuple[str, ...]


class Bound(Record):
    """lower ≤ a number ≤ upper, as decimals; null where nothing is proven."""

    lower: Decimal | None
    upper: Decimal | None
    certificate: Certificate | None

    def objections(self, quantity: str, p: float | None, parameters: Mapping[str, float | str]) -> Iterator[str]:
        """Why the bounds need not hold."""
        if self.certificate is None:
            if (self.lower, self.upper) != (None, None):
                yield "there is no certificate"
            return
        certificate = self.certificate
        if certificate.quantity != quantity or (p is not None and float(certificate.p or "nan") != p):
            yield "the certificate is of another quantity"
        elif not _are_same(certificate.parameters, parameters):
            yield "the certificate is of other parameters"
        elif not follows(_exact(self.lower), _exact(self.upper), certificate):
            yield "the bounds are closer than those of the certificate"
        else:
            yield from filter(None, [objection(certificate)])


class MomentBound(Bound):
    """Of Λ(p)."""

    p: float

    @property
    def sign(self) -> int:
        """That of Λ(p) as claimed, 0 where it is open."""
        if self.lower is None or self.upper is None:
            return 0
        return int(self.lower > 0) - int(self.upper < 0)


class IndexBound(Record):
    """Of δ_p, from Λ at two p beside it."""

    lower: Decimal | None
    upper: Decimal | None
    moments: list[MomentBound]

    def objections(self, parameters: Mapping[str, float | str]) -> Iterator[str]:
        """Why the bounds need not hold."""
        if not self.moments and (self.lower, self.upper) == (None, None):
            return
        if len(self.moments) != 2 or self.lower is None or self.upper is None:
            yield "δ_p needs both bounds, and Λ at two p"
            return
        for moment in self.moments:
            yield from moment.objections(MOMENT, moment.p, parameters)
        low, high = (Fraction(each.certificate.p or "0") if each.certificate else 0 for each in self.moments)
        if self.moments[0].sign * self.moments[1].sign >= 0 or not (0 < low < high or low < high < 0):
            yield "Λ does not change its sign between two p of one sign"
        elif not Fraction(self.lower) <= low < high <= Fraction(self.upper):
            yield "the bounds of δ_p are closer than the two p"


class CurveClaims(Record):
    """What is claimed for one parameter set."""

    parameters: dict[str, float | str]
    moments: list[MomentBound]
    lyapunov_exponent: Bound | None
    stability_index: IndexBound | None
    verdicts: list[str]

    def objections(self) -> Iterator[tuple[Place, str]]:
        """What does not follow, and where it stands."""
        for i, moment in enumerate(self.moments):
            for text in moment.objections(MOMENT, moment.p, self.parameters):
                yield ("moments", str(i)), text
        if self.lyapunov_exponent:
            for text in self.lyapunov_exponent.objections("lyapunov_exponent", None, self.parameters):
                yield ("lyapunov_exponent",), text
        if self.stability_index:
            for text in self.stability_index.objections(self.parameters):
                yield ("stability_index",), text
        exponent = self.lyapunov_exponent
        proven = verdicts(
            [(each.p, each.sign) for each in self.moments],
            0 if exponent is None or exponent.lower is None or exponent.upper is None else _sign(exponent),
        )
        for text in self.verdicts:
            if text not in proven:
                yield ("verdicts",), f"{text!r} does not follow"


class Claims(Record):
    """What a proof.json claims."""

    fpsolve: str
    case: str
    complete: bool
    curves: list[CurveClaims]

    @property
    def count(self) -> int:
        """How many numbers are bounded."""
        found = 0
        for curve in self.curves:
            bounds = [*curve.moments, curve.lyapunov_exponent, curve.stability_index]
            found += sum(each is not None and each.lower is not None for each in bounds)
        return found

    def objections(self) -> Iterator[str]:
        """What does not follow, and where it stands."""
        for i, curve in enumerate(self.curves):
            for place, text in curve.objections():
                yield f"{'.'.join(('curves', str(i), *place))}: {text}"


def claims_from(text: str) -> Claims:
    """The claims of a file.

    Raises:
        MalformedProof: it is no proof.json.
    """
    try:
        return Claims.model_validate(_numbers(json.loads(text, parse_float=Decimal)))
    except ValidationError as failure:
        raise MalformedProof(first_fault(failure)) from None
    except RecursionError:
        raise MalformedProof("lists are nested too deeply") from None
    except ValueError as failure:
        raise MalformedProof(f"is no JSON ({failure})") from None


def verdicts(moments: list[tuple[float, int]], exponent: int) -> list[str]:
    """What the signs of λ and of Λ at some p say of paths and moments."""
    words = {1: "grows", -1: "decays"}
    found = [f"almost every path {words[exponent]}"] if exponent else []
    return found + [f"the moment of order {p + 0.0:g} {words[sign]}" for p, sign in moments if sign and p]


def _exact(bound: Decimal | None) -> Fraction | None:
    return None if bound is None else Fraction(bound)


def _sign(bound: Bound) -> int:
    lower, upper = bound.lower or Decimal(0), bound.upper or Decimal(0)
    return int(lower > 0) - int(upper < 0)


def _numbers(data: Any, key: str = "") -> Any:
    """Decimals as floats, but for the bounds, which are read as they stand."""
    if isinstance(data, dict):
        return {name: _numbers(value, name) for name, value in data.items()}
    if isinstance(data, list):
        return [_numbers(each) for each in data]
    if key in ENDS and isinstance(data, Decimal | int) and not isinstance(data, bool):
        bound = Decimal(data)
        if bound and abs(bound.adjusted()) > FARTHEST:
            raise MalformedProof(f"{key} = {data} is out of range")
        return bound
    return float(data) if isinstance(data, Decimal) else data


def _are_same(stated: Mapping[str, str], parameters: Mapping[str, float | str]) -> bool:
    """Whether decimals are those of a curve."""
    read = {key: text if key in (IMPACT, TREATMENT) else float(text) for key, text in stated.items()}
    return read.items() <= parameters.items()
