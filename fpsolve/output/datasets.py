"""Results as one labelled dataset, results.nc: over the varied keys, or the sets, and p; and many of these as one."""

from __future__ import annotations

import io
import json
import math
import os
import warnings
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from glob import glob
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from fpsolve.case.case import Case
from fpsolve.errors import FpsolveError
from fpsolve.exponent.quantities import MOMENT
from fpsolve.files import atomic
from fpsolve.model.quantity import STATUS, P
from fpsolve.results.curve import Status
from fpsolve.results.table import Table

if TYPE_CHECKING:
    import xarray as xr

SET = "set"
"""The dimension of parameter sets that are no product."""
RESULTS = "results.nc"
ROW = "row"
"""The dimension of many runs."""
MOST_COMPRESSED = 1000
"""Bytes of numbers that a byte of a file can hold."""


@dataclass(frozen=True)
class Variable:
    """What stands in a file under a name.

    Attributes:
        dims: the names of its dimensions.
        values: numbers, or texts as objects.
        attributes: such as its unit.
    """

    dims: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, Any]


def write_dataset(case: Case, table: Table, folder: Path, facts: Mapping[str, Any]) -> None:
    """results.nc, for xarray and whatever reads netCDF-4; what is missing or failed is NaN.

    There is a dimension for each varied key, or `set` for those of a list, and p.

    xarray would write the same, but takes with pandas and Dask as long to import as small cases take in all.

    Args:
        table: the numbers of all curves.
        facts: on the run, see `facts_of`; they become attributes, tables as JSON.
    """
    import h5netcdf
    import h5py

    variables, coordinates = _variables(case, table), _coordinates(case)
    beside = " ".join(name for name, each in coordinates.items() if each.dims != (name,))
    content = io.BytesIO()  # HDF5 does not survive a full disk
    with h5netcdf.File(content, "w") as file:
        whole = variables | coordinates
        sizes = (zip(each.dims, each.values.shape, strict=True) for each in whole.values())
        file.dimensions = dict(chain.from_iterable(sizes))
        for name, each in whole.items():
            is_text, is_number = each.values.dtype == object, each.values.dtype.kind == "f"
            kind = h5py.string_dtype() if is_text else each.values.dtype
            fill = math.nan if is_number else None
            made = file.create_variable(name, each.dims, kind, data=each.values, fillvalue=fill)
            made.attrs.update(each.attributes)
            if beside and SET in each.dims and name in variables:
                made.attrs["coordinates"] = beside
        is_whole = not np.any(variables[STATUS.name].values == Status.MISSING)
        file.attrs.update({**_origin(case, facts), "complete": int(is_whole)})
    with atomic(folder / RESULTS) as draft:
        draft.write_bytes(content.getvalue())


def _variables(case: Case, table: Table) -> dict[str, Variable]:
    """The numbers of all sets."""
    vary = case.vary
    is_list = bool(vary) and vary.mode != "product"
    over: tuple[str, ...] = (SET,) if is_list else vary.keys
    shape = (case.planned,) if is_list else tuple(len(vary.values(key)) for key in over)
    found = {name: (each.quantity, each.values) for name, each in table.items()}
    status = np.where(np.isnan(table[STATUS.name].values), Status.MISSING, table[STATUS.name].values)
    found[STATUS.name] = STATUS, status.astype(np.int8)
    flags = {
        "flag_values": np.array([int(each) for each in Status], dtype=np.int8),
        "flag_meanings": " ".join(each.name.lower() for each in Status),
    }
    return {
        name: Variable(
            (*over, *about.dims),
            values.reshape(shape + values.shape[1:]),
            about.timed(case.units.time).attributes | (flags if about is STATUS else {}),
        )
        for name, (about, values) in found.items()
    }


def _coordinates(case: Case) -> dict[str, Variable]:
    """The varied values and p."""
    vary, found = case.vary, dict[str, Variable]()
    is_list = bool(vary) and vary.mode != "product"
    for key in vary.keys:
        values = np.array(
            vary.columns[key] if is_list else vary.values(key), dtype=object if vary.is_text(key) else float
        )
        about = {} if vary.is_text(key) else case.about(key).attributes
        found[key] = Variable((SET if is_list else key,), values, about)
    if MOMENT.name in case.asked:
        found["p"] = Variable(("p",), case.p, P.attributes)
    return found


def _origin(case: Case, facts: Mapping[str, Any]) -> dict[str, str | float | int]:
    """The case, the parameters that are not varied, and where the numbers come from."""
    origin = {name: each if isinstance(each, str | float | int) else json.dumps(each) for name, each in facts.items()}
    return {
        "title": case.title,
        "case": case.name,
        "Conventions": "CF-1.11",
        "rtol": case.rtol,
        **case.constants,
        **origin,
    }


def open_results(*places: str | Path, errors: Literal["raise", "warn"] = "raise") -> xr.Dataset:
    """The results of several runs as one dataset over `row`, which has one for each p of each set: those of its run.

    `set` and `p` are an index, by which `sel` selects: `open_results("results/*").sel(p=2.0)` is over the sets. `run`
    and every parameter, varied or held, are coordinates. What a run has not is NaN, or an empty text; a set of a run
    without moments is one row, whose p is NaN.

    >>> open_results("results/minimal").moment.values.shape
    (3,)

    Args:
        places: folders of cases, their results.nc, or patterns of these such as "results/*".
        errors: "warn" leaves out what is no file of a run, with a warning that names it.

    Raises:
        FpsolveError: there is none, or one is no file of a run, which it names.
    """
    import xarray as xr

    if errors not in ("raise", "warn"):
        raise FpsolveError(f'errors is "raise" or "warn", not {errors!r}')
    there = [
        path
        for place in map(str, places)
        for path in map(Path, [place] if os.path.exists(place) else sorted(glob(place)))  # noqa: PTH110, PTH207
    ]
    files = [path / RESULTS if path.is_dir() else path for path in there]
    paths = [path for path in files if path.suffix == ".nc" and (path.exists() or path.is_symlink())]
    if not paths:
        raise FpsolveError(f"no results.nc in {', '.join(map(str, places)) or 'nothing'}; run a case first")
    runs: list[xr.Dataset] = []
    for path in paths:
        try:
            runs.append(_rows(path))
        except FpsolveError as failure:
            if errors == "raise":
                raise
            warnings.warn(f"left out: {failure}", stacklevel=2)
    if not runs:
        raise FpsolveError(f"none of {', '.join(map(str, paths))} is a file of a run; run a case first")
    starts = np.cumsum([0, *(int(run[SET].max()) for run in runs)])
    parts = [run.assign_coords({SET: run[SET] + start}) for run, start in zip(runs, starts, strict=False)]
    known = dict.fromkeys(name for run in parts for name in run.variables)
    about = {name: [run[name].attrs for run in parts if name in run.variables] for name in known}
    columns = {
        name: (ROW, np.concatenate([_column(run, name, parts) for run in parts]), _agreed(about[name]))
        for name in known
    }
    coordinates = {name: columns.pop(name) for name in known if any(name in run.coords for run in parts)}
    joined = xr.Dataset(columns, coordinates, _agreed([run.attrs for run in runs]))
    index: dict[Any, Any] = {ROW: [SET, "p"]}
    return joined.set_index(index)


def _column(run: xr.Dataset, name: Hashable, runs: Sequence[xr.Dataset]) -> Any:
    """A variable of a run; NaN, or empty texts, where it has none."""
    if name in run.variables:
        return run[name].values
    is_text = any(name in other.variables and other[name].dtype.kind in "OU" for other in runs)
    return np.full(run.sizes[ROW], "" if is_text else math.nan, dtype=object if is_text else float)


def _agreed(about: Sequence[Mapping[Any, Any]]) -> dict[Any, Any]:
    """The attributes on which all agree that have them."""
    first = {key: value for each in reversed(about) for key, value in each.items()}
    return {
        key: value for key, value in first.items() if all(np.array_equal(each.get(key, value), value) for each in about)
    }


def _rows(path: Path) -> xr.Dataset:
    """A file of a run as a dataset over `row`, with `set`, p, and all parameters as coordinates.

    Raises:
        FpsolveError: it is none.
    """
    import xarray as xr

    try:
        if not path.is_file():
            raise ValueError("it is no plain file")
        _look_at_sizes(path)
        options: dict[str, Any] = {"decode_times": False, "decode_timedelta": False}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with xr.open_dataset(path, engine="h5netcdf", **options) as found:
                return _long(found, path)
    except (
        OSError,
        ValueError,
        LookupError,
        AttributeError,
        RuntimeError,
        TypeError,
        ArithmeticError,
        MemoryError,
    ) as no:
        reason = " ".join(str(no).split()) or type(no).__name__
        raise FpsolveError(f"{path} cannot be read as results of a run: {reason}; run its case again") from no


def _look_at_sizes(path: Path) -> None:
    """Refuse what leads to other files, and variables that state more than their file can hold. Raises ValueError."""
    import h5py

    stated, unnamed, most = 0, [], MOST_COMPRESSED * path.stat().st_size
    with h5py.File(path, "r") as file:
        if STATUS.name not in file:
            raise ValueError(f"it has no variable {STATUS.name} over its sets")
        for name in file:
            link = file.get(name, getlink=True)
            each = file.get(name) if isinstance(link, h5py.HardLink) else None
            if not isinstance(each, h5py.Dataset) or each.is_virtual or each.external:
                raise ValueError(f"{name} is no variable of its own")
            if not (each.is_scale or all(map(len, each.dims))):
                unnamed.append(name)
            stated += math.prod(each.shape or ()) * each.dtype.itemsize
    if stated > most:
        raise ValueError(f"it states {stated} bytes of numbers and can hold {most} at most")
    if unnamed:
        raise ValueError(f"the dimensions of {unnamed[0]} have no names")


def _long(found: xr.Dataset, path: Path) -> xr.Dataset:
    """The variables of a file over `row`. Raises ValueError where they are not those of a run."""
    import xarray as xr

    if STATUS.name not in found.data_vars or "p" in (over := found[STATUS.name].dims):
        raise ValueError(f"it has no variable {STATUS.name} over its sets")
    sizes = {name: found.sizes[name] for name in over}
    p = found["p"].values.astype(float) if "p" in found.dims else np.array([math.nan])
    if "p" in found.dims and not (np.isfinite(p).all() and np.unique(p).size == p.size > 0):
        raise ValueError("its p are not finite and different")
    if not (count := math.prod(sizes.values())):
        raise ValueError("it has no sets")
    if "p" in found.dims and {*over, "p"} != ({*found[MOMENT.name].dims} if MOMENT.name in found else None):
        raise ValueError(f"it has no variable {MOMENT.name} over its sets and p")
    columns: dict[str, Any] = {}
    for name, each in zip(map(str, found.variables), found.variables.values(), strict=True):
        is_text = (
            each.dtype.kind in "OU" and name in found.coords and all(isinstance(text, str) for text in each.values.flat)
        )
        is_ours = name not in (ROW, SET, "run") and {*each.dims} <= {*over, "p"}
        if not is_ours or not (is_text or each.dtype.kind in "fiu"):
            raise ValueError(f"no run writes a variable such as {name}")
        if name != "p":
            whole = each.set_dims({**sizes, "p": p.size}).transpose(*over, "p").values.ravel()  # type: ignore[no-untyped-call]
            columns[name] = (ROW, whole.astype(object) if is_text else whole, each.attrs)
    kinds = ("oscillator", "system", "noise")
    held = {key: value for key, value in found.attrs.items() if str(key).partition(".")[0] in kinds}
    if wrong := [key for key, value in held.items() if not isinstance(value, str | float | int | np.number)]:
        raise ValueError(f"its attribute {wrong[0]} is no number and no text")
    if missing := [key for key in over if key != SET and key not in found.coords]:
        raise ValueError(f"it has no values of {missing[0]}")
    rest = {key: value for key, value in found.attrs.items() if key not in held}
    coordinates = {SET: (ROW, np.repeat(np.arange(1, count + 1), p.size)), "p": (ROW, np.tile(p, count), P.attributes)}
    for key, value in {"run": path.parent.name, **held}.items():
        coordinates[key] = (ROW, np.full(count * p.size, value, dtype=object if isinstance(value, str) else float))
    coordinates |= {name: columns.pop(name) for name in map(str, found.coords) if name != "p"}
    return xr.Dataset(columns, coordinates, rest)
