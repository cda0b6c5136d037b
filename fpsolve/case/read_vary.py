"""[vary] of a case file: what its lists, its ranges and its file of comma-separated values mean."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError, ValidationInfo
from pydantic.fields import FieldInfo

from fpsolve.arrays import shortened
from fpsolve.case.explain import (
    DEPENDENT,
    Refusal,
    explain,
    faults_in,
    is_list,
    nearest,
    quoted,
    refuse,
    shown,
    shown_with_kind,
    too_long,
)
from fpsolve.case.kinds import parameters_of
from fpsolve.case.sections import MAX_MOMENTS, Sweep, Values, flat
from fpsolve.case.vary import Column, Columns, Vary, assignments, repeats
from fpsolve.files import Unreadable, Words, read_text
from fpsolve.model.faults import accepted, choices, table_of
from fpsolve.model.parameters import STRICT, meaning_of

EXAMPLE = '[vary] with "noise.D0" = [0.1, 0.5, 1.0]'
_START = "its first row must name keys, as in noise.D0,noise.tau0"
_WORDS = Words("the sets", "a file of sets", "sets.csv", "comma-separated", _START, may_have_mark=True)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(e[+-]?\d+)?", re.IGNORECASE)
Known = Mapping[str, FieldInfo]
"""The parameters of a case by their keys, each with its range."""


def values_of(known: FieldInfo) -> TypeAdapter[Values]:
    """What a list of values of a parameter must be."""
    number = Annotated[float, Field(), *known.metadata]
    entries = Field(strict=False, min_length=1, max_length=MAX_MOMENTS)
    return TypeAdapter(Annotated[tuple[number, ...], entries], config=STRICT)


def vary_of(value: Any, info: ValidationInfo) -> Vary:
    """What [vary] means; a `Vary` is left. Raises ValidationError with all that is wrong with it."""
    context = info.context or {}
    if isinstance(value, Vary):
        return value
    if not isinstance(value, dict):
        text = f"got {shown_with_kind(value)}; must be a table of lists and ranges; write, for example, {EXAMPLE}"
        raise ValueError(text)
    if (parameters := parameters_of(info.data, context)) is None:
        refuse([((), value, DEPENDENT)])
        return Vary()
    table = flat(value, parameters)
    if "file" in table:
        return _of_file(table, parameters, context.get("folder", Path()))
    mode, columns, refusals = table.pop("mode", "product"), Columns(), list[Refusal]()
    if mode not in ("product", "zip"):
        text = f'got {shown_with_kind(mode)}; must be one of "product", "zip";{nearest(mode, ("product", "zip"))}'
        refusals.append((("mode",), mode, f'{text} write mode = "zip", or remove it'))
    for key, item in table.items():
        if key in parameters:
            columns[key], wrong = column_of(key, item, parameters[key])
            refusals += wrong
        else:
            known = (*parameters, "mode", "file")
            text = f"cannot be varied;{nearest(key, known)} known keys: {', '.join(known)}; rename or remove it"
            refusals.append(((key,), item, text))
    refuse(refusals)
    refuse(_uneven(columns) if mode == "zip" else _repeated(columns))
    return Vary(columns, mode)


def _of_file(table: Mapping[str, Any], parameters: Known, folder: Path) -> Vary:
    file, mode = table["file"], table.get("mode", "zip")
    others = [key for key in table if key not in ("file", "mode")]
    if type(file) is not str or not file:
        text = f'got {shown_with_kind(file)}; must be the path of a file of sets; write, for example, file = "sets.csv"'
        refuse([(("file",), file, text)])
    if others:
        text = f"gives all values, so that [vary] may have no other key; leave out {', '.join(others)}"
        refuse([(("file",), file, f"{text}, as by --set 'vary={{ file = {shown(file)} }}'")])
    if mode != "zip":
        text = f"got {shown(mode)}; each row of a file is a set; remove it"
        refuse([(("mode",), mode, text)])
    try:
        return read_sets(file, folder, parameters)
    except Unreadable as error:
        place = file if error.line is None else f"{file}:{error.line}"
        refuse([(("file",), file, f"{place}: {error.sentence}")])
        raise


def column_of(key: str, values: Any, field: FieldInfo) -> tuple[Column, list[Refusal]]:
    """The values of a key that a list or a range states, and what is wrong with them."""
    texts = choices(field.annotation)
    if texts and not (is_list(values) and values):
        known = quoted(texts)
        text = f"got {shown_with_kind(values)}; must be a non-empty list of {known}; write, for example, "
        return (), [((key,), values, f"{text}{key} = [{known}]")]
    if texts:
        wrong = list[Refusal]()
        for i, value in enumerate(values):
            if value not in texts:
                text = f"got {shown_with_kind(value)}; must be one of {quoted(texts)};{nearest(value, texts)}"
                wrong.append(((key, i), value, f"{text} write one of them"))
        return tuple(map(str, values)), wrong
    if table_of(values):
        return _range(key, values, field)
    try:
        return values_of(field).validate_python(values), []
    except ValidationError as error:
        return (), [((key, *each["loc"]), each["input"], too_long(each)) for each in faults_in(error)]


def _range(key: str, table: Mapping[str, Any], field: FieldInfo) -> tuple[Column, list[Refusal]]:
    """Those of a range; where its ends are in the range of the key, so are the values between them."""
    try:
        sweep = Sweep(**table)
    except ValidationError as error:
        faults = explain(error, Sweep.__pydantic_fields__)
        return (), [((key, *path), table, sentence) for path, _, sentence in faults]
    values, ends = tuple(sweep.values.tolist()), ("start", "stop")
    wrong: list[Refusal]
    wrong = [((key, ends[int(i)]), end, "") for (_, i), end, _ in column_of(key, [sweep.start, sweep.stop], field)[1]]
    if repeats((each,) for each in values):
        text = f"got num = {sweep.num}, which makes values equal to 12 digits; use a smaller num, or ends further apart"
        wrong.append(((key, "num"), sweep.num, text))
    return values, wrong


def _repeated(columns: Columns) -> Iterator[Refusal]:
    """The values of a product that a key has already."""
    for key, values in columns.items():
        for i, _ in repeats((each,) for each in values):
            yield (key, i), values[i], f"got {values[i]} twice; values must be distinct; remove one of them"


def _uneven(columns: Columns) -> Iterator[Refusal]:
    """Lists side by side of several lengths, or a set that stands twice."""
    lengths = {key: len(values) for key, values in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{key} has {length}" for key, length in lengths.items())
        text = f'{told}; with mode = "zip" all must have one length; complete the shorter ones, or use mode = "product"'
        yield (), None, text
        return
    for place, first in repeats(zip(*columns.values(), strict=True)):
        varied = {key: values[place] for key, values in columns.items()}
        text = f"sets {first + 1} and {place + 1} are both {assignments(varied)}; must be distinct; remove one of them"
        yield (next(iter(columns)), place), varied, text


def read_sets(file: str, folder: Path, parameters: Known) -> Vary:
    """The sets of a file.

    Raises:
        Unreadable: there are no rows in it, no commas, or wrong quotes.
        ValidationError: with all that is wrong with its rows.
    """
    reader = csv.reader(io.StringIO(read_text(folder / file, _WORDS), newline=""), strict=True)
    line, header = 1, list[str]()
    faults, rows = list[tuple[int, str]](), dict[int, list[str]]()
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells) and not header:
                if len(cells) == 1 and re.search(r"[;\t]", cells[0]):
                    mark = "semicolons" if ";" in cells[0] else "tabs"
                    raise Unreadable(f"is separated by {mark}; write commas, and decimal points in the numbers", line)
                header = cells
                faults += ((line, reason) for reason in _header_faults(header, parameters))
            elif any(cells) and len(cells) != len(header):
                faults.append((line, _wrong_length(cells, header)))
            elif any(cells):
                rows[line] = cells
            line = reader.line_num + 1
    except csv.Error as error:
        raise Unreadable(f"cannot be read as comma-separated values ({error}); correct its quotes", line) from None
    if not (rows or faults):
        raise Unreadable("has a header but no sets; write a row of values for each set")
    lines, columns, wrong = tuple(rows), Columns(), set[int]()
    for key, column in zip(header, zip(*rows.values(), strict=True), strict=False):
        if key in parameters:
            columns[key], reasons = _cells(key, column, parameters[key])
            faults += ((lines[i], f"{key}: {reason}") for i, reason in reasons.items())
            wrong |= reasons.keys()
    for place, first in repeats(zip(*columns.values(), strict=True)) if len(columns) == len(header) else ():
        if wrong.isdisjoint((place, first)):
            text = f"is the same set as line {lines[first]}; must be distinct; remove one of them"
            faults.append((lines[place], text))
    faults.sort(key=itemgetter(0))
    refuse((("file",), None, f"{file}:{line}: {text}") for line, text in faults)
    return Vary(columns, "zip", file, lines)


def _header_faults(header: Sequence[str], parameters: Known) -> Iterator[str]:
    """What of a header is no key, or there already."""
    known = f"known keys: {', '.join(parameters)}; rename or remove it"
    for i, key in enumerate(header):
        if not key:
            yield f"column {i + 1}: has no key in the header; {known}"
        elif key not in parameters:
            yield f"{shortened(key)}: cannot be varied;{nearest(key, parameters)} {known}"
        elif key in header[:i]:
            yield f"{key}: stands twice in the header; remove one of them"


def _wrong_length(cells: Sequence[str], header: Sequence[str]) -> str:
    remedy = "remove the others, and write decimal points, not commas, in the numbers"
    if len(cells) < len(header):
        remedy = "add those that are missing"
    if len(cells) == 1 and ";" in cells[0]:
        remedy = "write commas between them, and decimal points in the numbers"
    return f"has {len(cells)} cell{'s' * (len(cells) > 1)}; must have {len(header)}, one for each key; {remedy}"


def _cells(key: str, cells: Sequence[str], field: FieldInfo) -> tuple[Column, dict[int, str]]:
    """The values in cells, and what is wrong with some, by their places."""
    texts, wrong = choices(field.annotation), dict[int, str]()
    column, refusals = column_of(key, cells if texts else [_number(cell) for cell in cells], field)
    must = f"must be {accepted(field)} ({meaning_of(field)})"
    for (_, *place), value, _ in refusals:
        for i in map(int, place):  # none of too many cells
            cell, remedy = cells[i], "change it, or remove the row"
            if texts:
                must, remedy = f"must be one of {', '.join(texts)}", f"{nearest(cell, texts)} write one of them".strip()
            elif _DECIMAL_COMMA.fullmatch(cell):
                remedy = f"write the decimal point as {cell.replace(',', '.')}"
            elif type(value) is str:
                is_split = ";" in cell
                remedy = "write commas between cells, and decimal points in numbers" if is_split else "write a number"
            wrong[i] = f"{f'got {shortened(cell)}' if cell else 'is empty'}; {must}; {remedy}"
    return column or tuple(cells), wrong


def _number(cell: str) -> float | str:
    """The number in a cell, 0 without a sign; the cell where there is none."""
    try:
        return float(cell) + 0.0
    except ValueError:
        return cell
