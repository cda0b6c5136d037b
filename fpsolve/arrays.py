"""Types and coefficients that every room knows."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from decimal import Decimal
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Coefficient = Callable[[Any], Any]
"""A function of φ or ξ, from an array to an array of the same shape."""


def one(x: Any) -> Any:
    """The constant coefficient 1."""
    return np.ones_like(x)


def identity(x: Any) -> Any:
    """The coefficient x."""
    return x


def real_numbers(values: Any, name: str) -> FloatArray:
    """One number, or several, as an array of shape (n,), n ≥ 1; texts, booleans and masked entries are none.

    Raises:
        ValueError: they are not finite real numbers, or there are none.
    """
    with suppress(ValueError, OverflowError):  # of lists in lists, and of whole numbers beyond all floats
        array = np.atleast_1d(np.asarray(values))
        listed = values if isinstance(values, list | tuple) else array.tolist() if array.dtype == object else []
        is_plain = not np.ma.is_masked(values) and not any(isinstance(each, bool | np.bool_) for each in listed)
        is_real = array.dtype.kind in "iuf" or (
            array.dtype == object and all(isinstance(each, Real | Decimal) for each in listed)
        )
        if array.ndim == 1 and array.size and is_real and is_plain:
            numbers = array.astype(float)
            if np.all(np.isfinite(numbers)):
                return numbers
    said = " ".join(repr(values).split())
    said = said if len(said) <= 60 else f"{said[:57]}..."
    raise ValueError(f"{name} must be a finite number or a non-empty list of finite numbers, got {said}")


def dense(matrix: Any) -> FloatArray:
    """An array of a matrix that may be sparse."""
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())
