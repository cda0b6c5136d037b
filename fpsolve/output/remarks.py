"""What limits the numbers of a case: sentences that differ in numbers only are told once, for all their curves."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from fpsolve.case.case import MOST_DRAWN, Case
from fpsolve.case.curves import Curve
from fpsolve.exponent.quantities import STABILITY_INDEX
from fpsolve.output.screen import Screen
from fpsolve.study.results import CurveResult, SimulatedCurve

WARNING, FAILURE, NOTE = "warning", "not converged", "note"
STYLES = {FAILURE: "bold red", WARNING: "yellow", NOTE: "cyan"}
"""The kinds of remarks in the order in which they are told."""
MOST_NAMED, MOST_KINDS = 3, 20
"""Curves that are named, and sentences of each kind that are told."""
_NUMBER = r"(?<![\w.])(?<!Eq\. \()[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?%?(?!\w)"
_LIST = re.compile(rf"{_NUMBER}(?:(?:, | and |, and ){_NUMBER})*")
_MEASURES = re.compile(r"(\S+)%|estimated error of (\S+?)[;,]?(?= |$)")
"""Numbers that tell how bad it is."""


@dataclass
class _Group:
    """The sentences that differ in numbers only.

    Attributes:
        text, place: the worst one, or else the first, and the label of its curve.
        worst: how bad that one is; None where nothing tells.
        labels: of the first curves that have one.
        curves, count: how many curves have one, and how many there are.
        is_varied: whether they differ at all.
    """

    text: str
    place: str
    worst: float | None
    labels: list[str] = field(default_factory=list)
    curves: int = 0
    count: int = 0
    is_varied: bool = False
    last: int = 0

    def add(self, text: str, curve: Curve) -> None:
        self.is_varied |= text != self.text
        self.count += 1
        if curve.number != self.last:
            self.last, self.curves = curve.number, self.curves + 1
            if len(self.labels) < MOST_NAMED:
                self.labels.append(curve.label)
        measure = _measure(text)
        if measure is not None and self.worst is not None and measure > self.worst:
            self.text, self.place, self.worst = text, curve.label, measure


class Remarks:
    """The remarks on the curves of a case, which are told in the end.

    Args:
        case: whose curves these are.
        file: that holds all of them; none where nothing is written.
        kinds: those that are told.
    """

    def __init__(self, case: Case, file: str = "", kinds: Sequence[str] = tuple(STYLES)) -> None:
        self.case, self.file, self.kinds = case, file, kinds
        self._groups: dict[tuple[str, str], _Group] = {}
        self._curves = 0

    def add_result(self, result: CurveResult) -> None:
        """All that is said of a curve that is solved."""
        failures = [failure.reason for failure in result.failures]
        self.add(result.curve, {WARNING: result.warnings, FAILURE: failures, NOTE: result.notes})

    def add_simulated(self, simulated: SimulatedCurve) -> None:
        """All that is said of a curve that is simulated."""
        self.add(simulated.curve, {WARNING: simulated.warnings})

    def add(self, curve: Curve, texts: dict[str, Sequence[str]]) -> None:
        """What is said of a curve, by its kind."""
        self._curves += 1
        for kind in self.kinds:
            for text in texts.get(kind, ()):
                found = self._groups.setdefault((kind, _pattern(text)), _Group(text, curve.label, _measure(text)))
                found.add(text, curve)

    def tell(self) -> None:
        """Print them on the standard error."""
        screen = Screen.of(errors=True)
        for kind in self.kinds:
            groups = [group for (each, _), group in self._groups.items() if each == kind]
            for group in groups[:MOST_KINDS]:
                screen.say(f"{kind}: {self._sentence(group)}", STYLES[kind])
            if more := len(groups) - MOST_KINDS if len(groups) > MOST_KINDS else 0:
                where = f" are in {self.file}" if self.file else ""
                screen.say(f"{kind}: {self.case.name}: {more} more of this kind{where}", STYLES[kind])

    def _sentence(self, group: _Group) -> str:
        """Who, what, whose the numbers are, and where the others are."""
        return "".join([self._who(group), ": ", group.text, *self._rest(group)])

    def _who(self, group: _Group) -> str:
        named = _listed(group.labels)
        if group.curves > MOST_NAMED:
            return f"{self.case.name}: {group.curves} of {self._curves} curves"
        return f"{self.case.name}, {named}" if named else self.case.name

    def _rest(self, group: _Group) -> Iterator[str]:
        if not group.is_varied:
            return
        if group.curves > 1:
            yield f"; {'these numbers are of' if group.worst is None else 'most for'} {group.place}"
        else:
            yield f"; and {group.count - 1} more like this one"
        if self.file:
            yield f" (all in {self.file})"


def print_remark(text: str, kind: str = NOTE) -> None:
    """A sentence on the standard error, in lines that fit, indented from the second on."""
    Screen.of(errors=True).say(f"{kind}: {text}", STYLES[kind])


def _listed(labels: Sequence[str]) -> str:
    """Some labels, which may hold commas, as one text: "noise.D0 = 1, noise.D0 = 2 and noise.D0 = 3"."""
    if len(labels) == 1:
        return labels[0]
    comma = "; " if any("," in label for label in labels) else ", "
    return f"{comma.join(labels[:-1])} and {labels[-1]}"


def _pattern(text: str) -> str:
    """A sentence without its numbers; those of equations remain."""
    return _LIST.sub("#", text)


def _measure(text: str) -> float | None:
    """The last number of a sentence that tells how bad it is, if one does."""
    found = [number for pair in _MEASURES.findall(text) for number in pair if number]
    try:
        return float(found[-1]) if found else None
    except ValueError:
        return None


def note_missing(case: Case, *, monte_carlo: bool) -> None:
    """What a run leaves out: dots of a simulation that has none to give, eigenfunctions of too many curves."""
    if monte_carlo and case.figure.y == STABILITY_INDEX.name:
        print_remark(f"{case.name}: a simulation gives no stability index, so that the figure has no dots")
    if case.leaves_out_eigenfunctions:
        why = f"no eigenfunctions are written, as there are more than {MOST_DRAWN} curves"
        wanted = f"name the p that you want, as in [output] eigenfunctions = [{case.usual_p!r}]"
        print_remark(f"{case.name}: {why}; {wanted}")
