"""Proofs of bounds on Λ(p), λ and δ_p of the curves of a case, their file, and the check of one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator

from fpsolve import __version__
from fpsolve.analysis.target import said
from fpsolve.case.case import Case, Curve
from fpsolve.errors import FpsolveError, NoSuchExponent
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, STABILITY_INDEX
from fpsolve.files import writable, write_text
from fpsolve.messages import Code, Message
from fpsolve.output.records import Records, answered, key_of
from fpsolve.page.limits import EACH, PROOFS, ROWS
from fpsolve.page.page import Block, Column, Grid, Sentence
from fpsolve.pool import SERIAL, Pool
from fpsolve.proofs.balls import precision
from fpsolve.proofs.certificate import NOTHING, Enclosure, MalformedProof, enclosure_of
from fpsolve.proofs.claims import Claims, CurveClaims, IndexBound, bound_of, claims_from, moment_of, plain, verdicts
from fpsolve.proofs.questions import (
    IndexEnclosure,
    check_width,
    prove_bounds,
    prove_index,
)
from fpsolve.proofs.statement import statement_of
from fpsolve.proofs.verify import objection
from fpsolve.reading import Unreadable, Words, read_text
from fpsolve.show.curves import Shown, grid_of
from fpsolve.workflow.folders import PROVEN, kept, own_folder, saying_if_interrupted
from fpsolve.workflow.progress import BOUNDS, SILENT, Phase, Watch
from fpsolve.workflow.reports import shown_at_the_end, write_report

PROOF = "proof.json"
"""The file of proven bounds."""
Answer: TypeAlias = Enclosure | IndexEnclosure
"""Bounds that were found."""
Question = partial[Any]
"""A function that finds bounds, with its arguments."""
NOT_PROVEN = "not proven"
"""The word where no bound is proven."""
LONGEST = 12
"""Digits of a p at most in a table."""
FATES = {1: "grows", -1: "decays", 0: "open"}
"""The fate of a path or a moment by the sign of its exponent."""
PROVEN_RECORDS = "records/proven.jsonl"
"""The file of the records of bounds."""
_WORDS = Words("the proof", "a proof", "proof.json", "JSON", "make one with `fpsolve prove`")
"""The words of messages on a proof.json."""


@dataclass(frozen=True, eq=False)
class CurveProof:
    """What is proven of one parameter set.

    Attributes:
        moments: p, and bounds on Λ(p) or None where that was not tried.
        exponent: bounds on λ; None where they are not asked for, or were not tried.
        index: bounds on δ_p, or None as for λ.
    """

    curve: Curve
    moments: tuple[tuple[float, Enclosure | None], ...]
    exponent: Enclosure | None = None
    index: IndexEnclosure | None = None

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
    """What is to be proven of every curve of a case: Λ at all p; λ and δ_p if [output] names them."""
    return [*case.p.tolist(), *(name for name in (LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name) if name in case.asked)]


def questions(case: Case, width: float | None) -> Iterator[Question]:
    """For each curve those of what is asked, in its order.

    Args:
        width: wanted upper − lower; a share of the scale if None.
    """
    for curve in case.curves():
        problem, stated = curve.problem, statement_of(curve.problem)
        for each in asked_of(case):
            if each == STABILITY_INDEX.name:
                yield partial(prove_index, problem, stated, budget=case.budget)
            else:
                p = None if each == LYAPUNOV_EXPONENT.name else each
                yield partial(prove_bounds, problem, stated, p, width, budget=case.budget)


def gathered(case: Case, answers: Sequence[Answer]) -> list[CurveProof]:
    """What is proven of each curve, from the first answers, in the order of the questions."""
    asked, found = asked_of(case), list[CurveProof]()
    for curve in case.curves(stop=-(-len(answers) // len(asked))):
        known: dict[Any, Any] = dict(zip_longest(asked, answers[len(found) * len(asked) :][: len(asked)]))
        moments = tuple((p, known[p]) for p in case.p.tolist())
        found.append(CurveProof(curve, moments, *map(known.get, (LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name))))
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
    if not asked_of(case):
        raise FpsolveError(
            f"{case.path}: moments: missing; proofs are of Λ(p), λ and δ_p; add [moments] with p = [2.0]"
        )
    for curve in case.curves():
        place = f"{case.path}: with {curve.label}" if curve.varied else str(case.path)
        try:
            with precision():  # which raises `MissingFlint` before anything is written
                statement_of(curve.problem)
        except (TypeError, ValueError) as failure:
            raise FpsolveError(f"{place}: {said(failure)}") from None
        except NoSuchExponent as failure:
            raise NoSuchExponent(Message(Code.PLACED, place=place, reason=failure.message)) from None


def answer(question: Question) -> Answer:
    """The task: proves what is asked."""
    return question()


def write_proof(case: Case, proofs: Sequence[CurveProof], folder: Path, *, is_whole: bool) -> None:
    """proof.json: for each curve its parameters, and every bound with the certificate from which it follows."""
    curves = [
        CurveClaims(
            parameters=dict(proof.curve.parameters),
            moments=[moment_of(p, found) for p, found in proof.moments],
            lyapunov_exponent=None if proof.exponent is None else bound_of(proof.exponent),
            stability_index=None if proof.index is None else _index(proof.index),
            verdicts=proof.verdicts,
        )
        for proof in proofs
    ]
    claims = Claims(fpsolve=__version__, case=case.name, complete=is_whole, curves=curves)
    write_text(folder / PROOF, claims.model_dump_json(indent=1) + "\n")


def _index(found: IndexEnclosure) -> IndexBound:
    """Bounds on δ_p, and Λ at two p beside it."""
    lower, upper = (found.lower, found.upper) if found.is_proven else (None, None)
    return IndexBound(lower=lower, upper=upper, moments=[moment_of(p, each) for p, each in found.moments])


def show(case: Case, proofs: Sequence[CurveProof]) -> Iterator[Block]:
    """The bounds and what follows from them."""
    if len(proofs) > EACH:
        yield proofs_grid(case, proofs)
        return
    for proof in proofs:
        yield Sentence("", case.heading(proof.curve))
        told = proof.verdicts
        if sum(found is not None and found.sign != 0 for _, found in proof.moments) > PROOFS:
            path = verdicts([], 0 if proof.exponent is None else proof.exponent.sign)
            told = [*path, f"of {len(proof.moments)} moments {_counted(proof)}"]
        if told:
            yield Sentence(f"Proven: {'; '.join(told)}.")
        yield proof_grid(proof)


def proof_grid(proof: CurveProof) -> Grid:
    """The bounds on Λ at each p, λ and δ_p, how far they are apart, and what the moment or almost every path does."""
    columns = [Column("quantity"), Column("≥"), Column("≤"), Column("width", 2), Column("what it says", 1)]
    grid = Grid("", columns)
    bounds: list[tuple[str, Enclosure | IndexEnclosure | None, str]]
    bounds = [(f"Λ({_order(p)})", found, _fate(p, found)) for p, found in proof.moments]
    if (path := proof.exponent) is not None:
        bounds.append((LYAPUNOV_EXPONENT.symbol, path, FATES[path.sign] if path.is_proven else NOT_PROVEN))
    if proof.index is not None:
        bounds.append((STABILITY_INDEX.symbol, proof.index, "" if proof.index.is_proven else NOT_PROVEN))
    for symbol, found, fate in bounds:
        row = ["", "", ""]
        if found is not None and found.is_proven:
            size = found.upper - found.lower
            width = f"{size:.0e}".replace("inf", "∞") if size else "0"
            is_met = not isinstance(found, Enclosure) or found.is_met
            row = [*bounds_text(found), width if is_met else f"{width}, too wide"]
        grid.rows.append([symbol, *row, fate])
    return grid


def proofs_grid(case: Case, proofs: Sequence[CurveProof]) -> Grid:
    """How many Λ(p) are proven of each curve, the bounds on λ, and what becomes of paths and moments."""
    p, symbol = [p for p, _ in proofs[0].moments], LYAPUNOV_EXPONENT.symbol

    def proven(proof: CurveProof) -> str:
        return f"{sum(found is not None and found.is_proven for _, found in proof.moments)} of {len(p)}"

    def fate(i: int, proof: CurveProof) -> str:
        return _fate(*proof.moments[i])

    shown = [
        Shown(Column("proven"), proven),
        Shown(Column(symbol, 1), lambda each: _between(each.exponent) if each.exponent else ""),
        Shown(Column("paths", 2), lambda each: FATES[each.exponent.sign] if each.exponent else ""),
    ]
    each_p = [Shown(Column(f"p = {_order(each)}", 3), partial(fate, i)) for i, each in enumerate(p)]
    return grid_of(
        case, proofs[:ROWS], shown + (each_p if len(p) <= PROOFS else [Shown(Column("moments", 3), _counted)])
    )


def _fate(p: float, found: Enclosure | None) -> str:
    if found is None or not found.is_proven:
        return "not tried" if found is None else NOT_PROVEN
    return FATES[found.sign] if p else "is constant"


def _order(p: float) -> str:
    """p for the eye."""
    return text if len(text := plain(p)) <= LONGEST else f"{p:.10g}"


def _counted(proof: CurveProof) -> str:
    """ "31 grow, 1 decays"."""
    signs = [found.sign for _, found in proof.moments if found is not None]
    counts = {word: signs.count(sign) for sign, word in FATES.items() if sign}
    told = [f"{n} {word if n == 1 else word.removesuffix('s')}" for word, n in counts.items() if n]
    return ", ".join(told) or "none is known"


def _between(found: Enclosure | IndexEnclosure) -> str:
    """ "in [0.0010257274, 0.0010257275]"."""
    return f"in [{', '.join(bounds_text(found))}]" if found.is_proven else NOT_PROVEN


def bounds_text(found: Enclosure | IndexEnclosure) -> tuple[str, str]:
    """Both bounds with two digits of how far they are apart, of a single one five digits, rounded outward."""
    if found.lower == found.upper:
        return f"{found.lower:g}", f"{found.upper:g}"
    known = [end for end in (found.lower, found.upper) if math.isfinite(end)]
    size, digits = (found.upper - found.lower, 2) if len(known) > 1 else (abs(known[0]) or 1.0, 5)
    step = Decimal(1).scaleb(math.floor(math.log10(size)) + 1 - digits)
    low, high = (
        f"{Decimal(repr(end)).quantize(step, rounding)}" if math.isfinite(end) else f"{end}".replace("inf", "∞")
        for end, rounding in ((found.lower, ROUND_FLOOR), (found.upper, ROUND_CEILING))
    )
    return low, high


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


def _key(question: Question) -> str:
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


def prove_case(
    case: Case,
    out: str | Path = "results",
    *,
    width: float | None = None,
    pool: Pool = SERIAL,
    watch: Watch = SILENT,
) -> list[CurveProof]:
    """Prove bounds on Λ at every p of every curve, and on λ and δ_p; write proof.json into `out`/<case>/.

    Args:
        width: wanted upper − lower; 1e-7 of the scale of each number if None.
        pool: who proves.

    Raises:
        FpsolveError: a curve cannot be proven, or the width is none; nothing is written.
        OutputError: the folder cannot be made or written to, or another run writes into it.
        KeyboardInterrupt: its text says what is kept.
    """
    refuse_unprovable_case(case, width)
    answers, proofs, total = list[Answer](), list[CurveProof](), len(asked_of(case)) * case.planned
    started = datetime.now(UTC)

    def finish() -> None:
        proofs[:], is_whole = gathered(case, answers), len(answers) == total
        if proofs:
            with writable(folder):
                write_proof(case, proofs, folder, is_whole=is_whole)
            write_report(case, folder, watch, show(case, proofs), started=started, files=[PROOF], complete=is_whole)

    with (
        own_folder(case, out, (PROVEN,)) as folder,
        saying_if_interrupted(lambda: kept(len(answers), f"of {total} bounds", folder)),
        watch.bar(Phase(case.name, "proving", total, BOUNDS)) as progress,
        pool,
        shown_at_the_end(finish),
    ):
        records, how = Records(folder / PROVEN_RECORDS), dict[str, Any](kind=PROVEN_BOUNDS, key=_key, keeps=is_kept)
        for _, found, is_known in answered(records, pool, answer, questions(case, width), **how):
            answers.append(found)
            progress(failed=not found.is_proven, known=is_known)
    return proofs


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
