"""Ball arithmetic: real numbers as a midpoint and a radius that holds every rounding, by FLINT's Arb.

F. Johansson, Arb: efficient arbitrary-precision midpoint-radius interval arithmetic, IEEE Trans. Comput. 66, 2017.
Arrays of `arb` and `acb` are numpy arrays of objects, on which + and * act element by element.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from functools import wraps
from operator import attrgetter, methodcaller
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError

if TYPE_CHECKING:
    from flint import arb

PRECISION = 128
"""Bits of a midpoint: twice those of the numbers that certificates hold, as what is bounded are differences."""
TINY = 1e-300
"""More than what may be lost below the smallest normal number."""
Balls = NDArray[Any]
"""Of dtype object."""
P = ParamSpec("P")
R = TypeVar("R")


class MissingFlint(FpsolveError):
    """python-flint is not installed."""


@contextmanager
def precision(bits: int = PRECISION) -> Iterator[None]:
    """Compute with midpoints of so many bits.

    Raises:
        MissingFlint: python-flint is not installed.
    """
    try:
        from flint import ctx
    except ImportError as failure:
        raise MissingFlint("proofs need python-flint; install it with: pip install 'fpsolve[proof]'") from failure
    with ctx.workprec(bits):
        yield


def in_balls(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function compute with `PRECISION` bits."""

    @wraps(function)
    def with_precision(*args: P.args, **kwargs: P.kwargs) -> R:
        with precision():
            return function(*args, **kwargs)

    return with_precision


def ball(number: str | float | Fraction | int) -> arb:
    """What encloses a number: a decimal as text, a fraction, or a float as it stands."""
    from flint import arb, fmpq

    if isinstance(number, str):
        number = Fraction(number)
    if isinstance(number, Fraction):
        return arb(fmpq(number.numerator, number.denominator))
    return arb(number)


def balls(numbers: Any) -> Balls:
    """Floats as exact numbers, in the same shape."""
    numbers = np.asarray(numbers, dtype=float)
    return np.array([ball(each) for each in numbers.ravel().tolist()], dtype=object).reshape(numbers.shape)


def mapped(function: str, numbers: Balls) -> Balls:
    """A method of each ball, such as "cos"."""
    return _of_each(methodcaller(function), numbers)


def field(name: str, numbers: Balls) -> Balls:
    """An attribute of each ball, such as "real"."""
    return _of_each(attrgetter(name), numbers)


def _of_each(function: Callable[[Any], Any], numbers: Balls) -> Balls:
    found = np.empty(numbers.size, dtype=object)
    found[:] = [function(each) for each in numbers.ravel().tolist()]
    return found.reshape(numbers.shape)


def matrix_product(a: Balls, b: Balls) -> Balls:
    """a @ b of real balls."""
    from flint import arb_mat

    left, right = (arb_mat(each.shape[0], each.shape[1], each.ravel().tolist()) for each in (a, b))
    return np.array((left * right).entries(), dtype=object).reshape(a.shape[0], b.shape[1])


def above(number: arb) -> float:
    """The smallest float, or the one beyond it, that is above a ball."""
    return _beyond(number.upper(), math.inf)


def below(number: arb) -> float:
    """The largest float, or the one beyond it, that is below a ball."""
    return _beyond(number.lower(), -math.inf)


def _beyond(bound: arb, direction: float) -> float:
    if not bound.is_finite():
        return direction
    near = float(bound)
    is_beyond = near >= bound if direction > 0 else near <= bound
    return near if is_beyond else math.nextafter(near, direction)


def rounded(numbers: Balls) -> tuple[FloatArray, FloatArray]:
    """Floats near real balls, and by how much the balls may differ from them at most."""
    flat = numbers.ravel().tolist()
    near = np.array([float(each) for each in flat])
    radius = np.array([float(each.rad()) for each in flat])
    off = np.abs(near) * 2.0**-52 + radius * (1 + 2.0**-20) + TINY
    return near.reshape(numbers.shape), off.reshape(numbers.shape)


def magnitudes(numbers: Balls) -> FloatArray:
    """Floats above the absolute values of real balls."""
    near, off = rounded(numbers)
    return raised(np.abs(near) + off)


def raised(bound: Any, operations: int = 4) -> Any:
    """A bound that was computed in floats by so many operations on numbers ≥ 0, so that rounding is made up for."""
    return bound * (1 + 2.0**-51 * operations) + TINY
