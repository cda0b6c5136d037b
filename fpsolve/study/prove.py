"""Proving bounds on Λ(p), λ and δ_p for the curves of a case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

from fpsolve.case.case import Case
from fpsolve.case.curves import Curve
from fpsolve.case.sections import Sweep
from fpsolve.errors import FpsolveError, NoSuchExponent
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, MOMENT, STABILITY_INDEX
from fpsolve.proofs.certificate import Enclosure
from fpsolve.proofs.claims import verdicts
from fpsolve.proofs.questions import (
    IndexEnclosure,
    check_width,
    prove_exponent,
    prove_index,
    prove_moment,
    refuse_unprovable,
)
from fpsolve.proofs.statement import IMPACT, NOISE, OSCILLATOR, TREATMENT, Parameters
from fpsolve.study.decimals import Literals, decimal_of, literals_of

ORDERS = "moments.p"


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
        stated: its parameters as decimals, as far as what is proven depends on them.
        moments: p as a decimal, and bounds on Λ(p) or None where that was not tried.
        exponent: bounds on λ; None where they are not asked for, or were not tried.
        index: bounds on δ_p; the same.
    """

    curve: Curve
    stated: Parameters
    moments: tuple[tuple[str, Enclosure | None], ...]
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
        orders = self._orders(literals)
        for curve in self.case.curves():
            stated = _stated(curve, literals)
            yield from (Question(curve, MOMENT.name, stated, p, self.width) for p in orders)
            yield from (Question(curve, name, stated, width=self.width) for name in self.indices)

    def gathered(self, answers: Sequence[Enclosure | IndexEnclosure]) -> list[CurveProof]:
        """What is proven of each curve, from the first answers, in the order of the questions."""
        found, literals = [], _literals(self.case)
        orders = self._orders(literals)
        for number, curve in enumerate(self.case.curves(stop=-(-len(answers) // self.each))):
            given = answers[number * self.each : (number + 1) * self.each]
            padded = [*given, *[None] * (self.each - len(given))]
            stated = _stated(curve, literals)
            found.append(_proof(curve, stated, orders, self.indices, padded))
        return found

    def _orders(self, literals: Mapping[str, Literals]) -> list[str]:
        """All p as decimals: as the case states them, or of a range the floats as they stand."""
        if isinstance(self.case.moments.p, Sweep):
            return [str(Decimal(p)) for p in self.case.p.tolist()]
        return [decimal_of(p, literals[ORDERS]) for p in self.case.p.tolist()]


def answer(question: Question) -> Enclosure | IndexEnclosure:
    """The task: proves what is asked."""
    problem = question.curve.problem
    if question.quantity == MOMENT.name:
        return prove_moment(problem, question.stated, question.p, question.width)
    if question.quantity == LYAPUNOV_EXPONENT.name:
        return prove_exponent(problem, question.stated, question.width)
    return prove_index(problem, question.stated)


def _proof(
    curve: Curve,
    stated: Parameters,
    p: Sequence[str],
    indices: Sequence[str],
    given: Sequence[Enclosure | IndexEnclosure | None],
) -> CurveProof:
    """The answers to the questions of one curve."""
    moments = [each if isinstance(each, Enclosure) else None for each in given[: len(p)]]
    others = dict(zip(indices, given[len(p) :], strict=True))
    exponent, index = (others.get(each.name) for each in (LYAPUNOV_EXPONENT, STABILITY_INDEX))
    return CurveProof(
        curve,
        stated,
        tuple(zip(p, moments, strict=True)),
        exponent if isinstance(exponent, Enclosure) else None,
        index if isinstance(index, IndexEnclosure) else None,
    )


def _stated(curve: Curve, literals: Mapping[str, Literals]) -> Parameters:
    """The parameters of the linear motion as the decimals that a case states."""
    stated = {key: decimal_of(float(curve.parameters[key]), literals[key]) for key in (*OSCILLATOR, *NOISE)}
    return stated | {key: str(curve.parameters[key]) for key in (IMPACT, TREATMENT)}


def _literals(case: Case) -> Mapping[str, Literals]:
    return literals_of(case, (*OSCILLATOR, *NOISE, ORDERS))
