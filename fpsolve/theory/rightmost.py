"""The rightmost eigenvalue of a generator of positive forms, as moments are, searched from the right.

No eigenvalue is nearer to a real σ > Λ than Λ, as none is on its right: a step to the left from a bound, by a share of
what is left, finds no other. On the left of Λ another one may be nearer.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from fpsolve.errors import NoHierarchy, SingularMatrix

ROUNDING = 10 * sys.float_info.epsilon
"""Error by rounding, over the terms of a sum."""
NEARER = 0.15
"""Share of σ − Λ that the next σ keeps."""
MOST_STEPS = 60
"""Largest number of σ."""
MOST_POLISHES = 10
"""Largest number of steps that polish Λ from there."""
ON_RIGHT = 1e-3
"""Size of 1/(σ − Λ) of an eigenvalue on the right of σ, over that of the nearest on its left, that is none."""
PASSED = 10.0
"""Factor to the last σ − Λ by which the next Λ is lower where rounding has put σ on the left of it: it is another."""
ROUGH = 1e-2
"""Tolerance of Arnoldi's method."""
MOST_VECTORS = 40
"""Number of its vectors from which it is restarted."""
MOST_RESTARTS = 50
"""Largest number of its restarts."""
REMEDY = "compare with `fpsolve simulate`"

Solve = Callable[..., Any]
"""(σ − H)⁻¹ of a vector, or its transpose for trans = 1."""


class Rates(Protocol):
    """H, in whatever form it is held.

    Attributes:
        settled: change of Λ over σ − Λ with which the search ends.
        krylov: least number of vectors of Arnoldi's method for a σ.
    """

    settled: float
    krylov: int

    @property
    def bound(self) -> float:
        """A number that no real part of an eigenvalue exceeds."""

    @property
    def largest(self) -> float:
        """The size of its largest entry."""

    def solver(self, sigma: float) -> Solve:
        """(σ − H)⁻¹. Raises `SingularMatrix`."""


class Eigenpair(NamedTuple):
    """An eigenvalue with its right and left vector, yᵀx = 1.

    Attributes:
        change: of the value by the last step, where that is not rounding.
        size: of the terms that the value is the sum of.
    """

    value: float
    x: Any
    y: Any
    change: float
    size: float


def rightmost(h: Rates, x: Any, near: float | None = None) -> tuple[float, float, Any]:
    """Roughly the rightmost eigenvalue, σ, and the right vector, from a positive one.

    `near` is a σ that may be next to it, from which the search begins if no eigenvalue is seen on its right.
    """
    bound = h.bound + 0.1 * max(1e-3 * h.largest, abs(h.bound), sys.float_info.min)
    value, away, start, sigma = -np.inf, np.inf, x, bound if near is None else min(near, bound)
    for _ in range(MOST_STEPS):
        last, (share, least, x) = value, _largest(h.solver(sigma), x, h.krylov)
        if np.isinf(last) and sigma < bound and least < -ON_RIGHT * share:
            return rightmost(h, start)
        value = sigma - 1 / share
        if last - value > PASSED * away:
            return last, last + away, start
        if abs(value - last) <= h.settled * (sigma - value):
            break
        away = sigma - value
        sigma = value + NEARER * away
    return value, sigma, x


def polished(h: Any, value: float, sigma: float, x: Any, y: Any) -> Eigenpair:
    """The eigenvalue to all digits, from a σ on its right, by inverse iteration on both sides.

    Args:
        h: H, of which `nearest` is the share of σ − Λ that each σ keeps.
        value: Λ, roughly.
        sigma: σ.
        x, y: a right and a left vector.
    """
    sigma, change, rounding = value + h.nearest * (sigma - value), 0.0, 0.0
    for _ in range(MOST_POLISHES):
        try:
            solve = h.solver(sigma)
        except SingularMatrix:  # it is an eigenvalue to the last digit
            break
        for _ in range(2):
            x, y = (each / np.max(np.abs(each)) for each in (solve(x), solve(y, 1)))
        last, value = value, float(y @ (h @ x)) / float(y @ x)
        change, rounding = abs(value - last), ROUNDING * h.sizes(x, y) / abs(float(y @ x))
        if change <= 0.1 * rounding:
            x, y = solve(x), solve(y, 1)  # as vectors settle half as fast, and derivatives need them
            break
        sigma = value + max(1e-3 * rounding, ROUNDING**2 * h.largest, h.nearest * (sigma - value))
    y = y / (y @ x)
    return Eigenpair(value, x, y, change if change > rounding else 0.0, h.sizes(x, y))


def _largest(solve: Solve, x: Any, krylov: int) -> tuple[float, float, Any]:
    """The largest real part of an eigenvalue of a positive map, roughly, the least one, and the vector of the first.

    They are sought from a positive vector.
    """
    if x.size <= krylov:
        values, vectors = np.linalg.eig(solve(np.eye(x.size)))
        at, least = int(np.argmax(values.real)), float(values.real.min())
        return float(values[at].real), least, vectors[:, at] if np.iscomplexobj(x) else vectors[:, at].real
    known, images = np.empty((MOST_VECTORS + 1, x.size), x.dtype), np.zeros(2 * (MOST_VECTORS + 1,), x.dtype)
    for _ in range(MOST_RESTARTS):  # Arnoldi's method
        known[0], images[:] = x / np.linalg.norm(x), 0.0
        for k in range(MOST_VECTORS):
            images[: k + 2, k], known[k + 1] = orthogonal(known[: k + 1], solve(known[k]))
            if k + 1 < krylov and images[k + 1, k]:
                continue
            values, vectors = np.linalg.eig(images[: k + 1, : k + 1])
            at = int(np.argmax(values.real))
            left = abs(images[k + 1, k] * vectors[k, at])
            if left <= ROUGH * abs(values[at]):
                break
        x = vectors[:, at] @ known[: k + 1]
        x = x if np.iscomplexobj(known) else x.real
        if left <= ROUGH * abs(values[at]):
            return float(values[at].real), float(values.real.min()), x
    raise NoHierarchy(f"no rightmost eigenvalue is found among those of {x.size} equations; {REMEDY}")


def orthogonal(known: Any, new: Any) -> tuple[Any, Any]:
    """The shares of orthonormal rows in a vector, and of what is left, and this at the length 1."""
    shares = np.conj(known @ np.conj(new))
    rest = new - shares @ known
    more = np.conj(known @ np.conj(rest))  # once more, as rounding leaves some
    rest -= more @ known
    size = np.linalg.norm(rest)
    return np.append(shares + more, size), rest / (size or 1.0)
