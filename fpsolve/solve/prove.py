"""Proofs of bounds on Λ(p), λ and δ_p of the parameter sets of a case, and the check of one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator

from fpsolve.analysis.target import said
from fpsolve.case.case import Case, ParameterSet
from fpsolve.errors import FpsolveError, NoSuchExponent
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, STABILITY_INDEX
from fpsolve.files import Unreadable, Words, read_text
from fpsolve.messages import Code, Message
from fpsolve.proofs.balls import precision
from fpsolve.proofs.certificate import NOTHING, Enclosure, MalformedProof, enclosure_of
from fpsolve.proofs.claims import Claims, claims_from, verdicts
from fpsolve.proofs.questions import StabilityIndexEnclosure, check_width, prove_bounds, prove_index
from fpsolve.proofs.statement import statement_of
from fpsolve.proofs.verify import objection
from fpsolve.solve.records import key_of

Answer: TypeAlias = Enclosure | StabilityIndexEnclosure
"""Bounds that were found."""
Question = partial[Any]
"""A function that finds bounds, with its arguments."""
PROVEN_RECORDS = "records/proven.jsonl"
"""The file of the records of bounds."""
_WORDS = Words("the proof", "a proof", "proof.json", "JSON", "make one with `fpsolve prove`")
"""The words of messages on a proof.json."""


@dataclass(frozen=True, eq=False)
class SetProof:
    """What is proven of one parameter set.

    Attributes:
        moments: p, and bounds on Λ(p) or None where that was not tried.
        exponent: bounds on λ; None where they are not asked for, or were not tried.
        stability_index: bounds on δ_p, or None as for λ.
    """

    parameter_set: ParameterSet
    moments: tuple[tuple[float, Enclosure | None], ...]
    exponent: Enclosure | None = None
    stability_index: StabilityIndexEnclosure | None = None

    @property
    def is_met(self) -> bool:
        """Whether all bounds on Λ(p) and λ that were tried are as close as wanted."""
        return all(each is None or each.is_met for each in (*(found for _, found in self.moments), self.exponent))

    @property
    def verdicts(self) -> list[str]:
        """What is proven of paths and moments."""
        signs = [(p, 0 if found is None else found.sign) for p, found in self.moments]
        return verdicts(signs, 0 if self.exponent is None else self.exponent.sign)


def asked_of(case: Case) -> list[Any]:
    """What is to be proven of every parameter set of a case: Λ at all p; λ and δ_p if [output] names them."""
    return [*case.p.tolist(), *(name for name in (LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name) if name in case.asked)]


def questions(case: Case, width: float | None) -> Iterator[Question]:
    """For each parameter set those of what is asked, in its order.

    Args:
        width: wanted upper − lower; a share of the scale if None.
    """
    for parameter_set in case.sets():
        problem, stated = parameter_set.problem, statement_of(parameter_set.problem)
        for each in asked_of(case):
            if each == STABILITY_INDEX.name:
                yield partial(prove_index, problem, stated, budget=case.budget)
            else:
                p = None if each == LYAPUNOV_EXPONENT.name else each
                yield partial(prove_bounds, problem, stated, p, width, budget=case.budget)


def gathered(case: Case, answers: Sequence[Answer]) -> list[SetProof]:
    """What is proven of each parameter set, from the first answers, in the order of the questions."""
    asked, left, found = asked_of(case), iter(answers), list[SetProof]()
    for parameter_set in case.sets(stop=-(-len(answers) // len(asked))):
        known: dict[Any, Any] = {each: next(left, None) for each in asked}
        moments = tuple((p, known[p]) for p in case.p.tolist())
        found.append(SetProof(parameter_set, moments, *map(known.get, (LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name))))
    return found


def refuse_unprovable_case(case: Case, width: float | None) -> None:
    """Refuse a width that is not positive, and a case some parameter set of which cannot be proven.

    Raises:
        FpsolveError: with the parameter set and the reason.
    """
    try:
        check_width(width)
    except ValueError as failure:
        raise FpsolveError(f"--width: {failure}") from None
    if not asked_of(case):
        raise FpsolveError(
            f"{case.path}: moments: missing; proofs are of Λ(p), λ and δ_p; add [moments] with p = [2.0]"
        )
    for parameter_set in case.sets():
        place = f"{case.path}: with {parameter_set.label}" if parameter_set.varied else str(case.path)
        try:
            with precision():  # which raises `MissingFlint` before anything is written
                statement_of(parameter_set.problem)
        except (TypeError, ValueError) as failure:
            raise FpsolveError(f"{place}: {said(failure)}") from None
        except NoSuchExponent as failure:
            raise NoSuchExponent(Message(Code.PLACED, place=place, reason=failure.message)) from None


def verified(found: Enclosure) -> Enclosure:
    """The bounds of an earlier run. Raises `ValueError` where they do not follow from their certificate."""
    whole = NOTHING if found.certificate is None else enclosure_of(found.certificate)
    if (whole.lower, whole.upper) != (found.lower, found.upper):
        raise ValueError("these are other bounds")
    if found.certificate and (text := objection(found.certificate)):
        raise ValueError(text)
    return found


PROVEN_BOUNDS = Annotated[Enclosure, AfterValidator(verified)]
"""The form of bounds in a record."""


def is_kept(found: Answer) -> bool:
    """Whether bounds are recorded: those on Λ(p) and λ, from which those on δ_p follow."""
    return isinstance(found, Enclosure)


def key_of_bounds(question: Question) -> str:
    """From the function and its arguments; the problem among these follows from what is stated."""
    _, *asked = question.args
    return key_of(question.func.__name__, *map(repr, asked), repr(question.keywords))


@dataclass(frozen=True)
class Checked:
    """What became of the claims of a file.

    Attributes:
        claims: all of them.
        objections: which do not follow, and why.
    """

    claims: Claims
    objections: Sequence[str]


def check_proof(path: Path) -> Checked:
    """Verify all claims of a proof.json from their certificates alone.

    Raises:
        MalformedProof: it is none.
        MissingFlint: python-flint is not installed.
    """
    try:
        claims = claims_from(read_text(path, _WORDS))
    except Unreadable as failure:
        raise MalformedProof(f"{path}: {failure.sentence}") from None
    except MalformedProof as failure:
        raise MalformedProof(f"{path}: {failure}; make one with `fpsolve prove`") from None
    return Checked(claims, tuple(claims.objections()))
