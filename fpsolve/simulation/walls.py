"""What a path may come to: lines through the origin at which the norm grows, or a wall for one of the variables."""

from __future__ import annotations

from typing import NamedTuple

from fpsolve.arrays import FloatArray


class Rays(NamedTuple):
    """All lines of a system.

    Attributes:
        along, across: unit vectors along each line, and the same turned by 90°, shape (rays, 2).
        logs: ln R.
        ways: the side to which the line is crossed, 1 or −1.
    """

    along: FloatArray
    across: FloatArray
    logs: FloatArray
    ways: FloatArray


class Floor(NamedTuple):
    """A wall at rest, in coordinates of which the first is its distance q and the second q̇.

    Under white noise a path in a step comes to the wall at another time than the smooth one that is taken.

    Attributes:
        restitution: R.
        fast: how fast an impact must be over each of the |variables| to count, shape (n,).
        is_white: 1.0 where dW drives q̇, else 0.0.
    """

    restitution: float
    fast: FloatArray
    is_white: float
