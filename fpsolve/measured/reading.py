"""Spectra, records and natural frequencies from files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError
from fpsolve.measured.signals import FREQUENCIES, TIMES, Density, density_unit, factor_of, plain
from fpsolve.measured.spectrum import Record, Spectrum
from fpsolve.measured.tables import Column, Table, read_table

Per = Literal["Hz", "rad/s"]
Sided = Literal["one", "two"]
UNEVEN = 1e-3
"""By which share of it steps of a record may differ."""
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
        averages, variance: see `Spectrum.from_columns`.

    Raises:
        FpsolveError: one sentence on why there is none.
    """
    table = read_table(path)
    with _of_file(table.path):
        if table.kind == "record" or table.rate is not None:
            raise ValueError("is a record, not a spectrum; name it by --record")
        if sided not in ("one", "two"):
            raise ValueError('states not whether the density is one-sided; state sided, "one" or "two" (--sided)')
        over = _abscissa(table, FREQUENCY_NAMES, lambda unit: unit in FREQUENCIES)
        name = _ordinate(table, over, column)
        stated, unit = FREQUENCIES.get(plain(table.columns[over].unit), ""), _density_unit(table.columns[name], name)
        for found, where in ((stated, over), (unit.per, name)):
            if found and per and found != per:
                raise ValueError(f"has {found} in the unit of {where}, and {per} was stated; state --per {found}")
        per = per or stated or unit.per  # type: ignore[assignment]
        if per is None or not per:
            raise ValueError('states no unit of its frequencies; state per, "Hz" or "rad/s" (--per)')
        factor = factor_of(of, unit.signal) if of else 1.0
        f, density = table.columns[over].values, table.columns[name].values
        order = np.argsort(f, kind="stable") if np.all(np.diff(f) < 0) else slice(None)
        return Spectrum.from_columns(f[order], density[order] * factor**2, per, sided, averages, variance)


def _density_unit(column: Column, name: str) -> Density:
    """The unit of a column of densities. Raises `ValueError` with its name."""
    try:
        return density_unit(column.unit)
    except ValueError as error:
        raise ValueError(f"in the column {name} {error}") from None


def read_record(
    path: str | Path, *, rate: float | None = None, of: str | None = None, column: str | None = None
) -> Record:
    """A record from a file, see `read_table` for its formats.

    Args:
        path: its file, with a column of values, and one of times where neither it nor `rate` states how fast it is.
        rate: values per second.
        of, column: as in `read_spectrum`.

    Raises:
        FpsolveError: one sentence on why there is none.
    """
    table = read_table(path)
    with _of_file(table.path):
        if table.kind == "spectrum":
            raise ValueError("is a spectrum, not a record; leave out --record")
        if rate is not None and not 0 < rate < math.inf:
            raise ValueError(f"cannot have the rate {rate}; must be > 0, in values per second")
        rate = rate or table.rate
        over = ""
        if rate is None or len(table.columns) > 1:
            over = _abscissa(table, TIME_NAMES, lambda unit: unit in TIMES, must=rate is None)
        name = _ordinate(table, over, column)
        step = _step(over, table.columns[over]) if rate is None else 1 / rate
        factor = factor_of(of, table.columns[name].unit) if of else 1.0
        return Record(table.columns[name].values * factor, step)


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
        per = FREQUENCIES.get(plain(column.unit), "rad/s" if over.lower() in ("omega", "ω", "w") else "Hz")
        f = column.values / (2 * math.pi if per == "rad/s" else 1.0)
        damping = next((names[each] for each in DAMPING_NAMES if each in names), None)
        zeta: FloatArray = np.full(f.size, math.nan)
        if damping is not None:
            zeta = table.columns[damping].values * (0.01 if plain(table.columns[damping].unit) == "%" else 1.0)
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
    except ValueError as error:
        raise FpsolveError(f"{path}: {error}") from None


def _has(table: Table) -> str:
    return f"its columns are {', '.join(table.columns)}"


def _abscissa(table: Table, names: Sequence[str], is_unit: Callable[[str], bool], must: bool = True) -> str:
    """The column that the others are over: that of the file, of a known name or unit, or else the first of several."""
    if table.abscissa:
        return table.abscissa
    lower = {name.lower(): name for name in table.columns}
    known = [lower[each] for each in names if each in lower]
    known = known or [name for name, each in table.columns.items() if is_unit(plain(each.unit))]
    if known:
        return known[0]
    if not must:
        return ""
    if len(table.columns) < 2:
        raise ValueError(f"has one column only; it needs {names[-1]} beside it")
    return next(iter(table.columns))


def _ordinate(table: Table, over: str, wanted: str | None) -> str:
    """The column of values: the wanted one, or the only one."""
    others = [name for name in table.columns if name != over]
    if wanted is not None:
        if wanted in table.columns:
            return wanted
        lower = {name.lower(): name for name in others}
        close = get_close_matches(wanted.lower(), lower, n=1)
        guess = f' did you mean "{lower[close[0]]}"?' if close else ""
        raise ValueError(f'has no column "{wanted}";{guess} {_has(table)}')
    if len(others) != 1:
        raise ValueError(f"has several columns of values; state one by --column; {_has(table)}")
    return others[0]


def _step(name: str, column: Column) -> float:
    """The step of times, which must be even."""
    unit = plain(column.unit)
    if unit and unit not in TIMES:
        raise ValueError(f'has times in "{column.unit}"; must be one of {", ".join(TIMES)}; state --rate instead')
    t = column.values * TIMES.get(unit, 1.0)
    steps = np.diff(t)
    if t.size < 2 or not np.all(np.isfinite(steps)) or not np.all(steps > 0):
        raise ValueError(f"has times in {name} that do not increase; sort the rows, or state --rate")
    step = float(t[-1] - t[0]) / (t.size - 1)
    if np.max(np.abs(steps - step)) > max(UNEVEN * step, 1e-9 * abs(t[-1])):
        i = int(np.argmax(np.abs(steps - step)))
        raise ValueError(
            f"has times in {name} with uneven steps, {steps[i]:.6g} s at row {i + 2} and {step:.6g} s on average; "
            "resample it, or fill the gap"
        )
    return step
