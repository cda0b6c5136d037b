"""Ball arithmetic: real numbers as a midpoint and a radius that holds every rounding, by FLINT's Arb.

F. Johansson, Arb: efficient arbitrary-precision midpoint-radius interval arithmetic, IEEE Trans. Comput. 66, 2017.
Arrays of `arb` and `acb` are numpy arrays of objects. On these +, *, np.cos and np.sin act element by element.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError

if TYPE_CHECKING:
    from flint import acb, arb

PRECISION = 128
"""Bits of a midpoint: twice those of the floats in a certificate, as what is bounded are differences."""
TINY = 1e-300
"""More than what may be lost below the smallest normal number."""
Balls = NDArray[Any]
"""Of dtype object."""


class MissingFlint(FpsolveError):
    """python-flint is not installed."""


@contextmanager
def precision() -> Iterator[None]:
    """Compute with midpoints of `PRECISION` bits; for a block, or as a decorator for a function.

    Raises:
        MissingFlint: python-flint is not installed.
    """
    try:
        from flint import ctx
    except ImportError as failure:
        raise MissingFlint("proofs need python-flint; install it with: pip install 'fpsolve[proof]'") from failure
    with ctx.workprec(PRECISION):
        yield


def ball(number: float) -> arb:
    """A float as it stands."""
    import flint  # not from flint: that would take as long as the rest, a hundred thousand times

    return flint.arb(number)


def complex_ball(real: arb | float, imaginary: arb | float = 0.0) -> acb:
    """A complex number."""
    import flint

    return flint.acb(real, imaginary)


def each(function: Callable[[Any], Any], numbers: Any) -> Balls:
    """A function of each element, in the same shape."""
    found: Balls = np.frompyfunc(function, 1, 1)(numbers)
    return found


def balls(numbers: Any) -> Balls:
    """Floats as exact numbers, in the same shape."""
    return each(ball, np.asarray(numbers, dtype=float))


def roots(count: int) -> Balls:
    """√0, √1, …, so many of them."""
    return each(lambda m: ball(m).sqrt(), np.arange(count))


def matrix_product(a: Balls, b: Balls) -> Balls:
    """a @ b of real balls."""
    from flint import arb_mat

    left, right = (arb_mat(factor.shape[0], factor.shape[1], factor.ravel().tolist()) for factor in (a, b))
    return np.array((left * right).entries(), dtype=object).reshape(a.shape[0], b.shape[1])


def inverse(a: Balls) -> Balls:
    """a⁻¹ of real balls. Raises `ZeroDivisionError` where a may be singular."""
    from flint import arb_mat

    found = arb_mat(a.shape[0], a.shape[1], a.ravel().tolist()).inv()
    return np.array(found.entries(), dtype=object).reshape(a.shape)


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
    near, radius = (
        np.fromiter(map(float, found), float, numbers.size).reshape(numbers.shape)
        for found in (numbers.flat, (number.rad() for number in numbers.flat))
    )
    return near, np.abs(near) * 2.0**-52 + radius * (1 + 2.0**-20) + TINY


def magnitudes(numbers: Balls) -> FloatArray:
    """Floats above the absolute values of real balls."""
    near, off = rounded(numbers)
    return raised(np.abs(near) + off)


def raised(bound: Any, operations: int = 4) -> Any:
    """A bound that was computed in floats by so many operations on numbers ≥ 0, so that rounding is made up for."""
    return bound * (1 + 2.0**-51 * operations) + TINY
