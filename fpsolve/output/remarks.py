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

    def sentence(self, case: Case, of: int, file: str) -> str:
        """Who, what, whose the numbers are, and where the others are."""
        if self.curves > MOST_NAMED:
            who = f"{case.name}: {self.curves} of {of} curves"
        else:
            comma = "; " if any("," in label for label in self.labels) else ", "
            named = " and ".join(filter(None, (comma.join(self.labels[:-1]), self.labels[-1])))
            who = f"{case.name}, {named}" if named else case.name
        rest = ""
        if self.is_varied:
            whose = "these numbers are of" if self.message.size is None else "most for"
            rest = f"; {whose} {self.curve.label}" if self.curves > 1 else f"; and {self.count - 1} more like this one"
            rest += f" (all in {file})" if file else ""
        return f"{who}: {self.message.words(CASE_WORDS)}{rest}"


class Remarks:
    """The remarks on the curves of a case, which are told in the end.

    Args:
        case: whose curves these are.
        file: that holds all of them; none where nothing is written.
        told: the severities of those that are told.
    """

    def __init__(self, case: Case, file: str = "", told: Iterable[Severity] = STYLES) -> None:
        self.case, self.file = case, file
        self._groups: dict[Severity, dict[Any, _Group]] = {severity: {} for severity in told}
        self._curves = 0

    def add(self, found: CurveResult | SimulatedCurve) -> None:
        """All that is said of a curve."""
        self._curves += 1
        texts: dict[Severity, Sequence[str]] = {Severity.WARNING: found.warnings}
        if isinstance(found, CurveResult):
            texts |= {Severity.NOTE: found.notes, Severity.FAILURE: [each.reason for each in found.failures]}
        for severity, groups in self._groups.items():
            for message in map(message_of, texts.get(severity, ())):
                groups.setdefault(message.kind, _Group(message, found.curve)).add(message, found.curve)

    def tell(self) -> None:
        """Print them on the standard error."""
        for severity, groups in self._groups.items():
            for group in list(groups.values())[:MOST_KINDS]:
                print_remark(group.sentence(self.case, self._curves, self.file), severity)
            if (more := len(groups) - MOST_KINDS) > 0:
                where = f" are in {self.file}" if self.file else ""
                print_remark(f"{self.case.name}: {more} more of this kind{where}", severity)


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
