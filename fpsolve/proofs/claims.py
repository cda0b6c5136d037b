"""The claims of a proof.json, and which of them do not follow from their certificates."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal, InvalidOperation
from fractions import Fraction
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Discriminator, Field, Tag, ValidationError, model_validator

from fpsolve.proofs.certificate import MOMENT, Certificate, MalformedProof, follows
from fpsolve.proofs.forms import FormCertificate
from fpsolve.proofs.records import Record
from fpsolve.proofs.statement import DECIMAL, inert_keys
from fpsolve.proofs.verify import objection

EXACT = "lower", "upper", "p", "factor", "parameters"
"""The keys whose numbers are read as the decimals that they are written as; others are floats."""
SMALLEST, MOST_DIGITS = -400, 2000
"""Of such a number: the least power of ten, and how many digits it may have; it must be a finite float, too."""
MOST_WORK = 2 * 10**10
"""Operations for all certificates of a file, about an hour."""
Stated = Mapping[str, Decimal | str]
"""The parameters of a curve."""


class Bound(Record):
    """lower ≤ a number ≤ upper, as decimals and as the floats next to these; null where nothing is proven."""

    lower: Decimal | None
    upper: Decimal | None
    certificate: (
        Annotated[
            Annotated[Certificate, Tag("phases")] | Annotated[FormCertificate, Tag("form")],
            Discriminator(lambda data: "form" if isinstance(data, dict) and "factor" in data else "phases"),
        ]
        | None
    )

    @property
    def bounds(self) -> Sequence[Bound]:
        """Itself."""
        return [self]

    @property
    def sign(self) -> int:
        """That of the number as claimed, 0 where it is open."""
        return int(self.lower is not None and self.lower > 0) - int(self.upper is not None and self.upper < 0)

    def objections(self, parameters: Stated) -> Iterator[str]:
        """Why the bounds need not hold."""
        certificate = self.certificate
        p: Decimal | None = vars(self).get("p")  # of a moment
        if certificate is None:
            if (self.lower, self.upper) != (None, None):
                yield "there is no certificate"
        elif (certificate.quantity == MOMENT) != (p is not None):
            yield "the certificate is of another quantity"
        elif p is not None and Decimal(certificate.p or "nan") != p:
            yield "the certificate is of another p"
        elif not _are_same(certificate.parameters, parameters):
            yield "the certificate is of other parameters"
        elif not all(follows(low, high, certificate) for low, high in _as_read(self.lower, self.upper)):
            yield "the bounds are closer than those of the certificate"
        else:
            with np.errstate(all="ignore"):  # what overflows proves nothing
                yield from filter(None, [objection(certificate)])


class MomentBound(Bound):
    """Of Λ(p)."""

    p: Decimal


class IndexBound(Record):
    """Of δ_p, from Λ at two p beside it."""

    lower: Decimal | None
    upper: Decimal | None
    moments: list[MomentBound]

    @property
    def bounds(self) -> Sequence[Bound]:
        """Those from which it follows."""
        return self.moments

    def objections(self, parameters: Stated) -> Iterator[str]:
        """Why the bounds need not hold."""
        if not self.moments and (self.lower, self.upper) == (None, None):
            return
        if len(self.moments) != 2 or self.lower is None or self.upper is None:
            yield "δ_p needs both bounds, and Λ at two p"
            return
        for moment in self.moments:
            yield from moment.objections(parameters)
        low, high = (Fraction(each.p) for each in self.moments)
        if self.moments[0].sign * self.moments[1].sign >= 0 or not (0 < low < high or low < high < 0):
            yield "Λ does not change its sign between two p of one sign"
        elif not all(lower <= low and high <= upper for lower, upper in _as_read(self.lower, self.upper)):
            yield "the bounds of δ_p are closer than the two p"


class CurveClaims(Record):
    """What is claimed for one parameter set."""

    parameters: dict[str, Decimal | str]
    moments: list[MomentBound]
    lyapunov_exponent: Bound | None
    stability_index: IndexBound | None
    verdicts: list[str]

    @property
    def claims(self) -> Mapping[str, Bound | IndexBound]:
        """All bounds, by the places where they stand."""
        found: dict[str, Any] = {f"moments.{i}": each for i, each in enumerate(self.moments)}
        found |= {"lyapunov_exponent": self.lyapunov_exponent, "stability_index": self.stability_index}
        return {place: each for place, each in found.items() if each is not None}

    def objections(self) -> Iterator[str]:
        """What does not follow, after the place where it stands."""
        bounds = [each for claim in self.claims.values() for each in claim.bounds]
        stated = [each.certificate.statement for each in bounds if each.certificate is not None]
        if any(each.records != stated[0].records for each in stated):
            yield "its certificates are of several systems"
        for place, claim in self.claims.items():
            yield from (f"{place}: {text}" for text in claim.objections(self.parameters))
        signs = [(str(each.p), each.sign) for each in self.moments]
        path = 0 if self.lyapunov_exponent is None else self.lyapunov_exponent.sign
        proven = verdicts(signs, path)
        yield from (f"verdicts: {text!r} does not follow" for text in self.verdicts if text not in proven)


class Claims(Record):
    """What a proof.json claims."""

    fpsolve: str
    case: str
    complete: bool
    curves: Annotated[list[CurveClaims], Field(min_length=1)]

    @model_validator(mode="after")
    def _is_done_in_time(self) -> Self:
        bounds = [each for curve in self.curves for claim in curve.claims.values() for each in claim.bounds]
        work = sum(each.certificate.work for each in bounds if each.certificate is not None)
        if work > MOST_WORK:
            raise ValueError(
                f"{len(bounds)} certificates ask for {work:.1e} operations; at most {MOST_WORK:.0e} are done for one "
                "file: divide the curves among several"
            )
        return self

    @property
    def count(self) -> int:
        """How many numbers are bounded."""
        return sum(each.lower is not None for curve in self.curves for each in curve.claims.values())

    @property
    def labels(self) -> list[str]:
        """The keys of parameters of which no certificate knows the meaning, as it states matrices or rates itself."""
        bounds = [each for curve in self.curves for claim in curve.claims.values() for each in claim.bounds]
        known = [each.certificate.statement for each in bounds if each.certificate is not None]
        return [*dict.fromkeys(key for each in known for key in each.labels)]

    def objections(self) -> Iterator[str]:
        """What does not follow, after the place where it stands."""
        for i, curve in enumerate(self.curves):
            yield from (f"curves.{i}.{text}" for text in curve.objections())


def claims_from(text: str) -> Claims:
    """The claims of a file.

    Raises:
        MalformedProof: it is no proof.json.
    """
    try:
        return Claims.model_validate(
            _numbers(json.loads(text, parse_float=_number, parse_int=_whole, object_pairs_hook=_table))
        )
    except ValidationError as failure:
        raise MalformedProof(_first_fault(failure)) from None
    except RecursionError:
        raise MalformedProof("lists are nested too deeply") from None
    except ValueError as failure:
        raise MalformedProof(f"is no JSON ({failure})") from None


def verdicts(moments: Sequence[tuple[str, int]], exponent: int) -> list[str]:
    """What the signs of λ and of Λ at some p, as decimals, say of paths and moments."""
    words = {1: "grows", -1: "decays"}
    found = [f"almost every path {words[exponent]}"] if exponent else []
    return found + [f"the moment of order {plain(p)} {words[sign]}" for p, sign in moments if sign and Decimal(p)]


def plain(number: str) -> str:
    """A decimal without digits that say nothing: "2.0" as "2"."""
    short = f"{float(number) + 0.0:g}"
    return short if Decimal(short) == Decimal(number) else str(Decimal(number))


def _number(text: str) -> Decimal:
    try:
        return Decimal(text)
    except InvalidOperation:
        raise MalformedProof(f"{text[:40]} is out of range") from None


def _whole(text: str) -> int:
    if len(text) > MOST_DIGITS:
        raise MalformedProof(f"{text[:40]}… has too many digits")
    return int(text)


def _table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A table; programs differ in which of two equal keys they read."""
    table = dict(pairs)
    if len(table) < len(pairs):
        [(name, _)] = Counter(name for name, _ in pairs).most_common(1)
        raise MalformedProof(f"{name[:40]!r} stands twice in a table")
    return table


def _numbers(data: Any, exact: Sequence[str] = EXACT, is_exact: bool = False) -> Any:
    """Numbers below some keys as decimals, others, and all of certificates, as floats."""
    match data:
        case dict():
            return {
                name: _numbers(value, () if name == "certificate" else exact, is_exact or name in exact)
                for name, value in data.items()
            }
        case list():
            return [_numbers(each, exact) for each in data]
        case bool():
            return data
        case Decimal() | int() if is_exact:
            return _in_range(Decimal(data))
    return float(data) if type(data) is Decimal else data


def _in_range(number: Decimal) -> Decimal:
    is_tiny = bool(number) and number.adjusted() < SMALLEST
    if is_tiny or not math.isfinite(float(number)) or len(number.as_tuple().digits) > MOST_DIGITS:
        raise MalformedProof(f"{str(number)[:40]} is out of range")
    return number


def _as_read(*bounds: Decimal | None) -> Iterator[tuple[Any, ...]]:
    """Bounds as they stand, and as the floats that programs make of them, None where there is none."""
    yield tuple(None if bound is None else Fraction(bound) for bound in bounds)
    yield tuple(None if bound is None else Fraction(float(bound)) for bound in bounds)


def _are_same(stated: Mapping[str, str], parameters: Stated) -> bool:
    """Whether decimals are those of a curve, which has no others but those that do not matter."""
    read = {key: Decimal(text) if DECIMAL.fullmatch(text) else text for key, text in stated.items()}
    return set(parameters) - inert_keys(stated) == set(read) and all(parameters[key] == read[key] for key in read)


def _first_fault(failure: ValidationError) -> str:
    """The first of the faults, with its place."""
    first = failure.errors(include_url=False)[0]
    place = ".".join(str(each) for each in first["loc"] if each not in ("phases", "form"))
    said = re.sub(r"^Value error, | after validation", "", re.sub(r"^(Input|List|String) should", "must", first["msg"]))
    return f"{place + ': ' if place else ''}{_PLAINLY.get(first['type'], said)}"


_PLAINLY = {
    "missing": "is missing",
    "extra_forbidden": "is no key of a proof",
    "is_instance_of": "must be a finite number",
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "list_type": "must be a list",
    "float_type": "must be a number",
    "string_type": "must be a text",
    "bool_type": "must be true or false",
    "int_type": "must be a whole number",
}
