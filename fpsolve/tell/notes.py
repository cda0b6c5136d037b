"""What limits the numbers of parameter sets: notes that differ in numbers alone are one, with the worst of these."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from fpsolve.case.case import MOST_DRAWN, Case, ParameterSet
from fpsolve.case.sections import RESPONSE
from fpsolve.case.vary import map_key
from fpsolve.exponent.quantities import STABILITY_INDEX
from fpsolve.messages import Code, Message, Severity, message_of
from fpsolve.solve.set_result import SetResult, SimulatedSet
from fpsolve.tell.blocks import WORDS, Note
from fpsolve.tell.text import EACH, NAMED, NOTES

MONTE_CARLO = "monte_carlo*.json"
"""The files of all messages of a simulation."""


def notes(
    case: Case, found: Iterable[SetResult | SimulatedSet], file: str = "sets.csv", *, count: int | None = None
) -> Iterator[Note]:
    """What is said of the parameter sets of a case: of whom, what, whose numbers these are, where the others are.

    Args:
        case: whose parameter sets these are.
        found: what was found of them.
        file: that holds all messages; empty where nothing is written.
        count: how many parameter sets there are with those of which nothing is said, if these are left out.
    """
    if count is None:
        found = tuple(found)
        count = len(found)
    groups: dict[Severity, dict[object, list[tuple[Message, ParameterSet]]]] = {severity: {} for severity in WORDS}
    for each in found:
        for severity, messages in each.remarks.items():
            for message in map(message_of, messages):
                is_on_theory = message.code in (Code.STRONG_NOISE, Code.LOAD_LEFT_OUT)
                if not is_on_theory or (file and shows_perturbed_moments(case, count)):
                    groups[severity].setdefault(message.kind, []).append((message, each.parameter_set))
    for severity, kinds in groups.items():
        for group in list(kinds.values())[:NOTES]:
            worst, whose = max(group, key=lambda one: -math.inf if one[0].size is None else one[0].size)
            sets = {parameter_set.number: parameter_set for _, parameter_set in group}
            who, rest = f"{case.name}: {len(sets)} of {count} parameter sets", ""
            if len(sets) <= NAMED:
                named = " and ".join(parameter_set.label for parameter_set in sets.values())
                who = f"{case.name}, {named}" if named else case.name
            if any(message.data != worst.data for message, _ in group):
                words = "these numbers are of" if worst.size is None else "worst for"
                rest = f"; {words} {whose.label}" if len(sets) > 1 else f"; and {len(group) - 1} more like this one"
                rest += f" (all in {file})" if file else ""
            yield Note(severity, f"{who}: {worst}{rest}")
        if (left := len(kinds) - NOTES) > 0:
            yield Note(severity, f"{case.name}: {left} more messages of this kind{f' are in {file}' if file else ''}")


def shows_perturbed_moments(case: Case, count: int) -> bool:
    """Whether the table of so many parameter sets or the figure shows Eq. (37)."""
    has_lines = case.output.figure and case.figure.lines and not map_key(case.figure, case.vary)
    return (case.figure.x == "p" and (count <= EACH or has_lines)) or (case.figure.moment is not None and has_lines)


def note_on(name: str, message: str) -> Note:
    """A message on the whole of what has this name, such as a case."""
    known = message_of(message)
    return Note(known.severity, f"{name}: {known}")


def left_out(case: Case, *, monte_carlo: bool, is_first: bool) -> Iterator[Note]:
    """What a run leaves out: dots of a simulation that has none to give, pictures, and at first what nobody named."""
    told = list[str]()
    if monte_carlo and case.figure.y == STABILITY_INDEX.name:
        told.append("a simulation gives no stability index, so that the figure has no dots of it")
    if case.output.asks_for_eigenfunctions and (why := case.method.no_picture):
        told.append(f"no eigenfunctions are written: {why}")
    if case.leaves_out_response:
        why = f"no stationary response is computed, as there are more than {MOST_DRAWN} parameter sets"
        told.append(f'{why}; name "{RESPONSE}" in [output] quantities to compute its means')
    if case.unasked and is_first:
        told.append(f"fpsolve also computes {', '.join(case.unasked)}: name them in [output] quantities, or add --all")
    yield from (Note(Severity.NOTE, f"{case.name}: {text}") for text in told)
