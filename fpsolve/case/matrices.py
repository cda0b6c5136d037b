"""Matrices of modes that stand in files beside a case: .npy, .mtx of Matrix Market, sparse or not, and .csv."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray, real_array, shown
from fpsolve.explain import refuse

KEYS = ("mass", "stiffness", "damping", "gyroscopic", "circulatory", "stiffness_noise", "damping_noise")
"""Keys of [system] that may name a file."""


def with_matrices(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The table of modes with the matrices of the files that it names. Raises `pydantic.ValidationError`."""
    found = dict(table)
    for key in KEYS:
        given = table.get(key)
        if isinstance(given, dict):  # of several noises
            found[key] = {name: _read(each, folder, key, name) for name, each in given.items()}
        elif key in table:
            found[key] = _read(given, folder, key)
    return found


def _read(name: Any, folder: Path, *place: str) -> Any:
    """The rows of a file; what is no name of one is left."""
    if not isinstance(name, str):
        return name
    try:
        matrix = real_array(_loaded(folder / name), "it")
        fault = "" if matrix.ndim == 2 and len({*matrix.shape}) == 1 else f"has the shape {matrix.shape}"
    except (OSError, ValueError, TypeError) as error:
        matrix, fault = np.zeros((0, 0)), f"cannot be read: {error}"
    if not (folder / name).is_file():
        fault = "is no file"
    must = "must be a square matrix of finite numbers in a .npy, .mtx or .csv file beside the case"
    text = f"got {shown(name)}, which {fault}; {must}; write one, or rows of numbers here"
    refuse([(place, name, text)] if fault else [])
    return matrix.tolist()


def _loaded(path: Path) -> FloatArray:
    """Raises `OSError`, `ValueError`."""
    match path.suffix.lower():
        case ".npy":
            return np.asarray(np.load(path, allow_pickle=False))
        case ".csv":
            return np.loadtxt(path, delimiter=",", ndmin=2)
        case ".mtx":
            from scipy.io import mmread

            found = mmread(path)
            return np.asarray(found if isinstance(found, np.ndarray) else found.toarray())
    raise ValueError(f"of a kind {path.suffix or 'without ending'}")
