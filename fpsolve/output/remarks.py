"""What limits the numbers of a case: messages that differ in numbers only are told once, for all their curves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from fpsolve.case.case import MOST_DRAWN, Case, Curve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.exponent.quantities import STABILITY_INDEX
from fpsolve.messages import Message, Severity, message_of
from fpsolve.output.screen import Screen
from fpsolve.study.results import CurveResult, SimulatedCurve

STYLES = {
    Severity.FAILURE: ("not converged", "bold red"),
    Severity.WARNING: ("warning", "yellow"),
    Severity.NOTE: ("note", "cyan"),
}
"""How a remark begins, and its colour, in the order in which remarks are told."""
MOST_NAMED, MOST_KINDS = 3, 20
"""Curves that are named, and messages of each severity that are told."""


@dataclass
class _Group:
    """The messages that differ in numbers only.

    Attributes:
        message, curve: the worst one, or else the first, and whose it is.
        labels: of the first curves that have one.
        curves, count: how many curves have one, and how many there are.
        is_varied: whether they differ at all.
    """

    message: Message
    curve: Curve
    labels: list[str] = field(default_factory=list)
    curves: int = 0
    count: int = 0
    is_varied: bool = False
    last: int = 0

    def add(self, message: Message, curve: Curve) -> None:
        self.is_varied |= message.data != self.message.data
        self.count += 1
        if curve.number != self.last:
            self.last, self.curves = curve.number, self.curves + 1
            if len(self.labels) < MOST_NAMED:
                self.labels.append(curve.label)
        if message.size is not None and (self.message.size is None or message.size > self.message.size):
            self.message, self.curve = message, curve


def print_remarks(
    case: Case,
    found: Sequence[CurveResult | SimulatedCurve],
    file: str = "",
    severities: Iterable[Severity] = STYLES,
) -> None:
    """Print what is said of the curves of a case on the standard error: who, what, whose numbers, where the others are.

    Args:
        case: whose curves these are.
        found: what was found of them.
        file: that holds all messages; none where nothing is written.
        severities: of the messages that are printed, in this order.
    """
    groups: dict[Severity, dict[Any, _Group]] = {severity: {} for severity in severities}
    for each in found:
        texts: dict[Severity, Sequence[str]] = {Severity.WARNING: each.warnings}
        if isinstance(each, CurveResult):
            texts |= {Severity.NOTE: each.notes, Severity.FAILURE: [failure.reason for failure in each.failures]}
        for severity, kinds in groups.items():
            for message in map(message_of, texts.get(severity, ())):
                kinds.setdefault(message.kind, _Group(message, each.curve)).add(message, each.curve)
    for severity, kinds in groups.items():
        for group in list(kinds.values())[:MOST_KINDS]:
            who, rest = f"{case.name}: {group.curves} of {len(found)} curves", ""
            if group.curves <= MOST_NAMED:
                comma = "; " if any("," in label for label in group.labels) else ", "
                named = " and ".join(filter(None, (comma.join(group.labels[:-1]), group.labels[-1])))
                who = f"{case.name}, {named}" if named else case.name
            if group.is_varied:
                whose = "these numbers are of" if group.message.size is None else "most for"
                more = f"and {group.count - 1} more like this one"
                rest = f"; {whose} {group.curve.label}" if group.curves > 1 else f"; {more}"
                rest += f" (all in {file})" if file else ""
            print_remark(f"{who}: {group.message.words(CASE_WORDS)}{rest}", severity)
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
