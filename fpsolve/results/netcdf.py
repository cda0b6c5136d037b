"""Results as one labelled dataset, results.nc: over the varied keys, or the sets, and p; and many of these as one."""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Iterable, Mapping
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fpsolve.errors import FpsolveError
from fpsolve.files import write_bytes
from fpsolve.model.quantity import STATUS, P
from fpsolve.results.known import Results
from fpsolve.solve.set_result import Status

if TYPE_CHECKING:
    import xarray as xr


SET = "set"
"""The dimension of parameter sets that are no product."""
RESULTS = "results.nc"
ROW = "row"
"""The dimension of many runs."""


def write_dataset(results: Results, path: Path, facts: Mapping[str, object]) -> None:
    """Write the table of all sets, for xarray and whatever reads netCDF-4; what is missing or failed is NaN.

    There is a dimension for each varied key, or `set` for those of a list, and p.

    xarray would write the same, but takes with pandas and Dask as long to import as small cases take in all.

    Args:
        results: of all parameter sets.
        path: the file.
        facts: on the run, see `facts_of`; they become attributes, tables as JSON.
    """
    import h5netcdf  # 50 ms, with h5py
    import h5py

    case, table, text = results.case, results.table, h5py.string_dtype()
    vary = case.vary
    is_list = bool(vary) and vary.mode != "product"
    sizes = {SET: case.planned} if is_list else {key: len(vary.values(key)) for key in vary.keys}
    shape, beside = tuple(sizes.values()), {"coordinates": " ".join(vary.keys)} if is_list else {}
    content = io.BytesIO()  # HDF5 does not survive a full disk
    with h5netcdf.File(content, "w") as file:
        file.dimensions = sizes | ({"p": table.p.size} if table.p.size else {})

        def write(name: str, dims: Iterable[str], values: NDArray[Any], about: Mapping[str, object]) -> None:
            file.create_variable(name, tuple(dims), values.dtype, data=values).attrs.update(about)

        for name, column in table.items():
            numbers: NDArray[Any] = column.values.reshape((*shape, *column.values.shape[1:]))
            about: dict[str, object] = {**column.quantity.timed(case.units.time).attributes, **beside}
            if column.quantity is STATUS:
                numbers = np.where(np.isnan(numbers), Status.MISSING, numbers).astype(np.int8)
                about["flag_values"] = np.array([*Status], dtype=np.int8)
                about["flag_meanings"] = " ".join(each.name.lower() for each in Status)
            write(name, (*sizes, *column.quantity.dims), numbers, about)
        messages = np.array(table.messages, dtype=text).reshape(shape)
        write("messages", sizes, messages, {"long_name": "what is said of the parameter set", "units": "1", **beside})
        for key in vary.keys:
            values, is_text = vary.columns[key] if is_list else vary.values(key), vary.is_text(key)
            array = np.array(values, dtype=text if is_text else float)
            write(key, [SET if is_list else key], array, {} if is_text else case.about(key).attributes)
        if table.p.size:
            write("p", ["p"], table.p, P.attributes)
        known = {key: each if isinstance(each, str | float | int) else json.dumps(each) for key, each in facts.items()}
        about = {"title": case.title, "case": case.name, "Conventions": "CF-1.11", "rtol": case.rtol, **case.fixed}
        file.attrs.update({**about, **known, "complete": int(len(results.whole) == case.planned)})
    write_bytes(path, content.getvalue())


def open_results(*places: str | Path) -> xr.Dataset:
    """The results of several runs as one dataset over `row`, which has one for each p of each set: those of its run.

    `set` and `p` are an index, by which `sel` selects: `open_results("results/*").sel(p=2.0)` is over the sets. `run`
    and every parameter, varied or fixed, are coordinates. What a run has not is NaN, or an empty text; a set of a run
    without moments is one row, whose p is NaN.

    >>> open_results("results/minimal").moment.values.shape
    (3,)

    Args:
        places: folders of cases, their results.nc, or patterns of these such as "results/*".

    Raises:
        FpsolveError: there is none.
    """
    import xarray as xr  # 430 ms, with pandas

    there = [
        path
        for place in map(str, places)
        for path in map(Path, [place] if os.path.exists(place) else sorted(glob(place)))  # noqa: PTH110, PTH207
    ]
    files = [path / RESULTS if path.is_dir() else path for path in there]
    runs, count = list[xr.Dataset](), 0
    for path in files:
        if path.suffix == ".nc" and path.exists():
            with xr.open_dataset(path, engine="h5netcdf", decode_times=False, decode_timedelta=False) as file:
                runs.append(_rows(file.load(), path.parent.name, count))
            count = int(runs[-1][SET].max())
    if not runs:
        raise FpsolveError(f"no results.nc in {', '.join(map(str, places)) or 'nothing'}; run a case first")
    joined = xr.concat(runs, ROW, data_vars="all", combine_attrs="drop_conflicts")
    joined = joined.assign({name: each.fillna("") for name, each in joined.items() if each.dtype.kind == "O"})
    joined = joined.set_coords([name for name in joined if name in (SET, "p", "run") or "." in str(name)])
    index: dict[Any, Any] = {ROW: [SET, "p"]}
    return joined.set_index(index)


def _rows(found: xr.Dataset, name: str, before: int) -> xr.Dataset:
    """A run over `row`, its sets counted on from those before; parameters are variables like others."""
    if "p" not in found.dims:
        found = found.assign_coords(p=[math.nan])
    rows = found.stack({ROW: [*found[STATUS.name].dims, "p"]}).reset_index(ROW).reset_coords()
    fixed = {key for key in found.attrs if str(key).partition(".")[0] in ("oscillator", "system", "noise")}
    rows.attrs = {key: value for key, value in found.attrs.items() if key not in fixed}
    numbers = before + 1 + np.arange(rows.sizes[ROW]) // found.sizes["p"]
    return rows.assign({SET: (ROW, numbers), "run": name, **{key: found.attrs[key] for key in fixed}})
