"""Spectra, records and natural frequencies from files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.files import Unreadable
from fpsolve.measured.columns import Column, Table
from fpsolve.measured.signals import (
    FREQUENCIES,
    INVERSE_TIMES,
    SIGNALS,
    TIMES,
    Density,
    Powers,
    among,
    density_unit,
    factor_of,
    powers,
)
from fpsolve.measured.spectrum import Record, Spectrum
from fpsolve.measured.tables import read_table

Per = Literal["Hz", "rad/s"]
Sided = Literal["one", "two"]
BETWEEN = 400
"""Frequencies between the first and the last break point of a spectrum."""
UNEVEN = 1e-3
"""By which share of it steps of a record may differ."""
ANGULAR = ("omega", "ω", "w")
"""Names of frequencies in rad/s."""
FREQUENCY_NAMES = ("f", "fn", "freq", "frequency", "frequencies", "omega", "ω", "w", "frequency_hz", "f_hz")
TIME_NAMES = ("t", "time", "zeit", "seconds", "time_s")
DAMPING_NAMES = ("xi", "ξ", "zeta", "ζ", "damping", "dampings", "damping ratio", "damping_ratio", "damping_ratios")


class Mode(NamedTuple):
    """A natural frequency f in Hz, and its damping ratio; NaN where the table has none."""

    frequency: float
    damping_ratio: float


def read_spectrum(
    path: str | Path,
    *,
    per: Per | None = None,
    sided: Sided | None = None,
    of: str | None = None,
    column: str | None = None,
    over: str | None = None,
    unit: str | None = None,
    scale: float = 1.0,
    skip: int = 0,
    row: int | None = None,
    log_log: bool = False,
    averages: float | None = None,
    variance: float | None = None,
) -> Spectrum:
    """A spectral density from a file, see `read_table` for its formats and `Spectrum.from_columns` for conventions.

    Args:
        path: its file, with a column of frequencies and one of densities.
        per: the unit of the frequencies, if the file does not state it.
        sided: whether the integral over positive frequencies is the variance, "one", or half of it, "two".
        of: what is measured, "stiffness", "damping", "acceleration" or "height"; a unit that the file states is
            converted to 1, 1/s, m/s² or m. None takes the numbers as they are.
        column: the name of the column of densities, if there are several.
        over: the name of the column of frequencies, if it is not told by its name or its unit.
        unit: of the signal, such as "g", or of the density, such as "g^2/Hz", if the file does not state it.
        scale: what the signal is multiplied by, the density by its square.
        skip: rows of the file at its beginning that are left out, of a text its lines.
        row: of a file with several spectra which of them, from 1 on; None for their mean.
        log_log: whether the file has break points, with straight lines in the logarithms between them.
        averages, variance: see `Spectrum.from_columns`.

    Raises:
        FpsolveError: one sentence on why there is none.
    """
    table = read_table(path, checked_skip(skip))
    with _of_file(table.path):
        if table.kind == "record" or table.rate is not None:
            raise ValueError("is a record, not a spectrum; name it by --record")
        if sided not in ("one", "two"):
            raise ValueError('states not whether the density is one-sided; state sided, "one" or "two" (--sided)')
        f_name = _abscissa(table, FREQUENCY_NAMES, FREQUENCIES, "frequencies, such as f (Hz),", over)
        f = _numbers(table, f_name)
        _refuse_other_unit(f_name, f)
        name = _ordinate(table, f_name, column)
        density, notes = (_numbers(table, name), table.notes) if table.rows is None else _of_rows(table, name, row)
        if table.rows is None and row is not None:
            raise ValueError("has one spectrum only; leave out row (--row)")
        stated, signal = FREQUENCIES.get(among(f.unit, FREQUENCIES), ""), _density_unit(density.unit, name)
        for found, where in ((stated, f_name), (signal.per, name)):
            if found and per and found != per:
                raise ValueError(f"has {found} in the unit of {where}, and {per} was stated; state --per {found}")
        if f_name.lower() in ANGULAR and signal.per == "Hz" and not (per or stated):
            text = f"has a density per Hz, but frequencies called {f_name}; state --per Hz if they are in Hz"
            raise ValueError(f"{text}, or convert one of both")
        per = per or stated or signal.per  # type: ignore[assignment]
        if per is None or not per:
            raise ValueError('states no unit of its frequencies; state per, "Hz" or "rad/s" (--per)')
        known = signal.signal if unit is None else _signal_of(unit)
        factor, more = _factor(of, known, unit or density.unit, name)
        keep = slice(None) if table.rows is None else density.values > 0  # buoys write 0 where there are no waves
        values = density.values[keep] * (factor * checked_scale(scale)) ** 2
        _refuse_wrong_rows(table, f.values, density.values[keep], f_name, name)
        order = np.argsort(f.values[keep], kind="stable") if np.all(np.diff(f.values) < 0) else slice(None)
        places, values = f.values[keep][order], values[order]
        if log_log:
            places, values = _between(places, values)
        made = Spectrum.from_columns(places, values, per, sided, averages, variance)
        return replace(made, notes=(*notes, *more), is_formula=log_log)


def _between(f: FloatArray, density: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values on straight lines in the logarithms between break points."""
    if f.size < 2 or not np.all(f > 0):
        raise ValueError("has break points at frequencies that are not > 0, or one only; leave out log_log (--log-log)")
    places = np.unique(np.concatenate([f, np.geomspace(f[0], f[-1], BETWEEN)[1:-1]]))
    return places, np.exp(np.interp(np.log(places), np.log(f), np.log(density)))


def _signal_of(unit: str) -> Powers | None:
    """The unit of the signal in one that is stated, of the signal or of its density."""
    try:
        of_density = density_unit(unit).signal
    except ValueError:
        of_density = None
    return powers(unit) if of_density is None else of_density


def _of_rows(table: Table, name: str, row: int | None) -> tuple[Column, tuple[str, ...]]:
    """One of the spectra of a file, or their mean without those that are the same at all frequencies."""
    rows = table.rows
    assert rows is not None
    if row is not None:
        if not 1 <= row <= len(rows):
            raise ValueError(f"got row = {row}; must be from 1 to {len(rows)}, the number of its spectrum (--row)")
        return replace(table.columns[name], values=rows[row - 1]), table.notes
    good = np.all(np.isfinite(rows), axis=1) & (np.ptp(rows, axis=1) > 0)
    if not np.any(good):
        raise ValueError("has no row with a spectrum: all values of each are the same; export it again")
    left = f", without {np.sum(~good)} whose values are all the same or no numbers" if np.any(~good) else ""
    note = f"the mean of {np.sum(good)} spectra is taken{left}; --row takes one of them"
    return replace(table.columns[name], values=rows[good].mean(axis=0)), (*table.notes, note)


def _factor(of: str | None, stated: Powers | None, text: str, name: str) -> tuple[float, tuple[str, ...]]:
    """What numbers in a unit are multiplied by to be those of a signal, and what was assumed of them."""
    if of is None:
        return 1.0, ()
    signal = SIGNALS[of]
    if stated is None and not text.strip() and signal.unit != "1":
        return 1.0, (f"the numbers of {name} are taken as {signal.unit}, as the file states no unit; state --unit",)
    return factor_of(of, stated, text), ()


def checked_scale(scale: float) -> float:
    """A factor. Raises `ValueError`."""
    if not (math.isfinite(scale) and scale != 0):
        raise ValueError(f"cannot be multiplied by {scale}; state another --scale")
    return scale


def checked_skip(skip: int) -> int:
    """A number of rows. Raises `FpsolveError`."""
    if isinstance(skip, bool) or not isinstance(skip, int) or skip < 0:
        raise FpsolveError(f"got skip = {skip}; must be a whole number >= 0 of rows (--skip)")
    return skip


def _numbers(table: Table, name: str) -> Column:
    """A column, without what is no number. Raises `ValueError`."""
    column = table.columns[name]
    wrong = np.flatnonzero(~np.isfinite(column.values))
    if wrong.size:
        place = table.place(int(wrong[0]))
        raise ValueError(f"{name} has the value {column.values[wrong[0]]} in {place}; remove rows that are no numbers")
    return column


def _refuse_wrong_rows(table: Table, f: FloatArray, density: FloatArray, over: str, name: str) -> None:
    """Refuse frequencies and densities as they stand in the file, see `Spectrum`. Raises `ValueError`."""
    checks = [(f < 0, f, over, "must be >= 0; remove such rows, and state that the density is two-sided")]
    if f.size == density.size:
        checks.append(((density <= 0) & (f > 0), density, name, "must be > 0; remove the row, or average more records"))
    for wrong, values, column, remedy in checks:
        if np.any(wrong):
            k = int(np.flatnonzero(wrong)[0])
            raise ValueError(f"has {values[k]:g} in the column {column}, {table.place(k)}; {remedy}")
    if not np.all(np.diff(f) > 0) and not np.all(np.diff(f) < 0):
        k = int(np.flatnonzero(np.diff(f) <= 0)[0]) + 1
        raise ValueError(
            f"has {f[k]:g} in the column {over}, {table.place(k)}, which is not above the one before; sort the rows, "
            "keep one of each"
        )


def _density_unit(unit: str, name: str) -> Density:
    """The unit of a column of densities. Raises `ValueError` with its name."""
    try:
        return density_unit(unit)
    except ValueError as error:
        raise ValueError(f"in the column {name} {error}") from None


def read_record(
    path: str | Path,
    *,
    rate: float | None = None,
    of: str | None = None,
    column: str | None = None,
    over: str | None = None,
    unit: str | None = None,
    scale: float = 1.0,
    skip: int = 0,
) -> Record:
    """A record from a file, see `read_table` for its formats.

    Args:
        path: its file, with a column of values, and one of times where neither it nor `rate` states how fast it is.
        rate: values per second.
        of, column, over, unit, scale, skip: as in `read_spectrum`; `over` is the column of times.

    Raises:
        FpsolveError: one sentence on why there is none.
    """
    table = read_table(path, checked_skip(skip))
    with _of_file(table.path):
        if table.kind == "spectrum":
            raise ValueError("is a spectrum, not a record; leave out --record")
        if rate is not None and not 0 < rate < math.inf:
            raise ValueError(f"cannot have the rate {rate}; must be > 0, in values per second")
        rate = rate or table.rate
        times, notes = "", table.notes
        if rate is None or len(table.columns) > 1:
            wanted = "times, such as t (s)," if rate is None else ""
            times = _abscissa(table, TIME_NAMES, TIMES, wanted, over)
        name = _ordinate(table, times, column)
        if rate is None:
            step, more = _step(table, times)
            notes = (*notes, *more)
            is_told = over or table.abscissa or _unit_of_times(table.columns[times]) or times.lower() in TIME_NAMES
            if not is_told:
                notes += (f"the column {times} is taken as times in s, which nothing in the file says; state --rate",)
        values = _numbers(table, name)
        stated = powers(unit or values.unit) if (unit or values.unit).strip() else None
        factor, more = _factor(of, stated, unit or values.unit, name)
        made = Record(values.values * (factor * checked_scale(scale)), step if rate is None else 1 / rate)
        return replace(made, notes=(*notes, *more))


def read_modes(path: str | Path) -> tuple[Mode, ...]:
    """Natural frequencies and damping ratios from a table with columns Fn and Xi, as pyOMA writes it.

    Frequencies are in Hz, or in rad/s where the unit says so; damping is a share of critical damping, or in %.

    Raises:
        FpsolveError: one sentence on why there are none.
    """
    table = read_table(path)
    with _of_file(table.path):
        names = {name.lower(): name for name in table.columns}
        over = next((names[each] for each in FREQUENCY_NAMES if each in names), None)
        if over is None:
            raise ValueError(f"has no column of natural frequencies, such as Fn; {_has(table)}")
        column = table.columns[over]
        per = FREQUENCIES.get(among(column.unit, FREQUENCIES), "rad/s" if over.lower() in ANGULAR else "Hz")
        f = column.values / (2 * math.pi if per == "rad/s" else 1.0)
        damping = next((names[each] for each in DAMPING_NAMES if each in names), None)
        zeta: FloatArray = np.full(f.size, math.nan)
        if damping is not None:
            zeta = table.columns[damping].values * (0.01 if among(table.columns[damping].unit, ["%"]) else 1.0)
        if not np.all((f > 0) & np.isfinite(f)):
            i = int(np.flatnonzero(~((f > 0) & np.isfinite(f)))[0])
            raise ValueError(f"has the frequency {f[i]:g} in row {i + 1}; must be > 0; remove the row")
        bad = np.flatnonzero(~(np.abs(zeta) < 1)) if damping is not None else np.zeros(0, dtype=int)
        if bad.size:
            value = f"{zeta[bad[0]]:g} in row {bad[0] + 1}"
            raise ValueError(f"has the damping ratio {value}; must be a share of critical damping: 0.01 is 1 %")
        return tuple(Mode(float(a), float(b)) for a, b in zip(f, zeta, strict=True))


@contextmanager
def _of_file(path: Path) -> Iterator[None]:
    """Let what is wrong be said of a file."""
    try:
        yield
    except Unreadable as error:
        raise FpsolveError(f"{path}:{error.line}: {error.sentence}") from None
    except ValueError as error:
        raise FpsolveError(f"{path}: {error}") from None


def _has(table: Table) -> str:
    return f"its columns are {', '.join(table.columns)}"


def _refuse_other_unit(name: str, column: Column) -> None:
    """Refuse what is over times, or over a unit of frequencies that is not known. Raises `ValueError`."""
    unit = column.unit
    if among(unit, TIMES) or (not unit and name.lower() in TIME_NAMES):
        raise ValueError(f"is over times, in the column {name}, so that it is a record; name it by --record")
    if unit and not among(unit, [*FREQUENCIES, *INVERSE_TIMES]):
        known = ", ".join(dict.fromkeys(FREQUENCIES.values()))
        raise ValueError(f'has the unit "{column.unit}" of the column {name}; must be {known}; convert the frequencies')


def _abscissa(table: Table, names: Sequence[str], units: Iterable[str], wanted: str, stated: str | None) -> str:
    """The column that the others are over: that of the file, of a known name or unit, or else the first of several.

    Args:
        table: of the file.
        names, units: of such columns.
        wanted: what there must be, in words; empty if there need be none.
        stated: the name that is stated.
    """
    if stated is not None:
        return _named(table, stated, [*table.columns])
    if table.abscissa:
        return table.abscissa
    lower = {name.lower(): name for name in table.columns}
    known = [lower[each] for each in names if each in lower]
    known = known or [name for name in table.columns if among(table.unit_of(name), units)]
    if known:
        return known[0]
    if not wanted:
        return ""
    if len(table.columns) < 2:
        rate = ", or state --rate" if names is TIME_NAMES else ""
        raise ValueError(f"has one column only; write a column of {wanted} beside it{rate}")
    return next(iter(table.columns))


def _named(table: Table, wanted: str, names: Sequence[str]) -> str:
    """One of some columns by its name. Raises `ValueError`."""
    if wanted in names:
        return wanted
    lower = {name.lower(): name for name in names}
    close = get_close_matches(wanted.lower(), lower, n=1)
    guess = f' did you mean "{lower[close[0]]}"?' if close else ""
    raise ValueError(f'has no column "{wanted}";{guess} {_has(table)}')


def _ordinate(table: Table, over: str, wanted: str | None) -> str:
    """The column of values: the wanted one, or the only one."""
    others = [name for name in table.columns if name != over]
    if wanted is not None:
        if wanted == over:
            raise ValueError(f"has frequencies or times in the column {wanted}; state one of {', '.join(others)}")
        return _named(table, wanted, others)
    if len(others) != 1:
        raise ValueError(f"has several columns of values; state one by --column; {_has(table)}")
    return others[0]


def _unit_of_times(column: Column) -> str:
    """The unit of times, which of those since 1970 in ms, µs or ns their size tells; empty where nothing tells it."""
    if column.unit or not column.values.size:
        return among(column.unit, TIMES)
    ends = column.values[[0, -1]]
    return next(
        (unit for unit in ("ms", "us", "ns") if np.all((ends * TIMES[unit] > 1e9) & (ends * TIMES[unit] < 4e9))), ""
    )


def _step(table: Table, name: str) -> tuple[float, tuple[str, ...]]:
    """The step of times, which must be even but for the digits that are written, and what was assumed of them.

    Times that a logger has rounded lie within one unit of the last digit beside t₀ + iΔ, and no step is above 1.5 Δ.
    """
    column = _numbers(table, name)
    if column.unit and not among(column.unit, TIMES):
        raise ValueError(f'has times in "{column.unit}"; must be one of {", ".join(TIMES)}; state --rate instead')
    unit = _unit_of_times(column)
    factor = TIMES.get(unit, 1.0)
    is_since_1970 = bool(unit) and not column.unit
    notes = (f"the times in {name} are taken as {unit} since 1970; --rate states other ones",) * is_since_1970
    t = column.values * factor
    steps = np.diff(t)
    digit = max(column.resolution * factor, float(np.finfo(float).eps * np.max(abs(t))))
    if t.size < 2 or not np.all(steps > -digit) or not t[-1] > t[0]:
        raise ValueError(
            f"has times in {name} that do not increase; sort the rows, name others by --over, or state --rate"
        )
    span = float(column.values[-1] - column.values[0])
    if column.resolution > 1e-12 * abs(span):  # in whole digits, of which large times have lost some
        span = round(span / column.resolution) * column.resolution
    step = span * factor / (t.size - 1)
    exact = 4 * float(np.finfo(float).eps * np.max(abs(t)))
    if np.max(np.abs(steps - step)) <= max(UNEVEN * step, exact):
        return step, notes
    beside = t - t[0] - step * np.arange(t.size)
    if np.ptp(beside) <= 2 * digit and np.max(steps) <= 1.5 * step + exact:
        note = (
            f"the times in {name} are rounded to {digit:.2g} s, and the mean step {step:.9g} s is taken; --rate states"
        )
        return step, (*notes, f"{note} another")
    i = int(np.argmax(np.abs(steps - step)))
    raise ValueError(
        f"has times in {name} with uneven steps, {steps[i]:.6g} s at {table.place(i + 1)} and {step:.6g} s on average; "
        "resample it, or fill the gap; if the times are wrong and the values are not, state --rate"
    )
