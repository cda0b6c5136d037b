"""Proving bounds on Λ(p), λ and δ_p for the curves of a case, of whose numbers the decimals count that it states."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property, partial
from typing import Any, TypeAlias, cast

from fpsolve.case.case import Case, Curve
from fpsolve.errors import FpsolveError, NoSuchExponent
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, STABILITY_INDEX
from fpsolve.messages import Code, Message
from fpsolve.parts.excursions import NAME as EXCURSIONS
from fpsolve.proofs.certificate import Enclosure
from fpsolve.proofs.claims import verdicts
from fpsolve.proofs.questions import (
    ExcursionBound,
    ExcursionEnclosure,
    IndexEnclosure,
    check_width,
    prove_bounds,
    prove_excursions,
    prove_index,
    refuse_unprovable,
)
from fpsolve.proofs.statement import DECIMAL, Statement, linear_values, statement_of

ORDERS = "moments.p"
Literals = Mapping[float, str]
"""Decimals by their floats."""
Answer: TypeAlias = Enclosure | IndexEnclosure | ExcursionEnclosure
Question = partial[Any]


@dataclass(frozen=True, eq=False)
class CurveProof:
    """What is proven of one parameter set.

    Attributes:
        stated: what is proven of.
        moments: p as a decimal, and bounds on Λ(p) or None where that was not tried.
        exponent: bounds on λ; None where they are not asked for, or were not tried.
        index: bounds on δ_p; the same.
        excursion: bounds of P(sup ‖x‖ ≥ A); the same.
    """

    curve: Curve
    stated: Statement
    moments: tuple[tuple[str, Enclosure | None], ...]
    exponent: Enclosure | None = None
    index: IndexEnclosure | None = None
    excursion: ExcursionEnclosure | None = None

    @property
    def excursions(self) -> Mapping[str, ExcursionBound]:
        """The bounds of P(sup ‖x‖ ≥ A) that hold: "lower", for which λ < 0 is proven too, and "upper"."""
        found: dict[str, ExcursionBound] = {}
        if self.excursion is None:
            return found
        decays = self.exponent is not None and self.exponent.sign < 0
        if self.excursion.lower is not None and decays:
            found["lower"] = self.excursion.lower
        if self.excursion.upper is not None:
            found["upper"] = self.excursion.upper
        return found

    @property
    def is_met(self) -> bool:
        """Whether all bounds on Λ(p) and λ that were tried are as close as wanted."""
        return all(each is None or each.is_met for each in (*(found for _, found in self.moments), self.exponent))

    @property
    def verdicts(self) -> list[str]:
        """What is proven of paths and moments."""
        signs = [(p, 0 if found is None else found.sign) for p, found in self.moments]
        return verdicts(signs, 0 if self.exponent is None else self.exponent.sign)


@dataclass(frozen=True)
class Plan:
    """What is to be proven of a case, the same of every curve: Λ at all p; λ, δ_p, excursions if [output] names them.

    Attributes:
        case: whose curves.
        width: wanted upper − lower; a share of the scale if None.
    """

    case: Case
    width: float | None

    @property
    def indices(self) -> list[str]:
        """Those of λ, δ_p and excursions that are asked for."""
        known = (LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name, EXCURSIONS)
        return [name for name in known if name in self.case.asked]

    @property
    def each(self) -> int:
        return len(self.case.p) + len(self.indices)

    @property
    def total(self) -> int:
        return self.each * self.case.planned

    @cached_property
    def _literals(self) -> Mapping[str, Literals]:
        keys = (key for curve in self.case.curves(stop=1) for key in linear_values(curve.problem))
        return literals_of(self.case, (*keys, ORDERS))

    @cached_property
    def _orders(self) -> list[str]:
        """All p as decimals: as the case states them, or of a range the floats as they stand."""
        if self.case.moments.is_range:
            return [str(Decimal(p)) for p in self.case.p.tolist()]
        return [decimal_of(p, self._literals[ORDERS]) for p in self.case.p.tolist()]

    def stated(self, curve: Curve) -> Statement:
        """The linear motion with its parameters as the decimals that the case states. Raises as `statement_of`."""
        decimals = {
            key: value if isinstance(value, str) else decimal_of(value, self._literals[key])
            for key, value in linear_values(curve.problem).items()
        }
        return statement_of(curve.problem, decimals)

    def questions(self) -> Iterator[Question]:
        for curve in self.case.curves():
            problem, stated, budget = curve.problem, self.stated(curve), self.case.budget
            yield from (partial(prove_bounds, problem, stated, p, self.width, budget=budget) for p in self._orders)
            if LYAPUNOV_EXPONENT.name in self.indices:
                yield partial(prove_bounds, problem, stated, None, self.width, budget=budget)
            if STABILITY_INDEX.name in self.indices:
                yield partial(prove_index, problem, stated, budget=budget)
            if EXCURSIONS in self.indices:
                yield partial(prove_excursions, problem, stated, budget=budget)

    def gathered(self, answers: Sequence[Answer]) -> list[CurveProof]:
        """What is proven of each curve, from the first answers, in the order of the questions."""
        found, rest = [], iter(answers)
        for curve in self.case.curves(stop=-(-len(answers) // self.each)):
            moments = tuple((p, cast("Enclosure | None", next(rest, None))) for p in self._orders)
            indices: dict[str, Any] = {name: next(rest, None) for name in self.indices}
            names = (LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name, EXCURSIONS)
            found.append(CurveProof(curve, self.stated(curve), moments, *map(indices.get, names)))
        return found


def refuse_unprovable_case(case: Case, width: float | None) -> None:
    """Refuse a width that is not positive, and a case some curve of which cannot be proven.

    Raises:
        FpsolveError: with the curve and the reason.
    """
    try:
        check_width(width)
    except ValueError as failure:
        raise FpsolveError(f"--width: {failure}") from None
    plan = Plan(case, width)
    for curve in case.curves():
        place = f"{case.path}: with {curve.label}" if curve.varied else str(case.path)
        try:
            refuse_unprovable(plan.stated(curve))
        except (TypeError, ValueError) as failure:
            raise FpsolveError(f"{place}: {failure}") from None
        except NoSuchExponent as failure:
            raise NoSuchExponent(Message(Code.PLACED, place=place, reason=failure.message)) from None


def answer(question: Question) -> Answer:
    """The task: proves what is asked."""
    return question()


def literals_of(case: Case, keys: Iterable[str]) -> Mapping[str, Literals]:
    """The decimals that the file and the command line state for dotted keys; those of [vary] for a varied one."""
    found = list(_leaves(tomllib.loads(case.text, parse_float=Decimal)))
    for override in case.overrides:
        with suppress(ValueError):  # a bare word
            new = list(_leaves(tomllib.loads(override, parse_float=Decimal)))
            ((replaced, _),) = _leaves(tomllib.loads(f"{override.partition('=')[0]} = 0"))
            found = [each for each in found if not _is_in(each[0], replaced)] + new
    places = {key: f"vary.{key}" if key in case.vary.keys else key for key in keys}
    return {
        key: {float(number) + 0.0: f"{number}" for path, number in found if _is_in(path, place)}
        for key, place in places.items()
    }


def decimal_of(value: float, literals: Literals) -> str:
    """A number as the decimal that is stated, or else, as for those of a range, the shortest that is read as it."""
    shortest = repr(float(value))
    text = literals.get(value, shortest) if value else shortest
    return text if DECIMAL.fullmatch(text) and Decimal(text) != Decimal(shortest) else shortest


def _leaves(data: Any, path: str = "") -> Iterator[tuple[str, Decimal | int]]:
    """The finite numbers in tables and lists, each after the dotted keys of the tables in which it stands."""
    if isinstance(data, dict):
        for name, inner in data.items():
            yield from _leaves(inner, f"{path}.{name}" if path else name)
    elif isinstance(data, list):
        for inner in data:
            yield from _leaves(inner, path)
    elif isinstance(data, Decimal | int) and not isinstance(data, bool) and Decimal(data).is_finite():
        yield path, data


def _is_in(path: str, place: str) -> bool:
    return f"{path}.".startswith(f"{place}.")
