"""Types and coefficients that every room knows."""

from __future__ import annotations

from collections.abc import Callable
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


def dense(matrix: Any) -> FloatArray:
    """An array of a matrix that may be sparse."""
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())
