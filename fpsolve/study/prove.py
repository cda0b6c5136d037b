"""Proving bounds on Λ(p), λ and δ_p for the curves of a case."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal

from fpsolve.case.case import Case
from fpsolve.case.curves import Curve
from fpsolve.case.sections import Sweep
from fpsolve.errors import FpsolveError, NoSuchExponent
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX
from fpsolve.proofs.claims import verdicts
from fpsolve.proofs.enclosure import Enclosure
from fpsolve.proofs.questions import (
    IndexEnclosure,
    check_width,
    prove_exponent,
    prove_index,
    prove_moment,
    refuse_unprovable,
)
from fpsolve.proofs.statement import IMPACT, NOISE, OSCILLATOR, TREATMENT, Parameters


@dataclass(frozen=True)
class Question:
    """What is to be proven.

    Attributes:
        quantity: the name of Λ(p), λ or δ_p.
        stated: the parameters of the curve as decimals.
        p: the moment as a decimal.
        width: wanted upper − lower; a share of the scale if None.
    """

    curve: Curve
    quantity: str
    stated: Parameters
    p: str = ""
    width: float | None = None


@dataclass(frozen=True, eq=False)
class CurveProof:
    """What is proven of one parameter set.

    Attributes:
        moments: p, and bounds on Λ(p) or None where that was not tried.
        exponent: bounds on λ; None where they are not asked for, or were not tried.
        index: bounds on δ_p; the same.
    """

    curve: Curve
    moments: tuple[tuple[float, Enclosure | None], ...]
    exponent: Enclosure | None = None
    index: IndexEnclosure | None = None

    @property
    def bounds(self) -> tuple[Enclosure, ...]:
        """All on Λ(p) and λ."""
        return tuple(each for each in (*(found for _, found in self.moments), self.exponent) if each is not None)

    @property
    def is_met(self) -> bool:
        """Whether all are as close as wanted."""
        return all(each.is_met for each in self.bounds)

    @property
    def verdicts(self) -> list[str]:
        """What is proven of paths and moments."""
        signs = [(p, 0 if found is None else found.sign) for p, found in self.moments]
        return verdicts(signs, 0 if self.exponent is None else self.exponent.sign)


def refuse_unprovable_case(case: Case, width: float | None) -> None:
    """Refuse a width that is none, and a case some curve of which cannot be proven.

    Raises:
        FpsolveError: with the curve and the reason.
    """
    try:
        check_width(width)
    except ValueError as failure:
        raise FpsolveError(f"--width: {failure}") from None
    literals = _literals(case)
    for curve in case.curves():
        try:
            refuse_unprovable(_stated(curve, literals))
        except NoSuchExponent as failure:
            place = f"with {curve.label}: " if curve.varied else ""
            raise NoSuchExponent(f"{case.path}: {place}{failure}") from None


@dataclass(frozen=True)
class Plan:
    """What is to be proven of a case, the same of every curve: Λ at all p, and λ and δ_p if [output] asks for them.

    Attributes:
        case: whose curves.
        width: wanted upper − lower; a share of the scale if None.
    """

    case: Case
    width: float | None

    @property
    def indices(self) -> list[str]:
        """Those of λ and δ_p that are asked for."""
        return [each.name for each in (LYAPUNOV_EXPONENT, STABILITY_INDEX) if each.name in self.case.output.quantities]

    @property
    def each(self) -> int:
        """How many questions a curve has."""
        return len(self.case.p) + len(self.indices)

    @property
    def total(self) -> int:
        """How many questions there are."""
        return self.each * self.case.planned

    def questions(self) -> Iterator[Question]:
        """All of them, curve by curve."""
        literals = _literals(self.case)
        orders = [_order(self.case, p, literals) for p in self.case.p.tolist()]
        for curve in self.case.curves():
            stated = _stated(curve, literals)
            yield from (Question(curve, MOMENT.name, stated, p, self.width) for p in orders)
            yield from (Question(curve, name, stated, width=self.width) for name in self.indices)

    def gathered(self, answers: Sequence[Enclosure | IndexEnclosure]) -> list[CurveProof]:
        """What is proven of each curve, from the first answers, in the order of the questions."""
        found = []
        for number, curve in enumerate(self.case.curves()):
            given = answers[number * self.each : (number + 1) * self.each]
            padded = [*given, *[None] * (self.each - len(given))]
            if given:
                found.append(_proof(curve, self.case.p.tolist(), self.indices, padded))
        return found


def answer(question: Question) -> Enclosure | IndexEnclosure:
    """The task: proves what is asked."""
    problem = question.curve.problem
    if question.quantity == MOMENT.name:
        return prove_moment(problem, question.stated, question.p, question.width)
    if question.quantity == LYAPUNOV_EXPONENT.name:
        return prove_exponent(problem, question.stated, question.width)
    return prove_index(problem, question.stated)


def _proof(
    curve: Curve, p: Sequence[float], indices: Sequence[str], given: Sequence[Enclosure | IndexEnclosure | None]
) -> CurveProof:
    """The answers to the questions of one curve."""
    moments = [each if isinstance(each, Enclosure) else None for each in given[: len(p)]]
    others = dict(zip(indices, given[len(p) :], strict=True))
    exponent, index = (others.get(each.name) for each in (LYAPUNOV_EXPONENT, STABILITY_INDEX))
    return CurveProof(
        curve,
        tuple(zip(p, moments, strict=True)),
        exponent if isinstance(exponent, Enclosure) else None,
        index if isinstance(index, IndexEnclosure) else None,
    )


def _stated(curve: Curve, literals: Mapping[float, str]) -> Parameters:
    """The parameters of the linear motion as the decimals that a case states."""
    keys = (*OSCILLATOR, IMPACT, *NOISE, TREATMENT)
    return {key: _decimal(curve.parameters[key], literals) for key in keys}


def _decimal(value: float | str, literals: Mapping[float, str]) -> str:
    return str(value) if isinstance(value, str) else literals.get(value, repr(float(value)))


def _order(case: Case, p: float, literals: Mapping[float, str]) -> str:
    """p as a decimal: as the case states it, or of a sweep the float as it stands."""
    return str(Decimal(p)) if isinstance(case.moments.p, Sweep) else _decimal(p, literals)


def _literals(case: Case) -> Mapping[float, str]:
    """The numbers of a case that have more digits than their floats, by these."""
    found: dict[float, str] = {}

    def note(text: str) -> float:
        plain = text.replace("_", "")
        value = float(plain)
        if math.isfinite(value) and Decimal(plain) != Decimal(repr(value)):
            found[value] = f"{Decimal(plain)}"
        return value

    tomllib.loads(case.text, parse_float=note)
    for override in case.overrides:
        with suppress(ValueError):
            tomllib.loads(f"value = {override.partition('=')[2]}", parse_float=note)
    return found
