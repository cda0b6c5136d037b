"""[vary] of a case file, checked value by value, as a `Vary`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError, ValidationInfo

from fpsolve.case.messages import Refusal, explain, nearest, own_faults, refuse, shown, shown_with_kind, too_long
from fpsolve.case.reading import Unreadable
from fpsolve.case.sections import Sweep, Value, flat
from fpsolve.case.set_file import FileVary, read_sets
from fpsolve.case.vary import RECORDS, VARIABLE, WORDS, Vary, assignments, groups, repeats

EXAMPLE = '[vary] with "noise.D0" = [0.1, 0.5, 1.0]'
Columns = dict[str, tuple[Value, ...]]


def vary_of(value: Any, info: ValidationInfo) -> Vary:
    """What [vary] means; a `Vary` is left. Raises ValidationError with all that is wrong with it.

    Of a file the rows that are wrong by themselves are not raised, but among the faults of its `FileVary`.
    """
    if isinstance(value, Vary):
        return value
    if not isinstance(value, dict):
        text = f"got {shown_with_kind(value)}; must be a table of lists and ranges; write, for example, {EXAMPLE}"
        refuse([((), value, text)])
    table = flat(value, RECORDS)
    if "file" in table:
        return _of_file(table, (info.context or {}).get("folder", Path()))
    mode = table.pop("mode", "product")
    columns, refusals = Columns(), list(_of_mode(mode))
    for key, item in table.items():
        refusals += _column(key, item, columns)
    refuse(refusals)
    refuse(_uneven(columns) if mode == "zip" else _repeated(columns))
    return Vary(columns, mode)


def _of_file(table: Mapping[str, Any], folder: Path) -> FileVary:
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
        return read_sets(file, folder)
    except Unreadable as error:
        place = file if error.line is None else f"{file}:{error.line}"
        refuse([(("file",), file, f"{place}: {error.sentence}")])
        raise


def _of_mode(mode: Any) -> Iterator[Refusal]:
    if mode not in ("product", "zip"):
        guess = nearest(mode, ("product", "zip")) if isinstance(mode, str) else ""
        text = f'got {shown_with_kind(mode)}; must be one of "product", "zip";{guess} write mode = "zip", or remove it'
        yield ("mode",), mode, text


def _column(key: str, values: Any, columns: Columns) -> Iterator[Refusal]:
    """What is wrong with the values of a key; without faults these join the columns."""
    if key not in RECORDS:
        known = (*RECORDS, "mode", "file")
        text = f"cannot be varied;{nearest(key, known)} known keys: {', '.join(known)}; rename or remove it"
        yield (key,), values, text
        return
    if key in WORDS:
        yield from _texts(key, values, columns)
    elif isinstance(values, dict) and values:
        yield from _range(key, values, columns)
    else:
        try:
            columns[key] = VARIABLE[key].validate_python(values)
        except ValidationError as error:
            yield from (((key, *detail["loc"]), detail["input"], too_long(detail)) for detail in own_faults(error))


def _texts(key: str, values: Any, columns: Columns) -> Iterator[Refusal]:
    known = ", ".join(f'"{word}"' for word in WORDS[key])
    if not isinstance(values, list | tuple) or not values:
        example = f"{key} = [{known}]"
        text = f"got {shown_with_kind(values)}; must be a non-empty list of {known}; write, for example, {example}"
        yield (key,), values, text
        return
    for i, value in enumerate(values):
        if value not in WORDS[key]:
            guess = nearest(value, WORDS[key]) if isinstance(value, str) else ""
            text = f"got {shown_with_kind(value)}; must be one of {known};{guess} write one of them"
            yield (key, i), value, text
    columns[key] = tuple(values)


def _range(key: str, table: Mapping[str, Any], columns: Columns) -> Iterator[Refusal]:
    """A range; where its ends are in the range of the key, so are the values between them."""
    try:
        sweep = Sweep(**table)
    except ValidationError as error:
        yield from (((key, *path), table, sentence) for path, _, sentence in explain(error, Sweep))
        return
    wrong = False
    for end in ("start", "stop"):
        try:
            VARIABLE[key].validate_python([getattr(sweep, end)])
        except ValidationError:
            wrong = True
            yield (key, end), getattr(sweep, end), ""
    values = tuple(sweep.values.tolist())
    if len(set(groups(values))) < len(values):
        text = f"got num = {sweep.num}, which makes values equal to 12 digits; use a smaller num, or ends further apart"
        yield (key, "num"), sweep.num, text
    elif not wrong:
        columns[key] = values


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
