"""Results as one labelled dataset, results.nc: over the varied keys, or the sets, and p; and many of these as one."""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Mapping
from glob import glob
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fpsolve.case.case import Case
from fpsolve.errors import FpsolveError
from fpsolve.exponent.quantities import MOMENT
from fpsolve.files import atomic
from fpsolve.model.quantity import STATUS, P
from fpsolve.results.known import Results
from fpsolve.results.table import Table
from fpsolve.solve.curve import Status

if TYPE_CHECKING:
    import xarray as xr


SET = "set"
"""The dimension of parameter sets that are no product."""
RESULTS = "results.nc"
ROW = "row"
"""The dimension of many runs."""


Variable = tuple[tuple[str, ...], NDArray[Any], Mapping[str, Any]]
"""What stands in a file under a name: dimensions, numbers or texts, and attributes such as a unit."""


def write_dataset(case: Case, results: Results, path: Path, facts: Mapping[str, Any]) -> None:
    """Write the numbers of all sets, for xarray and whatever reads netCDF-4; what is missing or failed is NaN.

    There is a dimension for each varied key, or `set` for those of a list, and p.

    xarray would write the same, but takes with pandas and Dask as long to import as small cases take in all.

    Args:
        results: of all curves.
        path: the file.
        facts: on the run, see `facts_of`; they become attributes, tables as JSON.
    """
    import h5netcdf

    variables = _arrays(case, results.table)
    content = io.BytesIO()  # HDF5 does not survive a full disk
    with h5netcdf.File(content, "w") as file:
        sizes = (zip(dims, values.shape, strict=True) for dims, values, _ in variables.values())
        file.dimensions = dict(chain.from_iterable(sizes))
        for name, (dims, values, attributes) in variables.items():
            kind = values.dtype
            fill = math.nan if kind.kind == "f" else None
            file.create_variable(name, dims, kind, data=values, fillvalue=fill).attrs.update(attributes)
        about = {"title": case.title, "case": case.name, "Conventions": "CF-1.11", "rtol": case.rtol, **case.constants}
        about |= {key: each if isinstance(each, str | float | int) else json.dumps(each) for key, each in facts.items()}
        file.attrs.update({**about, "complete": int(len(results) == case.planned)})
    with atomic(path) as draft:
        draft.write_bytes(content.getvalue())


def _arrays(case: Case, table: Table) -> dict[str, Variable]:
    """The numbers of all sets, then the varied values and p."""
    import h5py

    vary = case.vary
    is_list = bool(vary) and vary.mode != "product"
    over, shape = (
        ((SET,), (case.planned,)) if is_list else (vary.keys, tuple(len(vary.values(key)) for key in vary.keys))
    )
    found = dict[str, Variable]()
    for name, column in table.items():
        numbers: NDArray[Any] = column.values
        attributes: dict[str, Any] = dict(column.quantity.timed(case.units.time).attributes)
        if column.quantity is STATUS:
            numbers = np.where(np.isnan(numbers), Status.MISSING, numbers).astype(np.int8)
            attributes["flag_values"] = np.array([*Status], dtype=np.int8)
            attributes["flag_meanings"] = " ".join(each.name.lower() for each in Status)
        if is_list:
            attributes["coordinates"] = " ".join(vary.keys)
        found[name] = (*over, *column.quantity.dims), numbers.reshape(shape + numbers.shape[1:]), attributes
    for key in vary.keys:
        values, is_text = vary.columns[key] if is_list else vary.values(key), vary.is_text(key)
        array = np.array(values, dtype=h5py.string_dtype() if is_text else float)
        found[key] = (SET if is_list else key,), array, {} if is_text else case.about(key).attributes
    if MOMENT.name in case.asked:
        found["p"] = ("p",), case.p, P.attributes
    return found


def open_results(*places: str | Path) -> xr.Dataset:
    """The results of several runs as one dataset over `row`, which has one for each p of each set: those of its run.

    `set` and `p` are an index, by which `sel` selects: `open_results("results/*").sel(p=2.0)` is over the sets. `run`
    and every parameter, varied or held, are coordinates. What a run has not is NaN, or an empty text; a set of a run
    without moments is one row, whose p is NaN.

    >>> open_results("results/minimal").moment.values.shape
    (3,)

    Args:
        places: folders of cases, their results.nc, or patterns of these such as "results/*".

    Raises:
        FpsolveError: there is none.
    """
    import xarray as xr

    there = [
        path
        for place in map(str, places)
        for path in map(Path, [place] if os.path.exists(place) else sorted(glob(place)))  # noqa: PTH110, PTH207
    ]
    files = [path / RESULTS if path.is_dir() else path for path in there]
    runs, count = list[xr.Dataset](), 0
    for path in files:
        if path.suffix == ".nc" and path.exists():
            runs.append(_rows(path, count))
            count = int(runs[-1][SET].max())
    if not runs:
        raise FpsolveError(f"no results.nc in {', '.join(map(str, places)) or 'nothing'}; run a case first")
    joined = xr.concat(runs, ROW, data_vars="all", combine_attrs="drop_conflicts")
    joined = joined.assign({name: each.fillna("") for name, each in joined.items() if each.dtype.kind == "O"})
    joined = joined.set_coords([name for name in joined if name in (SET, "p", "run") or "." in str(name)])
    index: dict[Any, Any] = {ROW: [SET, "p"]}
    return joined.set_index(index)


def _rows(path: Path, before: int) -> xr.Dataset:
    """A file of a run over `row`, its sets counted on from those before; parameters are variables like others."""
    import xarray as xr

    options: dict[str, Any] = {"decode_times": False, "decode_timedelta": False}
    with xr.open_dataset(path, engine="h5netcdf", **options) as file:
        found = file.load()
    if "p" not in found.dims:
        found = found.assign_coords(p=[math.nan])
    rows = found.stack({ROW: [*found[STATUS.name].dims, "p"]}).reset_index(ROW).reset_coords()
    held = {key for key in found.attrs if str(key).partition(".")[0] in ("oscillator", "system", "noise")}
    rows.attrs = {key: value for key, value in found.attrs.items() if key not in held}
    numbers = before + 1 + np.arange(rows.sizes[ROW]) // found.sizes["p"]
    return rows.assign({SET: (ROW, numbers), "run": path.parent.name, **{key: found.attrs[key] for key in held}})
