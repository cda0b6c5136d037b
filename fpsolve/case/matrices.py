"""Matrices of modes that stand in files beside a case: .npy, .mtx of Matrix Market, sparse or not, and .csv."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np

from fpsolve.arrays import FloatArray, real_array
from fpsolve.case.explain import refuse
from fpsolve.files import Unreadable, Words, read_bytes
from fpsolve.model.faults import shown
from fpsolve.model.systems.modal import MOST_MODES

KEYS = ("mass", "stiffness", "damping", "gyroscopic", "circulatory", "stiffness_noise", "damping_noise")
"""Keys of [system] that may name a file."""
MOST_BYTES = 2**26
"""Of a file."""
_WORDS = Words("the matrix", "a matrix", "mass.npy", ".npy, .mtx or .csv", "write rows of numbers")


def with_matrices(table: Mapping[str, object], folder: Path) -> dict[str, object]:
    """The table of modes with the matrices of the files that it names. Raises `pydantic.ValidationError`."""
    found = dict(table)
    for key in KEYS:
        given = table.get(key)
        if isinstance(given, dict):  # of several noises
            found[key] = {name: _read(each, folder, key, name) for name, each in given.items()}
        elif key in table:
            found[key] = _read(given, folder, key)
    return found


def _read(name: object, folder: Path, *place: str) -> object:
    """The rows of a file; what is no name of one is left."""
    if not isinstance(name, str):
        return name
    matrix, fault = np.zeros((0, 0)), "is no file"
    try:
        if (folder / name).exists():
            matrix, fault = real_array(_loaded(folder / name), "it"), ""
            _look_at(matrix.shape)
    except Unreadable as error:
        fault = error.sentence.partition(";")[0]
    except Exception as error:  # each format raises its own kinds
        fault = f"cannot be read: {error}"
    must = f"must be a square matrix of finite numbers, of at most {MOST_MODES} rows, in a .npy, .mtx or .csv file"
    text = f"got {shown(name)}, which {fault}; {must} beside the case; write one, or rows of numbers here"
    refuse([(place, text)] if fault else [])
    return matrix.tolist()


def _look_at(shape: tuple[int, ...]) -> None:
    """Refuse what is not square, or too large. Raises `Unreadable`."""
    if len(shape) != 2 or shape[0] != shape[1] or shape[0] > MOST_MODES:
        raise Unreadable(f"has the shape {shape}")


def _loaded(path: Path) -> FloatArray:
    """The numbers of a file, of whose header the size is read first. Raises `Unreadable`, or what readers raise."""
    content = read_bytes(path, _WORDS, MOST_BYTES)
    match path.suffix.lower():
        case ".npy":
            found = np.load(path, mmap_mode="r", allow_pickle=False)
            _look_at(found.shape)  # before it is read
            return np.asarray(found)
        case ".csv":
            with warnings.catch_warnings(action="ignore"):  # of empty lines
                return np.loadtxt(BytesIO(content), delimiter=",", ndmin=2, max_rows=MOST_MODES + 1)
        case ".mtx":
            from scipy.io import mmread  # 9 ms

            matrix = mmread(BytesIO(content))
            _look_at(matrix.shape)  # before a sparse one is filled
            return np.asarray(matrix if isinstance(matrix, np.ndarray) else matrix.toarray())
    raise Unreadable(f"is of a kind {path.suffix or 'without ending'}")
