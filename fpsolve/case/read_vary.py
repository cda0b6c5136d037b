"""[vary] of a case file: what its lists, its ranges and its file of comma-separated values mean."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, Tag, ValidationError, ValidationInfo
from pydantic.fields import FieldInfo

from fpsolve.arrays import shortened
from fpsolve.case.explain import BY_KIND, DEPENDENT, LIST, TABLE, Fields, Refusal, checked, entry_of, refuse
from fpsolve.case.kinds import parameters_of, problem_of
from fpsolve.case.sections import MAX_MOMENTS, Sweep, VarySection, flat
from fpsolve.case.vary import Column, Columns, Vary, assignments, repeats
from fpsolve.files import Unreadable, Words, read_text
from fpsolve.model.faults import choices, shown
from fpsolve.model.parameters import example_of, meaning_of

EXAMPLE = '[vary] with "noise.D0" = [0.1, 0.5, 1.0]'
_START = "its first row must name keys, as in noise.D0,noise.tau0"
_WORDS = Words("the sets", "a file of sets", "sets.csv", "comma-separated", _START, may_have_mark=True)


def vary_of(value: object, info: ValidationInfo) -> Vary:
    """What [vary] means; a `Vary` is left. Raises ValidationError with all that is wrong with it."""
    if isinstance(value, Vary):
        return value
    if not isinstance(value, dict):
        text = f"got {shown(value)}; must be a table of lists and ranges; write, for example, {EXAMPLE}"
        raise ValueError(text)
    if (problem := problem_of(info.data)) is None:
        refuse([((), DEPENDENT)])
        return Vary()
    parameters = parameters_of(problem)
    fields = {key: column_of(field, key) for key, field in parameters.items()} | VarySection.model_fields
    columns = checked(fields, flat(value, parameters))
    mode, file = columns.pop("mode", ""), columns.pop("file", "")
    if not file:
        refuse(_uneven(columns) if mode == "zip" else _repeated(columns))
        return Vary(columns, mode or "product")
    if columns:
        text = f"gives all values, so that [vary] may have no other key; leave out {', '.join(columns)}"
        refuse([(("file",), f"{text}, as by --set 'vary={{ file = {shown(file)} }}'")])
    if mode == "product":
        refuse([(("mode",), f"got {shown(mode)}; each row of a file is a set; remove it")])
    try:
        return read_sets(file, (info.context or {}).get("folder", Path()), parameters)
    except Unreadable as error:
        place = file if error.line is None else f"{file}:{error.line}"
        refuse([(("file",), f"{place}: {error.sentence}")])
        raise


def column_of(field: FieldInfo, key: str = "") -> FieldInfo:
    """What the values of a parameter must be: a list of some, or a range of numbers, whose ends are in its range.

    Args:
        field: of one value.
        key: of the values in [vary]; empty in a file of sets.
    """
    texts, example = choices(field.annotation), example_of(field).partition(" = ")[2]
    entry: Any = Literal[*texts] if texts else Annotated[float, Field(), *field.metadata]
    some: Any = Annotated[tuple[entry, ...], Field(strict=False, min_length=1, max_length=MAX_MOMENTS)]

    def listed(sweep: Sweep) -> Column:
        checked(dict.fromkeys(("start", "stop"), entry_of(found)), {"start": sweep.start, "stop": sweep.stop})
        return tuple(sweep.values.tolist())

    between = Annotated[Sweep, AfterValidator(listed)]
    annotation: Any = some if texts else Annotated[Annotated[some, Tag(LIST)] | Annotated[between, Tag(TABLE)], BY_KIND]
    found = FieldInfo.from_annotated_attribute(annotation, None)
    found.description, found.examples = meaning_of(field), [f'"{key}" = [{example}]' if key else example]
    return found


def _repeated(columns: Columns) -> Iterator[Refusal]:
    """The values of a product that a key has already."""
    for key, values in columns.items():
        for i, _ in repeats((each,) for each in values)[:1]:
            yield (key, i), f"got {values[i]} twice; values must be distinct; remove one of them"


def _uneven(columns: Columns) -> Iterator[Refusal]:
    """Lists side by side of several lengths, or a set that stands twice."""
    lengths = {key: len(values) for key, values in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{key} has {length}" for key, length in lengths.items())
        text = f'{told}; with mode = "zip" all must have one length; complete the shorter ones, or use mode = "product"'
        yield (), text
        return
    for place, first in repeats(zip(*columns.values(), strict=True)):
        varied = {key: values[place] for key, values in columns.items()}
        text = f"sets {first + 1} and {place + 1} are both {assignments(varied)}; must be distinct; remove one of them"
        yield (next(iter(columns)), place), text


def read_sets(file: str, folder: Path, parameters: Fields) -> Vary:
    """The sets of a file.

    Raises:
        Unreadable: there are no rows in it, no commas, or wrong quotes.
        ValidationError: with all that is wrong with its rows.
    """
    reader = csv.reader(io.StringIO(read_text(folder / file, _WORDS), newline=""), strict=True)
    line, first, header = 1, 1, list[str]()
    faults, rows = list[tuple[int, str]](), dict[int, list[float | str]]()
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells) and not header:
                if len(cells) == 1 and re.search(r"[;\t]", cells[0]):
                    text = "is separated by semicolons or tabs; write commas, and decimal points in the numbers"
                    raise Unreadable(text, line)
                first, header = line, cells
                twice = (key for i, key in enumerate(header) if key in header[:i])
                faults += ((line, f"{key}: stands twice in the header; remove one of them") for key in twice)
            elif any(cells) and len(cells) != len(header):
                told = f"has {len(cells)} cell{'s' * (len(cells) > 1)}; must have {len(header)}, one for each key"
                faults.append((line, f"{told}; write commas between them, and decimal points in the numbers"))
            elif any(cells):
                rows[line] = [*map(_number, cells)]
            line = reader.line_num + 1
    except csv.Error as error:
        raise Unreadable(f"cannot be read as comma-separated values ({error}); correct its quotes", line) from None
    if not (rows or faults):
        raise Unreadable("has a header but no sets; write a row of values for each set")
    lines, columns = tuple(rows), dict[str, Any](zip(header, zip(*rows.values(), strict=True), strict=False))
    for place, same in repeats(rows.values()):
        text = f"is the same set as line {lines[same]}; must be distinct; remove one of them"
        faults.append((lines[place], text))
    try:
        columns = checked({key: column_of(each) for key, each in parameters.items()}, columns)
    except ValidationError as error:
        for each in error.errors():
            key, *places = each["loc"]
            at = lines[int(places[0])] if places else first
            faults.append((at, f"{shortened(str(key)) or 'a column'}: {each['msg']}"))
    refuse((("file",), f"{file}:{at}: {text}") for at, text in sorted(faults, key=itemgetter(0)))
    return Vary(columns, "zip", file, lines)


def _number(cell: str) -> float | str:
    """The number in a cell, 0 without a sign; the cell where there is none."""
    try:
        return float(cell) + 0.0
    except ValueError:
        return cell
