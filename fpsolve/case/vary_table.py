"""[vary] of a case file, checked value by value, as a `Vary`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import ValidationError

from fpsolve.case.messages import Refusal, explain, nearest, own_faults, refuse, shown_with_kind, too_long
from fpsolve.case.sections import Sweep, Value, flat
from fpsolve.case.vary import RECORDS, VARIABLE, WORDS, Vary, assignments, groups, repeats

EXAMPLE = '[vary] with "noise.D0" = [0.1, 0.5, 1.0]'
Columns = dict[str, tuple[Value, ...]]


def vary_of(value: Any) -> Vary:
    """What [vary] means; a `Vary` is left. Raises ValidationError with all that is wrong with it."""
    if isinstance(value, Vary):
        return value
    if not isinstance(value, dict):
        text = f"got {shown_with_kind(value)}; must be a table of lists and ranges; write, for example, {EXAMPLE}"
        refuse([((), value, text)])
    table = flat(value, RECORDS)
    mode = table.pop("mode", "product")
    columns, refusals = Columns(), list(_of_mode(mode))
    for key, item in table.items():
        refusals += _column(key, item, columns)
    refuse(refusals)
    refuse(_uneven(columns) if mode == "zip" else _repeated(columns))
    return Vary(columns, mode)


def _of_mode(mode: Any) -> Iterator[Refusal]:
    if mode not in ("product", "zip"):
        guess = nearest(mode, ("product", "zip")) if isinstance(mode, str) else ""
        text = f'got {shown_with_kind(mode)}; must be one of "product", "zip";{guess} write mode = "zip", or remove it'
        yield ("mode",), mode, text


def _column(key: str, values: Any, columns: Columns) -> Iterator[Refusal]:
    """What is wrong with the values of a key; without faults these join the columns."""
    if key not in RECORDS:
        guess = nearest(key, (*RECORDS, "mode"))
        yield (key,), values, f"cannot be varied;{guess} known keys: {', '.join(RECORDS)}; rename or remove it"
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
    if not wrong:
        columns[key] = tuple(sweep.values.tolist())


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
