"""What limits the numbers of a case: messages that differ in numbers only are told once, for all their curves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from fpsolve.case.case import MOST_DRAWN, Case, Curve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.exponent.quantities import STABILITY_INDEX
from fpsolve.messages import Message, Severity, message_of
from fpsolve.output.screen import Screen
from fpsolve.study.results import CurveResult, SimulatedCurve

SUMMARY, MONTE_CARLO = "summary.json", "monte_carlo*.json"
STYLES = {
    Severity.FAILURE: ("not converged", "bold red"),
    Severity.WARNING: ("warning", "yellow"),
    Severity.NOTE: ("note", "cyan"),
}
"""How a remark begins, and its colour, in the order in which remarks are told."""
MOST_NAMED, MOST_KINDS = 3, 20
"""Curves that are named, and messages of each severity that are told."""


def print_remarks(
    case: Case,
    found: Sequence[CurveResult | SimulatedCurve],
    file: str = SUMMARY,
    severities: Iterable[Severity] = STYLES,
) -> None:
    """Print what is said of the curves of a case on the standard error: who, what, whose numbers, where the others are.

    Args:
        case: whose curves these are.
        found: what was found of them.
        file: that holds all messages; empty where nothing is written.
        severities: of the messages that are printed, in this order.
    """
    groups: dict[Severity, dict[Any, list[tuple[Message, Curve]]]] = {severity: {} for severity in severities}
    for each in found:
        for severity, kinds in groups.items():
            for message in map(message_of, each.remarks.get(severity, ())):
                kinds.setdefault(message.kind, []).append((message, each.curve))
    for severity, kinds in groups.items():
        for group in list(kinds.values())[:MOST_KINDS]:
            worst, whose = max(group, key=lambda one: -math.inf if one[0].size is None else one[0].size)
            curves = {curve.number: curve for _, curve in group}
            who, rest = f"{case.name}: {len(curves)} of {len(found)} curves", ""
            if len(curves) <= MOST_NAMED:
                *others, last = [curve.label for curve in curves.values()]
                comma = "; " if any("," in label for label in (*others, last)) else ", "
                named = " and ".join(filter(None, (comma.join(others), last)))
                who = f"{case.name}, {named}" if named else case.name
            if any(message.data != worst.data for message, _ in group):
                words = "these numbers are of" if worst.size is None else "most for"
                rest = f"; {words} {whose.label}" if len(curves) > 1 else f"; and {len(group) - 1} more like this one"
                rest += f" (all in {file})" if file else ""
            print_remark(f"{who}: {worst.words(CASE_WORDS)}{rest}", severity)
        if (left := len(kinds) - MOST_KINDS) > 0:
            print_remark(f"{case.name}: {left} more of this kind{f' are in {file}' if file else ''}", severity)


def print_remark(text: str, severity: Severity = Severity.NOTE) -> None:
    """A sentence on the standard error, in lines that fit, indented from the second on."""
    word, style = STYLES[severity]
    Screen.of(errors=True).say(f"{word}: {text}", style)


def note_missing(case: Case, *, monte_carlo: bool) -> None:
    """What a run leaves out: dots of a simulation that has none to give, eigenfunctions of too many curves."""
    if monte_carlo and case.figure.y == STABILITY_INDEX.name:
        print_remark(f"{case.name}: a simulation gives no stability index, so that the figure has no dots")
    if case.leaves_out_eigenfunctions:
        why = f"no eigenfunctions are written, as there are more than {MOST_DRAWN} curves"
        wanted = f"name the p that you want, as in [output] eigenfunctions = [{case.usual_p!r}]"
        print_remark(f"{case.name}: {why}; {wanted}")
