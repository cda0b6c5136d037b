"""Results as one labelled dataset, results.nc: over the varied keys, or the sets, and p; and many of these as one."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.case.case import Case
from fpsolve.errors import FpsolveError
from fpsolve.exponent.quantities import MOMENT
from fpsolve.files import atomic
from fpsolve.model.quantity import SECONDS, STATUS, STORED_MOMENTS, P, Quantity
from fpsolve.output.tables import asked
from fpsolve.study.results import CurveResult, Status

if TYPE_CHECKING:
    import xarray as xr

SET = "set"
"""The dimension of parameter sets that are no product."""
RESULTS = "results.nc"


def write_dataset(case: Case, results: Iterable[CurveResult], folder: Path, facts: Mapping[str, Any]) -> None:
    """results.nc, for xarray and whatever reads netCDF-4; what is missing or failed is NaN."""
    with atomic(folder / RESULTS) as draft:
        dataset_of(case, results, facts).to_netcdf(draft, engine="h5netcdf")


def dataset_of(case: Case, results: Iterable[CurveResult], facts: Mapping[str, Any]) -> xr.Dataset:
    """The results of a case: a dimension for each varied key, or `set` for those of a list, and p.

    Args:
        facts: on the run, see `facts_of`; they become attributes, tables as JSON.
    """
    import xarray as xr

    vary, planned = case.vary, case.planned
    is_list = bool(vary) and vary.mode != "product"
    over: tuple[str, ...] = (SET,) if is_list else vary.keys
    shape = (planned,) if is_list else tuple(len(vary.values(key)) for key in over)
    places = {p: i for i, p in enumerate(case.p.tolist())} if MOMENT.name in case.output.quantities else {}
    moments = {name: np.full((planned, len(places)), math.nan) for name in STORED_MOMENTS if places}
    indices = {index: np.full((3, planned), math.nan) for index in asked(case)}
    status, seconds = np.full(planned, Status.MISSING, dtype=np.int8), np.full(planned, math.nan)
    for result in results:
        row, found = result.curve.number - 1, result.moments
        for name, values in moments.items():
            values[row, [places[p] for p in found.p.tolist()]] = getattr(found, name)
        for index, values in indices.items():
            if numbers := result.index(index):
                values[:, row] = [*numbers.values()]
        status[row], seconds[row] = result.status, result.seconds
    columns: list[tuple[Quantity, Any]] = [(STORED_MOMENTS[name], values) for name, values in moments.items()]
    for index, three in indices.items():
        columns += zip((index, index.error(), index.perturbation), three, strict=True)
    columns += [(STATUS, status), (SECONDS, seconds)]
    variables = {
        each.name: ((*over, *each.dims), values.reshape(shape + values.shape[1:]), each.attributes)
        for each, values in columns
    }
    coordinates: dict[str, Any] = {}
    for key in vary.keys:
        about = {} if vary.is_text(key) else case.parameters[key].quantity.attributes
        coordinates[key] = (SET, list(vary.columns[key]), about) if is_list else (key, list(vary.values(key)), about)
    if MOMENT.name in case.output.quantities:
        coordinates["p"] = ("p", case.p, P.attributes)
    [first] = case.curves(0, 1)
    held = {key: value for key, value in first.parameters.items() if key not in vary.keys}
    origin = {name: each if isinstance(each, str | float | int) else json.dumps(each) for name, each in facts.items()}
    head = {"title": case.title, "case": case.name, "Conventions": "CF-1.11", "rtol": case.rtol}
    dataset = xr.Dataset(variables, coordinates, {**head, **held, **origin})
    dataset[STATUS.name].attrs |= {
        "flag_values": np.array([int(each) for each in Status], dtype=np.int8),
        "flag_meanings": " ".join(each.name.lower() for each in Status),
    }
    return dataset.assign_attrs(complete=int(not np.any(status == Status.MISSING)))


def open_results(*places: str | Path) -> xr.Dataset:
    """The results of several runs as one dataset over `set` and p.

    `run` and every parameter, varied or held, are coordinates of `set`; p are those of any run, and what a run has not
    is NaN.

    Args:
        places: folders of cases, their results.nc, or patterns of these such as "results/*".

    Raises:
        FpsolveError: there is none, or one cannot be read.
    """
    import xarray as xr

    there = [
        path
        for place in map(str, places)
        for path in ([Path(place)] if Path(place).exists() else sorted(map(Path, glob(place))))  # noqa: PTH207  (absolute)
    ]
    files = [path / RESULTS if path.is_dir() else path for path in there]
    paths = [path for path in files if path.is_file() and path.suffix == ".nc"]
    if not paths:
        raise FpsolveError(f"no results.nc in {', '.join(map(str, places)) or 'nothing'}; run a case first")
    runs = [_long(path) for path in paths]
    if any("p" in run.dims for run in runs):  # those of which no moments were wanted have none of the p
        runs = [run if "p" in run.dims else run.assign_coords(p=("p", np.zeros(0))) for run in runs]
    return xr.concat(runs, SET, data_vars="all", join="outer", combine_attrs="drop_conflicts")


def _long(path: Path) -> xr.Dataset:
    """A file as a dataset over `set` and p, with all parameters as coordinates of `set`."""
    import xarray as xr

    try:
        found = xr.load_dataset(path, engine="h5netcdf")
    except (OSError, ValueError, LookupError, AttributeError, RuntimeError) as failure:  # whatever is damaged
        raise FpsolveError(f"{path} cannot be read: {failure}; run its case again") from failure
    over = [name for name in found.dims if name not in ("p", SET)]
    if SET not in found.dims:
        found = found.stack({SET: over}).reset_index(SET) if over else found.expand_dims(SET)
    kinds = ("oscillator", "system", "noise")
    held = {key: value for key, value in found.attrs.items() if str(key).partition(".")[0] in kinds}
    labels = {"run": path.parent.name, **held}
    rest = {key: value for key, value in found.attrs.items() if key not in held}
    found = found.assign_coords({key: (SET, np.full(found.sizes[SET], value)) for key, value in labels.items()})
    found.attrs = rest
    return found
