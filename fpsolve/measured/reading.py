"""Spectra and records from files. Nothing that changes a number is assumed: the file states it, or the reader."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fpsolve.errors import FpsolveError
from fpsolve.files import Unreadable
from fpsolve.measured.files import read_table
from fpsolve.measured.signals import SIGNALS, density_of_unit, density_such_as, factor_of, has_dimension
from fpsolve.measured.spectrum import Record, Spectrum
from fpsolve.measured.table import Table, stamps_of
from fpsolve.measured.weak import checked_choice, checked_positive
from fpsolve.model.faults import nearest

Per = Literal["Hz", "rad/s"]
Sided = Literal["one", "two"]
By = Literal["columns", "rows"]
UNEVEN, JITTER = 1e-3, 0.2
"""Shares of a step by which times may differ from even ones: without a note, and with one. A gap makes 0.5 at least."""
HERTZ_NAMES = ("f", "freq", "frequency", "frequencies")
FREQUENCY_NAMES = (*HERTZ_NAMES, "omega", "ω", "w")
TIME_NAMES = ("t", "time", "times", "timestamp", "date", "zeit")


def read_spectrum(
    path: str | Path,
    *,
    per: Per | None = None,
    sided: Sided | None = None,
    of: str = "stiffness",
    column: str | None = None,
    over: str | None = None,
    unit: str | None = None,
    scale: float = 1.0,
    skip: int = 0,
    names: str = "",
    averages: float | None = None,
) -> Spectrum:
    """A spectral density from a file, see `read_table` for its formats and `Spectrum.from_columns` for conventions.

    Args:
        path: its file, with a column of frequencies and one of densities.
        per: the unit of the frequencies, if the file does not state it.
        sided: whether the integral over positive frequencies is the variance, "one", or half of it, "two".
        of: what is measured, "stiffness", "damping", "acceleration" or "height", to whose unit the values are
            converted: 1, 1/s, m/s² or m.
        column: the name of the column of densities, if there are several.
        over: the name of the column of frequencies, if neither its name nor its unit tells it.
        unit: of the density, such as "g^2/Hz", or of its root, such as "g/sqrt(Hz)"; in place of that of the file.
        scale: what the signal is multiplied by, the density by its square.
        skip: rows at the beginning of the file to leave out; lines of a text.
        names: of the columns of a text, with their units, such as "f (Hz),G (1/Hz)", in place of those that it has.
        averages: see `Spectrum.from_columns`.

    Raises:
        FpsolveError: one sentence on why there is none, or on what is not stated.
    """
    with _of_file(path, skip=skip, names=names) as table:
        if sided not in ("one", "two"):
            raise ValueError('states not whether the density is one-sided; state --sided, "one" or "two"')
        names_over = (
            [_named(table.columns, over)] if over else _columns_over(table, FREQUENCY_NAMES, "Hz", "rad/s", "1/s")
        )
        if len(names_over) != 1:
            told = f"has {len(names_over) or 'no'} columns of frequencies"
            raise ValueError(f"{told}; state one by --over, or a record by --record; {_has(table)}")
        name, f_name = _ordinate(table, names_over, column), names_over[0]
        f, values = table.numbers(f_name), table.numbers(name)
        if f.size != values.size:
            raise ValueError(f"has {f.size} frequencies in {f_name} and {values.size} values in {name}; export as many")
        signal, f_unit = SIGNALS[checked_choice("of", of, SIGNALS)].unit, table.units.get(f_name, "")
        unit = unit or _unit(table, name, density_such_as(signal))
        power, factor, density_per = density_of_unit(unit, signal)
        f_per = next((each for each in ("Hz", "rad/s", "1/s") if has_dimension(f_unit, each)), "Hz")
        f = f * factor_of(f_unit, f_per) if f_unit else f
        stated = f_per if f_unit and f_per != "1/s" else per
        pers = {each for each in (per, stated, density_per) if each}
        if len(pers) > 1 or (pers and not stated and f_name.lower() not in HERTZ_NAMES):
            said = f"frequencies {f_name} ({f_unit or per or 'no unit'}) and densities {name} ({unit})"
            raise ValueError(f"has {said}; state --per and --unit that belong together, or convert one of both")
        if not pers:
            raise table.missing(f"unit of the frequencies {f_name}", "--per, Hz or rad/s", "Hz", "rad/s")
        values = values**power * factor * scale**2
        order = np.argsort(f, kind="stable") if np.all(np.diff(f) < 0) else slice(None)
        f, values = f[order], values[order]
        left_out = (values == 0) & (f > 0) | np.r_[False, (np.diff(f) == 0) & (np.diff(values) == 0)]
        notes = (f"{np.sum(left_out)} rows count for nothing, as their density is 0 or they stand twice",) * any(
            left_out
        )
        f, values = f[~left_out], values[~left_out]
        made = Spectrum.from_columns(f, values, "Hz" if pers == {"Hz"} else "rad/s", sided, averages)
        read = f"column {name} in {unit}, {sided}-sided, {f.size} frequencies"
        return replace(made, notes=notes, read=read)


def read_record(
    path: str | Path,
    *,
    rate: float | None = None,
    of: str = "stiffness",
    column: str | None = None,
    over: str | None = None,
    unit: str | None = None,
    time_unit: str | None = None,
    scale: float = 1.0,
    skip: int = 0,
    names: str = "",
    by: By = "columns",
) -> Record:
    """A record from a file, see `read_table` for its formats.

    Args:
        path: its file, with a column of values, and one of times where neither it nor `rate` states how fast it is.
        rate: values per second, in place of the times of the file.
        of, column, skip, names: as in `read_spectrum`.
        over: the name of the column of times, if neither its name nor its unit tells it.
        unit: of the values, such as "g", in place of that of the file.
        time_unit: of the times, such as "ms", in place of that of the file.
        scale: what the values are multiplied by.
        by: whether values follow each other along the "rows" of a text, or down its "columns".

    Raises:
        FpsolveError: one sentence on why there is none, or on what is not stated.
    """
    with _of_file(path, skip=skip, names=names, by_rows=by == "rows") as table:
        wanted = SIGNALS[checked_choice("of", of, SIGNALS)].unit
        if rate is not None:
            checked_positive("rate", rate)
        elif over is None and time_unit is None:
            rate = table.rate
        times = [_named(table.columns, over)] if over else _columns_over(table, TIME_NAMES, "s")
        name = _ordinate(table, times, column)
        values = table.numbers(name)
        if rate is None and len(times) != 1:
            raise table.missing("times of its values", "--rate, in values per second, or --over", "s", "Hz")
        step, notes = _step(table, times[0], time_unit, values.size) if rate is None else (1 / rate, ())
        unit = unit or _unit(table, name, wanted, "V")
        made = Record(values * factor_of(unit, wanted) * scale, step)
        return replace(made, notes=notes, read=f"column {name} in {unit}, {values.size} values, {1 / step:.6g} in 1 s")


@contextmanager
def _of_file(path: str | Path, **how: Any) -> Iterator[Table]:
    """The table of a file; what is wrong with it is said of the file."""
    line = ""
    try:
        yield read_table(Path(path), **how)
        return
    except Unreadable as error:
        line, told = "" if error.line is None else f":{error.line}", error.sentence
    except ValueError as error:
        told = str(error)
    raise FpsolveError(f"{path}{line}: {' '.join(told.split())}")


def _has(table: Table) -> str:
    return f"its columns are {', '.join(table.columns)}"


def _unit(table: Table, name: str, *such: str) -> str:
    """The unit of a column, that of the signal is such a one. Raises `ValueError` where the file states none."""
    if not (unit := table.units.get(name)):
        raise table.missing(f"unit of the column {name}", f"--unit, such as {such[0]}", *such)
    return unit


def _columns_over(table: Table, names: Collection[str], *units: str) -> list[str]:
    """The columns that others are over: those of some units, or of a calendar, or else of some names."""
    found = [
        name
        for name, cells in table.columns.items()
        if has_dimension(table.units.get(name, ""), *units) or ("s" in units and stamps_of(cells))
    ]
    return found or [name for name in table.columns if name.lower() in names]


def _named(columns: Collection[str], wanted: str) -> str:
    """One of some columns by its name. Raises `ValueError`."""
    if wanted not in columns:
        raise ValueError(f'has no column "{wanted}";{nearest(wanted, columns)} there are {", ".join(columns)}')
    return wanted


def _ordinate(table: Table, over: Sequence[str], wanted: str | None) -> str:
    """The column of values: the wanted one, or the only one. Raises `ValueError`."""
    others = [name for name in table.columns if name not in over]
    if wanted is None and len(others) != 1:
        rows = ", or --by rows if they follow each other along rows" * all(map(str.isdigit, table.columns))
        raise ValueError(f"has {len(others)} columns of values; state one by --column{rows}; {_has(table)}")
    return others[0] if wanted is None else _named(others, wanted)


def _step(table: Table, name: str, unit: str | None, count: int) -> tuple[float, tuple[str, ...]]:
    """The step of times in s, which must be even but for some jitter, which is noted."""
    unit = unit or table.units.get(name, "")
    if not unit and not stamps_of(table.columns[name]):
        raise table.missing(f"unit of the times {name}", "--time-unit, such as s or ms", "s")
    t = table.times(name, unit)
    if t.size != count or t.size < 2 or not t[-1] > t[0]:
        text = f"has times in {name} that do not increase, or not as many as values"
        raise ValueError(f"{text}; sort the rows, or state --over or --rate")
    exact = 4 * float(np.finfo(float).eps * np.max(abs(t)))
    step, start = np.polyfit(np.arange(t.size), t - t[0], 1).tolist()
    beside = float(np.max(np.abs(t - t[0] - start - step * np.arange(t.size))))
    if beside <= JITTER * step + exact:
        note = f"the times in {name} are up to {beside / step:.2g} of a step off even ones"
        taken = f"{note}, and the mean step {step:.9g} s is taken; --rate states another"
        return step, (taken,) * (beside > UNEVEN * step + exact)
    i = int(np.argmax(np.abs(np.diff(t) - step)))
    raise ValueError(
        f"has times in {name} with uneven steps, {t[i + 1] - t[i]:.6g} s at {table.place(i + 1)} and {step:.6g} s on "
        "average; resample it, or fill the gap; if the times are wrong and the values are not, state --rate"
    )
