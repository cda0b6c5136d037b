"""Matrices that stand in files beside a case: .npy, .mtx of Matrix Market, sparse or not, .csv, and .mat of MATLAB."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.arrays import real_array
from fpsolve.case.explain import refuse
from fpsolve.files import Unreadable, Words, read_bytes
from fpsolve.model.faults import shown, table_of
from fpsolve.model.plane import MOST_VARIABLES

OF_MATRICES = "modes", "linear"
"""Kinds of systems that have matrices."""
KEYS = {
    "matrix",
    "noise_matrices",
    "mass",
    "stiffness",
    "damping",
    "gyroscopic",
    "circulatory",
    "stiffness_noise",
    "damping_noise",
}
"""Keys of [system] that may name a file."""
MOST_BYTES = 2**26
"""Of a file."""
_WORDS = Words("the matrix", "a matrix", "mass.npy", ".npy, .mtx, .csv or .mat", "write rows of numbers")


def with_matrices(table: Mapping[str, object], folder: Path) -> dict[str, object]:
    """The table of a system with the matrices of the files that it names. Raises `pydantic.ValidationError`."""
    found = dict(table)
    for key in found.keys() & KEYS:
        parts = {
            name: _read(each, folder, key, name) for name, each in table_of(found[key]).items()
        }  # of several noises
        found[key] = parts or _read(found[key], folder, key)
    return found


def _read(name: object, folder: Path, *place: str) -> object:
    """The rows of a file; what is no name of one is left."""
    if not isinstance(name, str):
        return name
    matrix, fault = np.zeros((0, 0)), "is no file"
    stem, mark, entry = name.partition(".mat:")
    path = folder / f"{stem}{mark.rstrip(':')}"
    try:
        if path.exists():
            found = _loaded(path, entry)
            _look_at(found.shape)  # before a sparse one is filled
            matrix, fault = real_array(found if isinstance(found, np.ndarray) else found.toarray(), "it"), ""
    except Unreadable as error:
        fault = error.sentence.partition(";")[0]
    except Exception as error:  # each format raises its own kinds
        fault = f"cannot be read: {error}"
    must = f"must be a square matrix of finite numbers, of at most {MOST_VARIABLES} rows, in a "
    must += ".npy, .mtx, .csv or .mat file"
    text = f"got {shown(name)}, which {fault}; {must} beside the case; write one, or rows of numbers here"
    refuse([(place, text)] if fault else [])
    return matrix.tolist()


def _look_at(shape: tuple[int, ...]) -> None:
    """Refuse what is not square, or too large. Raises `Unreadable`."""
    if len(shape) != 2 or shape[0] != shape[1] or shape[0] > MOST_VARIABLES:
        raise Unreadable(f"has the shape {shape}")


def _loaded(path: Path, entry: str) -> Any:
    """The matrix of a file, sparse or not. Raises `Unreadable`, or what readers raise."""
    content = read_bytes(path, _WORDS, MOST_BYTES)
    match path.suffix.lower():
        case ".npy":
            return np.load(path, mmap_mode="r", allow_pickle=False)
        case ".csv":
            with warnings.catch_warnings(action="ignore"):  # of empty lines
                return np.loadtxt(BytesIO(content), delimiter=",", ndmin=2, max_rows=MOST_VARIABLES + 1)
        case ".mtx":
            from scipy.io import mmread  # 9 ms

            return mmread(BytesIO(content))
        case ".mat":
            from scipy.io import loadmat, whosmat  # 9 ms

            shapes = {name: shape for name, shape, _ in whosmat(BytesIO(content))}
            entry = entry or "".join(shapes)  # the name of the only one
            if entry not in shapes:
                raise Unreadable(f"holds {', '.join(shapes) or 'nothing'}: name one of these, as in {path.name}:A")
            _look_at(shapes[entry])  # before it is unpacked
            return loadmat(BytesIO(content), variable_names=[entry])[entry]
    raise Unreadable(f"is of a kind {path.suffix or 'without ending'}")
