"""Solving the sets of a case one by one: each begins anew, so that its numbers follow from its parameters alone.

(To start from a neighbour's mesh saves half of the time of one p in strong noise, and nothing of several p, or in weak
noise.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from time import process_time

import numpy as np

from fpsolve.budget import begin
from fpsolve.case.case import Case
from fpsolve.case.refusals import obstacle
from fpsolve.exponent.error import Failure
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.quantities import SUMMARY_NUMBERS
from fpsolve.messages import Code, Message, Severity, message_of
from fpsolve.model.quantity import LYAPUNOV_EXPONENT
from fpsolve.solve.moments import QUESTION as MOMENTS
from fpsolve.solve.moments import Moments
from fpsolve.solve.question import UNFINISHED, Asked, Entry, Job, Limit, Question, Reason, attempt
from fpsolve.solve.questions import BY_NAME, QUESTIONS
from fpsolve.solve.set_result import NO_MOMENTS, SetResult

ANEW: Limit = (0.0, 0.0)
"""The limit of what failed for a reason that may be gone the next time."""


def everything(case: Case, number: int = 1) -> Asked:
    """What a case asks for, of the parameter set with a number."""
    asked = {each.name: each.asked(case, number) for each in QUESTIONS if each.solve}
    return {name: settings for name, settings in asked.items() if settings is not None}


def solve_set(job: Job) -> Job:
    """Solve what is not known of a parameter set, one after the other; what is missing is an entry with its reason."""
    p = job.asked[MOMENTS.name]["p"]
    job.meter.planned = len(p) + sum(bool(BY_NAME[name].symbol) for name in job.asked)
    with job.meter.running():
        if MOMENTS.name not in job.entries:  # moments of even order take little
            attempt(lambda: [job.solver.method.even(each) for each in p], MOMENTS.symbol)
        first = [BY_NAME[LYAPUNOV_EXPONENT.name]] if choose(job.parameter_set.problem).is_dear(0.0) else []
        for each in dict.fromkeys((*first, *QUESTIONS)):
            is_known = each.name in job.entries
            if each.solve is None or each.name not in job.asked or (is_known and not each.draws):
                continue
            if each is not MOMENTS:
                begin(each.symbol)
            started = process_time()
            found = attempt(partial(each.solve, job, job.asked[each.name]), each.symbol)
            if is_known:  # it was drawn again, and its numbers stay as they are
                continue
            job.add(each.name, _entry(job, each, found, process_time() - started))
            if each is MOMENTS and isinstance(found, Reason):  # nor will there be anything else
                break
    return job


def _entry(job: Job, question: Question, found: object, seconds: float) -> Entry[object]:
    """What became of a question."""
    reason = found if isinstance(found, Reason) else None
    if reason:
        doubts = [reason.message]
    else:
        said = question.said(found, job.parameter_set, job.numerics)
        doubts = [
            *question.lacks(found, job.asked[question.name]),
            *(each for each in said if each.severity is not Severity.NOTE),
        ]
    may_pass = any(each.tells_of(code) for each in doubts for code in (Code.NO_MEMORY, Code.FAULT))
    limit = ANEW if may_pass else job.numerics.limit if doubts else None
    return Entry(None if reason else found, reason, seconds, limit)


def attempt_set(job: Job) -> Job:
    """Solve what is not known of a set; one which contradicts itself, or overflows, fails."""
    p = np.array(job.asked[MOMENTS.name]["p"])
    if text := obstacle(job.parameter_set.base, job.parameter_set.varied, p, with_moments=False):
        found: Job | Reason = Reason("failed", message_of(f"{job.line}{text}"), job.parameter_set.label)
    else:
        found = attempt(partial(solve_set, job), job.parameter_set.label)
    if isinstance(found, Reason):
        job.add(MOMENTS.name, Entry(None, found, limit=ANEW))
    return job


def result_of(job: Job) -> SetResult:
    """What is known of a set, as one result; why something is missing is in its `failures`, `warnings` or `notes`."""
    parameter_set, asked, entries = job.parameter_set, job.asked, job.entries
    if (entry := entries.get(MOMENTS.name)) and entry.reason:
        reason = Failure(None, entry.reason.message)
        return SetResult(parameter_set, NO_MOMENTS, failures=(reason,))
    known = {name: entry.found for name, entry in entries.items() if name in asked and entry.found is not None}
    moments: Moments = known.get(MOMENTS.name, Moments())
    said: dict[Severity, list[Message]] = {each: [] for each in Severity}
    reasons = list[tuple[Question, Reason]]()
    for each in QUESTIONS:
        if each.name in known:
            for message in each.said(known[each.name], parameter_set, job.numerics):
                said[message.severity].append(message)
        elif (entry := entries.get(each.name)) and entry.reason and each.name in asked and each.symbol:
            reasons.append((each, entry.reason))
    for message in missing(reasons, moments.failures):
        if job.numerics.is_stated or not message.tells_of(Code.NOT_ONE_RAY):
            said[message.severity].append(message)
    is_whole = all(name in entries or BY_NAME[name].draws for name in asked)
    failures = moments.failures or tuple(Failure(None, message) for message in said[Severity.FAILURE])
    return SetResult(
        parameter_set=parameter_set,
        moments=job.columns,
        parts=known,
        warnings=tuple(said[Severity.WARNING]),
        notes=tuple(said[Severity.NOTE]),
        failures=failures if is_whole else (*failures, Failure(None, UNFINISHED)),
        seconds=sum(entry.seconds for name, entry in entries.items() if name in asked),
    )


def missing(reasons: Sequence[tuple[Question, Reason]], failures: Sequence[Failure]) -> Iterator[Message]:
    """What is said of numbers that are missing, of summary numbers with one reason together.

    Args:
        reasons: by the questions.
        failures: the p at which Λ(p) failed, which others may follow from.
    """
    unsolved = {each.reason: Message(Code.NO_MOMENT, p=each.p) for each in failures if each.p is not None}
    codes = {"absent": Code.NUMBER_ABSENT, "impossible": Code.NUMBER_MISSING}
    failing = Code.NUMBER_MISSING if failures else Code.NUMBER_FAILED
    groups = dict[tuple[Code, Message, str], list[str]]()
    for question, reason in reasons:
        message, code = reason.message, codes.get(reason.kind, failing)
        is_summary_number = question.name in SUMMARY_NUMBERS
        if is_summary_number and reason.kind == "failed":
            message = unsolved.get(message, message)
        if is_summary_number or message.severity is Severity.FAILURE:
            group = "" if is_summary_number else question.name
            groups.setdefault((code, message, group), []).append(reason.symbol)
        else:
            yield message
    for (code, message, _), symbols in groups.items():
        yield Message(code, symbols=symbols, reason=message)
