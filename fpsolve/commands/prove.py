"""`fpsolve prove`: bounds that hold with certainty, and the check of those of a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from pydantic import TypeAdapter

from fpsolve import __version__
from fpsolve.case.case import Case
from fpsolve.commands.errors import print_error
from fpsolve.commands.options import CHECK_FAILED, NOT_CONVERGED, OPTIONS_OF_REPORTS, Reporting
from fpsolve.errors import FpsolveError
from fpsolve.files import writable
from fpsolve.messages import escaped
from fpsolve.output.proofs import PROOF, write_proof
from fpsolve.output.records import Records, append
from fpsolve.pool import Pool, serial
from fpsolve.proofs.certificate import NOTHING, Enclosure, MalformedProof, enclosure_of
from fpsolve.proofs.claims import Claims, claims_from
from fpsolve.proofs.verify import objection
from fpsolve.reading import Unreadable, Words, read_text
from fpsolve.show.proof import show as show_proofs
from fpsolve.study.prove import Answer, CurveProof, Plan, Question, answer, refuse_unprovable_case
from fpsolve.workflow.folders import PROVEN, kept, own_folder, saying_if_interrupted
from fpsolve.workflow.progress import BOUNDS, SILENT, Phase, Watch
from fpsolve.workflow.reports import facts_since, shown_at_the_end

if TYPE_CHECKING:
    from fpsolve.workflow.reports import Reporter


PROVEN_RECORDS = "records/proven"
ENCLOSURES = TypeAdapter(Enclosure)
EVERY = 30.0
"""Seconds after which the curves that are done are written, so that a run that is killed keeps them."""
_WORDS = Words("the proof", "a proof", "proof.json", "JSON", "make one with `fpsolve prove`")


class Kept:
    """Bounds on Λ(p) and λ that an earlier run has proven, each verified anew from its certificate.

    Args:
        folder: of their records.
    """

    def __init__(self, folder: Path) -> None:
        self.records, self._known = Records(folder).look(), dict[str, Enclosure | None]()

    def find(self, question: Question) -> Enclosure | None:
        """What was proven, if it was, and follows."""
        if (key := self._key(question)) not in self._known:
            self._known[key] = self._read(key)
        return self._known[key]

    def add(self, question: Question, found: Answer) -> None:
        """Keep what was proven."""
        if isinstance(found, Enclosure):
            append(self.records.folder, self._key(question), {"enclosure": ENCLOSURES.dump_python(found)})

    def _read(self, key: str) -> Enclosure | None:
        if (address := self.records.address(key)) is None:
            return None
        try:
            found = ENCLOSURES.validate_python(self.records.read(address)["enclosure"])
        except (OSError, ValueError, LookupError, TypeError):
            return None
        if found.certificate is None:
            return found if found == replace(NOTHING, wanted=found.wanted) else None
        whole = enclosure_of(found.certificate)
        is_same = (whole.lower, whole.upper) == (found.lower, found.upper)
        return found if is_same and not objection(found.certificate) else None

    @staticmethod
    def _key(question: Question) -> str:
        """From the function and its arguments; the problem among these follows from what is stated."""
        _, *asked = question.args
        told = [__version__, question.func.__name__, *map(repr, asked), repr(question.keywords)]
        return sha256("\n".join(told).encode()).hexdigest()


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
    pool: Pool | None = None,
    reporter: Reporter | None = None,
    watch: Watch = SILENT,
) -> list[CurveProof]:
    """Prove bounds on Λ at every p of every curve, and on λ, δ_p and excursions; write proof.json into `out`/<case>/.

    Args:
        width: wanted upper − lower; 1e-7 of the scale of each number if None.
        pool: who proves; this process if none is given.
        reporter: writes report.html, if one is wanted.

    Raises:
        FpsolveError: a curve cannot be proven, or the width is none; nothing is written.
        OutputError: the folder cannot be made or written to, or another run writes into it.
        KeyboardInterrupt: its text says what is kept.
    """
    refuse_unprovable_case(case, width)
    plan = Plan(case, width)
    answers, proofs = list[Answer](), list[CurveProof]()
    started = datetime.now(UTC)

    def show() -> None:
        if reporter is not None and proofs:
            facts, is_whole = facts_since(case, started), len(answers) == plan.total
            blocks = show_proofs(case, proofs)
            reporter.write(case, folder, watch, blocks, facts=facts, files=[PROOF], complete=is_whole)

    def write() -> list[CurveProof]:
        proofs = plan.gathered(answers)
        if proofs:
            with writable(folder):
                write_proof(plan.case, proofs, folder, is_whole=len(answers) == plan.total)
        return proofs

    with (
        own_folder(case, out, (PROVEN,)) as folder,
        saying_if_interrupted(lambda: kept(len(answers), f"of {plan.total} bounds", folder)),
        watch.bar(Phase(case.name, "proving", plan.total, BOUNDS)) as progress,
        pool or serial() as workers,
    ):
        written = monotonic()
        with shown_at_the_end(show):
            try:
                kept_bounds = Kept(folder / PROVEN_RECORDS)
                fresh = workers.map(answer, (each for each in plan.questions() if kept_bounds.find(each) is None))
                for question in plan.questions():
                    found: Answer | None = kept_bounds.find(question)
                    is_known = found is not None
                    if found is None:
                        kept_bounds.add(question, found := next(fresh))
                    answers.append(found)
                    progress(failed=not found.is_proven, known=is_known)
                    if monotonic() - written > EVERY and len(answers) % plan.each == 0:
                        write()
                        written = monotonic()
            finally:
                proofs = write()
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


ProvenCases = Annotated[list[Path] | None, Parameter(help="Case files.", consume_multiple=True, negative="")]


def prove(
    cases: ProvenCases = None,
    *,
    width: Annotated[
        float | None,
        Parameter(help="Wanted distance of the bounds, in 1/time; if omitted, 1e-7 of the scale of each number."),
    ] = None,
    check: Annotated[
        Path | None, Parameter(help="Prove nothing, but verify a proof.json from its certificates alone.")
    ] = None,
    options: Reporting = OPTIONS_OF_REPORTS,
) -> int:
    """Prove bounds on the exponents that hold with certainty; write them with certificates into OUT/<case>/proof.json.

    A bound takes at most [budget] seconds of processor time and a third more.
    The bounds on δ_p together take at most twice as much.
    Needs python-flint: pip install 'fpsolve[proof]'.

    Exit codes: 0 proven, 3 bounds are farther apart than wanted; with --check 0 accepted, 1 rejected, 2 malformed.

    Example: fpsolve prove cases/fig1.toml --width 1e-9
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.proof import show as show_proofs
    from fpsolve.show.results import done_of
    from fpsolve.study.prove import refuse_unprovable_case

    if (check is None) == (not cases):
        raise FpsolveError("name either cases to prove, or with --check a proof.json to verify")
    if check is not None:
        if width is not None or options not in (OPTIONS_OF_REPORTS, Reporting(out=options.out, quiet=options.quiet)):
            raise FpsolveError("--check takes a proof.json and nothing else, as that says all that is verified")
        checked = check_proof(check)
        for text in checked.objections:
            print_error(f"{check}: {text}")
        bounds = f"bounds on {checked.claims.count} number{'s' * (checked.claims.count != 1)}"
        if checked.objections:
            objections = f"{len(checked.objections)} objection{'s' * (len(checked.objections) > 1)}"
            print(f"rejected: {escaped(str(check))} ({objections}, {bounds})")
            return CHECK_FAILED
        unfinished = "" if checked.claims.complete else "; what proved them was interrupted"
        print(f"accepted: {escaped(str(check))} ({bounds} follow from their certificates{unfinished})")
        if checked.claims.labels:
            told = "they are labels, as the certificates state matrices or rates, of which the bounds are"
            print(f"note: {', '.join(checked.claims.labels)} were not verified: {told}")
        return 0
    code, reporter = 0, options.reporter()
    loaded = options.load(cases or [])
    for case in loaded:
        refuse_unprovable_case(case, width)
    pool = options.pool()
    for case in loaded:
        start = monotonic()
        proofs = prove_case(case, options.out, width=width, pool=pool, reporter=reporter, watch=options.watch())
        if not options.quiet:
            print_blocks(show_proofs(case, proofs))
        unmet = sum(not each.is_met for each in proofs)
        what = done_of(case, len(proofs), unmet, "not as close as wanted")
        options.print_written(case, what, start)
        if unmet:
            code = NOT_CONVERGED
    return code
