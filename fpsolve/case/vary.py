"""[vary] of a case file: the parameter sets of lists, of ranges, or of a file of comma-separated values."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError, ValidationInfo
from pydantic.fields import FieldInfo

from fpsolve.case.kinds import parameters_of
from fpsolve.case.messages import (
    DEPENDENT,
    Refusal,
    explain,
    nearest,
    own_faults,
    refuse,
    shortened,
    shown,
    shown_with_kind,
    too_long,
)
from fpsolve.case.reading import Unreadable, Words, read_text
from fpsolve.case.sections import MAX_MOMENTS, Sweep, Value, Values, flat, same
from fpsolve.model.faults import accepted, choices
from fpsolve.model.parameters import STRICT, meaning_of
from fpsolve.model.quantity import Quantity

EXAMPLE = '[vary] with "noise.D0" = [0.1, 0.5, 1.0]'
_WORDS = Words(
    *("the sets", "a file of sets", "sets.csv", "comma-separated"),
    start="its first row must name keys, as in noise.D0,noise.tau0",
    may_have_mark=True,
)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(e[+-]?\d+)?", re.IGNORECASE)
Columns = dict[str, tuple[Value, ...]]
Known = Mapping[str, FieldInfo]
"""The parameters of a case by their keys, each with its range."""


def values_of(known: FieldInfo, most: int | None = None) -> TypeAdapter[Values]:
    """What a list of values of a parameter must be, with at most so many entries."""
    kind = Annotated[
        tuple[Annotated[float, Field(), *known.metadata], ...],
        Field(strict=False, min_length=1, max_length=most),
    ]
    return TypeAdapter(kind, config=STRICT)


@dataclass(frozen=True)
class Vary:
    """The parameter sets of a case: all combinations of some values, or values side by side.

    Attributes:
        columns: the values of each varied key; of a product its distinct values, else one for each set.
        mode: "product" for all combinations, the last key varying fastest, or "zip" for values side by side.
    """

    columns: Mapping[str, tuple[Value, ...]] = field(default_factory=dict)
    mode: Literal["product", "zip"] = "product"

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied keys."""
        return tuple(self.columns)

    def __len__(self) -> int:
        """How many parameter sets there are; one where nothing is varied."""
        lengths = map(len, self.columns.values())
        return math.prod(lengths) if self.mode == "product" else next(lengths, 1)

    def __bool__(self) -> bool:
        """Whether anything is varied."""
        return bool(self.columns)

    def values(self, key: str) -> tuple[Value, ...]:
        """The distinct values of a key in the order in which they appear."""
        return tuple(dict.fromkeys(self.columns[key]))

    def is_text(self, key: str) -> bool:
        """Whether the values of a varied key are texts."""
        return isinstance(next(iter(self.columns[key]), 0.0), str)

    def sets(self, start: int = 0, stop: int | None = None) -> Iterator[dict[str, Value]]:
        """The varied values of each set from one place to another, any place reached at once."""
        return map(self._set, range(len(self))[start:stop])

    def among(self, keys: Iterable[str]) -> Iterator[dict[str, Value]]:
        """The distinct sets of some of the keys."""
        wanted = set(keys)
        chosen = {key: values for key, values in self.columns.items() if key in wanted}
        seen = dict.fromkeys(tuple(each.items()) for each in Vary(chosen, self.mode).sets())
        return map(dict, seen)

    def _set(self, place: int) -> dict[str, Value]:
        if self.mode == "zip":
            return {key: values[place] for key, values in self.columns.items()}
        chosen = []
        for values in reversed(list(self.columns.values())):
            place, at = divmod(place, len(values))
            chosen.append(values[at])
        return dict(zip(self.columns, reversed(chosen), strict=True))


@dataclass(frozen=True)
class FileVary(Vary):
    """The sets of a file.

    Attributes:
        file: its name, for messages.
        lines: where each set stands.
        faults: what is wrong in other rows, with their lines.
    """

    file: str = ""
    lines: tuple[int, ...] = ()
    faults: tuple[tuple[int, str], ...] = ()


def written(value: Value, style: str = "g") -> str:
    """A value of a varied key for the eye: a number in a format, a text as it is."""
    return value if isinstance(value, str) else f"{value:{style}}"


def assignments(varied: Mapping[str, Value], style: str = "") -> str:
    """Keys with their values, these in a format: "noise.D0 = 0.1, noise.r0 = 0.9"."""
    return ", ".join(f"{key} = {written(value, style)}" for key, value in varied.items())


def legend(varied: Mapping[str, Value], about: Callable[[str], Quantity]) -> str:
    r"""The same for a figure, by what the keys are: "$D_0$ = 0.1/time, treatment = exact"."""
    return ", ".join(about(key).stated(value) for key, value in varied.items())


def groups(values: Sequence[Value]) -> list[int]:
    """For each value the place of the first one that is the same."""
    if isinstance(values[0], str):
        seen: dict[Value, int] = {}
        return [seen.setdefault(value, i) for i, value in enumerate(values)]
    order = sorted(range(len(values)), key=values.__getitem__)
    runs: list[list[int]] = []
    for place in order:
        if runs and same(values[runs[-1][-1]], values[place]):
            runs[-1].append(place)
        else:
            runs.append([place])
    first = {place: min(run) for run in runs for place in run}
    return [first[i] for i in range(len(values))]


def repeats(columns: Mapping[str, tuple[Value, ...]]) -> Iterator[tuple[int, int]]:
    """The places of sets side by side that stand there already, each with the first place."""
    seen: dict[tuple[int, ...], int] = {}
    for i, row in enumerate(zip(*map(groups, columns.values()), strict=True)):
        if (first := seen.setdefault(row, i)) != i:
            yield i, first


def vary_of(value: Any, info: ValidationInfo) -> Vary:
    """What [vary] means; a `Vary` is left. Raises ValidationError with all that is wrong with it.

    Of a file the rows that are wrong by themselves are not raised, but among the faults of its `FileVary`.
    """
    context = info.context or {}
    parameters = parameters_of(info.data, context)
    if isinstance(value, Vary):
        return value
    if not isinstance(value, dict):
        text = f"got {shown_with_kind(value)}; must be a table of lists and ranges; write, for example, {EXAMPLE}"
        refuse([((), value, text)])
    if parameters is None:
        refuse([((), value, DEPENDENT)])
        return Vary()
    table = flat(value, parameters)
    if "file" in table:
        return _of_file(table, parameters, context.get("folder", Path()))
    mode = table.pop("mode", "product")
    columns, refusals = Columns(), list[Refusal]()
    if mode not in ("product", "zip"):
        guess = nearest(mode, ("product", "zip")) if isinstance(mode, str) else ""
        text = f'got {shown_with_kind(mode)}; must be one of "product", "zip";{guess} write mode = "zip", or remove it'
        refusals.append((("mode",), mode, text))
    for key, item in table.items():
        if key in parameters:
            refusals += _column(key, item, parameters[key], columns)
        else:
            known = (*parameters, "mode", "file")
            text = f"cannot be varied;{nearest(key, known)} known keys: {', '.join(known)}; rename or remove it"
            refusals.append(((key,), item, text))
    refuse(refusals)
    refuse(_uneven(columns) if mode == "zip" else _repeated(columns))
    return Vary(columns, mode)


def _of_file(table: Mapping[str, Any], parameters: Known, folder: Path) -> FileVary:
    """The sets of a file, beside which nothing else may stand."""
    file, mode = table["file"], table.get("mode", "zip")
    others = [key for key in table if key not in ("file", "mode")]
    if not isinstance(file, str) or not file:
        text = f'got {shown_with_kind(file)}; must be the path of a file of sets; write, for example, file = "sets.csv"'
        refuse([(("file",), file, text)])
    if others:
        text = f"gives every value, so nothing may stand beside it, but {', '.join(others)} does; remove that, or file"
        refuse([(("file",), file, f"{text}, as by --set 'vary={{ file = {shown(file)} }}'")])
    if mode != "zip":
        text = f"got {shown(mode)}; the rows of a file are sets side by side; remove it"
        refuse([(("mode",), mode, text)])
    try:
        return read_sets(file, folder, parameters)
    except Unreadable as error:
        place = file if error.line is None else f"{file}:{error.line}"
        refuse([(("file",), file, f"{place}: {error.sentence}")])
        raise


def _column(key: str, values: Any, field: FieldInfo, columns: Columns) -> Iterator[Refusal]:
    """What is wrong with the values of a key; without faults these join the columns."""
    if texts := choices(field.annotation):
        yield from _texts(key, values, texts)
        columns[key] = tuple(values) if isinstance(values, list | tuple) else ()
    elif isinstance(values, dict) and values:
        yield from _range(key, values, field, columns)
    else:
        try:
            columns[key] = values_of(field, MAX_MOMENTS).validate_python(values)
        except ValidationError as error:
            yield from (((key, *detail["loc"]), detail["input"], too_long(detail)) for detail in own_faults(error))


def _texts(key: str, values: Any, texts: Sequence[str]) -> Iterator[Refusal]:
    known = ", ".join(f'"{text}"' for text in texts)
    if not isinstance(values, list | tuple) or not values:
        text = f"got {shown_with_kind(values)}; must be a non-empty list of {known}; write, for example, "
        yield (key,), values, f"{text}{key} = [{known}]"
        return
    for i, value in enumerate(values):
        if value not in texts:
            guess = nearest(value, texts) if isinstance(value, str) else ""
            text = f"got {shown_with_kind(value)}; must be one of {known};{guess} write one of them"
            yield (key, i), value, text


def _range(key: str, table: Mapping[str, Any], field: FieldInfo, columns: Columns) -> Iterator[Refusal]:
    """A range; where its ends are in the range of the key, so are the values between them."""
    try:
        sweep = Sweep(**table)
    except ValidationError as error:
        faults = explain(error, Sweep.__pydantic_fields__)
        yield from (((key, *path), table, sentence) for path, _, sentence in faults)
        return
    wrong = [end for end in ("start", "stop") if any(_invalid(field, [getattr(sweep, end)]))]
    yield from (((key, end), getattr(sweep, end), "") for end in wrong)
    values = tuple(sweep.values.tolist())
    if len(set(groups(values))) < len(values):
        text = f"got num = {sweep.num}, which makes values equal to 12 digits; use a smaller num, or ends further apart"
        yield (key, "num"), sweep.num, text
    elif not wrong:
        columns[key] = values


def _invalid(field: FieldInfo, values: Sequence[float]) -> list[bool]:
    """Which values are out of the range of a parameter."""
    wrong = [False] * len(values)
    try:
        values_of(field).validate_python(values)
    except ValidationError as error:
        for detail in own_faults(error):
            wrong[int(detail["loc"][0])] = True
    return wrong


def _repeated(columns: Columns) -> Iterator[Refusal]:
    """The values of a product that a key has already."""
    for key, values in columns.items():
        first = groups(values)
        for i, value in enumerate(values):
            if first[i] != i:
                yield (key, i), value, f"got {value} twice; values must be distinct; remove one of them"


def _uneven(columns: Columns) -> Iterator[Refusal]:
    """Lists side by side of several lengths, or a set that stands twice."""
    lengths = {key: len(values) for key, values in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{key} has {length}" for key, length in lengths.items())
        text = f'{told}; with mode = "zip" all must have one length; complete the shorter ones, or use mode = "product"'
        yield (), None, text
        return
    vary = Vary(columns, "zip")
    for place, first in repeats(columns):
        [varied] = vary.sets(place, place + 1)
        text = f"sets {first + 1} and {place + 1} are both {assignments(varied)}; must be distinct; remove one of them"
        yield (next(iter(columns)), place), varied, text


@dataclass
class _Table:
    """The header of a file and its rows that are as long as it, with their lines; what is wrong with others."""

    first: int = 0
    header: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    faults: list[tuple[int, str]] = field(default_factory=list)


def read_sets(file: str, folder: Path, parameters: Known) -> FileVary:
    """The sets of a file, with the faults of its rows.

    Raises:
        Unreadable: there is no table in it.
    """
    table = _table(read_text(folder / file, _WORDS))
    unknown = _header_faults(table.header, parameters)
    faults, columns = [(table.first, reason) for reason in unknown] + table.faults, {}
    wrong: set[int] = set()
    for key, cells in zip(table.header, zip(*table.rows, strict=True), strict=False):
        if key not in parameters:
            continue
        values, reasons = _cells(cells, parameters[key])
        faults += [(table.lines[i], f"{key}: {reason}") for i, reason in reasons.items()]
        columns[key] = values
        wrong |= reasons.keys()
    good = [i for i in range(len(table.lines)) if i not in wrong and not unknown]
    lines = tuple(table.lines[i] for i in good)
    kept = {key: tuple(values[i] for i in good) for key, values in columns.items()}
    for place, first in repeats(kept) if good else ():
        faults.append((lines[place], f"is the same set as line {lines[first]}; must be distinct; remove one of them"))
    return FileVary(kept, "zip", file, lines, tuple(faults))


def _table(text: str) -> _Table:
    """The cells of a file. Raises Unreadable where there are no rows, no commas, or wrong quotes."""
    reader, table = csv.reader(io.StringIO(text, newline=""), strict=True), _Table()
    line = 1
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells) and not table.header:
                if len(cells) == 1 and re.search(r"[;\t]", cells[0]):
                    mark = "semicolons" if ";" in cells[0] else "tabs"
                    raise Unreadable(f"is separated by {mark}; write commas, and decimal points in the numbers", line)
                table.header, table.first = cells, line
            elif any(cells) and len(cells) != len(table.header):
                table.faults.append((line, _wrong_length(cells, table.header)))
            elif any(cells):
                table.rows.append(cells)
                table.lines.append(line)
            line = reader.line_num + 1
    except csv.Error as error:
        raise Unreadable(f"cannot be read as comma-separated values ({error}); mend its quotes", line) from None
    if not table.header or not (table.rows or table.faults):
        raise Unreadable("has a header but no sets; write a row of values for each set")
    return table


def _header_faults(header: Sequence[str], parameters: Known) -> list[str]:
    """What of a header is no key, or there already."""
    reasons, known = list[str](), f"known keys: {', '.join(parameters)}; rename or remove it"
    for i, key in enumerate(header):
        if not key:
            reasons.append(f"column {i + 1}: has no key in the header; {known}")
        elif key not in parameters:
            reasons.append(f"{shortened(key)}: cannot be varied;{nearest(key, parameters)} {known}")
        elif key in header[:i]:
            reasons.append(f"{key}: stands twice in the header; remove one of them")
    return reasons


def _wrong_length(cells: Sequence[str], header: Sequence[str]) -> str:
    text = f"has {len(cells)} cell{'s' if len(cells) > 1 else ''}; must have {len(header)}, one for each key"
    if len(cells) == 1 and ";" in cells[0]:
        return f"{text}; write commas between them, and decimal points in the numbers"
    if len(cells) < len(header):
        return f"{text}; add those that are missing"
    return f"{text}; remove the others, and write decimal points, not commas, in the numbers"


def _cells(cells: Sequence[str], field: FieldInfo) -> tuple[Sequence[Value], dict[int, str]]:
    """The values in cells, 0 without a sign, and what is wrong with some, by their places."""
    if texts := choices(field.annotation):
        told = ", ".join(texts)
        return cells, {
            i: f"{_got(cell)}; must be one of {told};{nearest(cell, texts)} write one of them"
            for i, cell in enumerate(cells)
            if cell not in texts
        }
    values, wrong = list[float](), dict[int, str]()
    must = f"must be {accepted(field)} ({meaning_of(field)})"
    for i, cell in enumerate(cells):
        try:
            values.append(float(cell) + 0.0)
        except ValueError:
            values.append(math.nan)
            remedy = "write commas between cells, and decimal points in numbers" if ";" in cell else "write a number"
            if _DECIMAL_COMMA.fullmatch(cell):
                remedy = f"write the decimal point as {cell.replace(',', '.')}"
            wrong[i] = f"{_got(cell)}; {must}; {remedy}"
    for i, is_wrong in enumerate(_invalid(field, values)):
        if is_wrong and i not in wrong:
            wrong[i] = f"{_got(cells[i])}; {must}; change it, or remove the row"
    return values, wrong


def _got(cell: str) -> str:
    return f"got {shortened(cell)}" if cell else "is empty"
