"""Lines through the origin at which the norm grows."""

from __future__ import annotations

from typing import NamedTuple

from fpsolve.arrays import FloatArray


class Rays(NamedTuple):
    """All of a system.

    Attributes:
        along, across: unit vectors along each line, and the same turned by 90°, shape (rays, 2).
        logs: ln R.
        ways: the side to which the line is crossed, 1 or −1.
    """

    along: FloatArray
    across: FloatArray
    logs: FloatArray
    ways: FloatArray
