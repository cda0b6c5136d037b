"""Types and coefficients that every room knows."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fpsolve.errors import NumericalFailure

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix  # takes a while to import

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.integer[Any]]
Mask = NDArray[np.bool_]
Matrix: TypeAlias = "FloatArray | csr_matrix"
"""An array, or any sparse matrix."""
Coefficient = Callable[[Any], Any]
"""A function of φ or ξ, from an array to an array of the same shape."""
ROUNDED = 1e-12
"""Share of the largest terms of a sum below which the sum is 0 but for rounding."""


def read_only(array: FloatArray) -> FloatArray:
    """The array itself, into which nobody can write any more."""
    array.setflags(write=False)
    return array


class ReadOnly:
    """A dataclass whose arrays nobody can write into."""

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                read_only(value)


@dataclass(frozen=True)
class Constant:
    """The coefficient c."""

    value: float = 1.0

    def __call__(self, x: Any) -> Any:
        return np.full_like(np.asarray(x, dtype=float), self.value)


@dataclass(frozen=True)
class Linear:
    """The coefficient x."""

    def __call__(self, x: Any) -> Any:
        return x


one, identity, nothing = Constant(), Linear(), Constant(0.0)
"""The coefficients 1, x and 0."""


def finite(array: FloatArray) -> FloatArray:
    """The array itself. Raises `NumericalFailure` where a number in it is infinite or NaN."""
    if not np.isfinite(array).all():
        raise NumericalFailure("array must not contain infs or NaNs")
    return array


def is_log_spaced(values: Iterable[Any]) -> bool:
    """Whether several positive numbers lie more evenly by their ratios than by their differences, and far apart."""
    distinct = np.unique(np.array([value for value in values if not isinstance(value, str)], dtype=float))
    if distinct.size < 3 or distinct[0] <= 0 or distinct[-1] < 4 * distinct[0]:
        return False
    steps, factors = np.diff(distinct), np.diff(np.log(distinct))
    return bool(np.std(factors) * np.mean(steps) < np.std(steps) * np.mean(factors))


def is_whole(value: Any, least: int, most: float = math.inf) -> bool:
    """Whether a value is a whole number from one to another; True and False are none."""
    return isinstance(value, int | np.integer) and type(value) is not bool and bool(least <= value <= most)


def require(value: object, kinds: Any, name: str, must: str) -> None:
    """Refuse an argument of another type, or True and False. Raises `TypeError`, one sentence with its name."""
    if not isinstance(value, kinds) or isinstance(value, bool):
        raise TypeError(f"got {name} = {shown(value)}; must be {must}")


def real_number(value: Any, name: str) -> float:
    """One number; texts and booleans are none. Raises `ValueError` where it is not a finite real number."""
    array = _finite(value)
    if array is None or array.ndim:
        raise ValueError(f"{name} must be a finite number, got {shown(value)}")
    return float(array)


def real_numbers(values: Any, name: str, *, may_be_empty: bool = False) -> FloatArray:
    """One number, or several, as an array of shape (n,); texts, booleans and masked entries are none.

    Raises:
        ValueError: they are not finite real numbers, or there are none and there must be some.
    """
    array = _finite(values)
    if array is None or array.ndim > 1 or not (array.size or may_be_empty):
        size = "" if may_be_empty else "non-empty "
        raise ValueError(f"{name} must be a finite number or a {size}list of finite numbers, got {shown(values)}")
    return np.atleast_1d(array)


def real_array(values: Any, name: str) -> FloatArray:
    """Numbers as an array of their shape. Raises `ValueError` where they are not finite real numbers."""
    array = _finite(values)
    if array is None:
        raise ValueError(f"{name} must be a finite number or an array of finite numbers, got {shown(values)}")
    return array


def _finite(values: Any) -> FloatArray | None:
    """Finite real numbers as an array of their shape, or None where they are something else."""
    with suppress(ValueError, OverflowError):  # of lists of unequal lengths, and of whole numbers beyond all floats
        array = np.asarray(values)
        is_listed = array is not values or array.dtype == object
        listed = np.asarray(values, dtype=object).ravel() if is_listed else ()
        is_plain = not np.ma.is_masked(values) and {bool, np.bool_}.isdisjoint(map(type, listed))
        is_real = array.dtype.kind in "iuf" or (
            array.dtype == object and all(isinstance(each, Real | Decimal) for each in listed)
        )
        if is_real and is_plain:
            numbers = array.astype(float)
            if np.all(np.isfinite(numbers)):
                return numbers
    return None


def shown(value: Any) -> str:
    """A value as Python writes it, in one line of a readable length."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # of a whole number with thousands of digits
        return "a number too long to show"
    return shortened(text)


def shortened(text: str, most: int = 60) -> str:
    """A text cut to a readable length."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def dense(matrix: Any) -> FloatArray:
    """An array of a matrix that may be sparse."""
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())


def bound_in_words(bound: float) -> str:
    """5/3, and the float below it, as 5/3, not as 1.6666666666666667; 1e15 as it stands here."""
    fraction = Fraction(bound).limit_denominator(99)
    is_simple = fraction.denominator > 1 and math.isclose(fraction, bound, rel_tol=1e-15)
    return str(fraction) if is_simple or isinstance(bound, int) else re.sub(r"e\+?(-?)0*", r"e\1", f"{bound:g}")
