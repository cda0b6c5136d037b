"""Numbers that are known by another way than fpsolve's: a row for each, with what it is asked of, and its source.

A new value is a row in the file of its subject in `rows`; `test_values.py` solves all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from fpsolve import ExponentSolver, Problem, moment_lyapunov, sensitivities
from fpsolve.exponent import even_moment, lyapunov_exponent, stability_index


@dataclass(frozen=True)
class Quantity:
    """A number of a problem: `solved` gives its value and its stated error."""

    name: str
    solved: Callable[[Problem], tuple[float, float]]


@dataclass(frozen=True)
class Row:
    """A number of a problem, as it is known.

    Attributes:
        problem: itself, or a function that makes it.
        quantity: what is asked of it, see below.
        value: the number, or a second method: a function without arguments that finds it.
        doubt: how far the value may be off.
        most: the largest error that fpsolve may state.
        source: where the value is from, in words.
        slow: it takes more than half a second.
    """

    problem: Problem | Callable[[], Problem]
    quantity: Quantity
    value: float | Callable[[], float]
    doubt: float
    most: float
    source: str
    slow: bool = False


def moment(p: float, **options: Any) -> Quantity:
    """Λ(p), by elements, or as `moment_lyapunov` chooses; `options` are its own."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = moment_lyapunov(problem, p, **options)
        return float(found.value[0]), float(found.error_estimate[0])

    return Quantity(f"Λ({p:g})", solved)


def slope(p: float, **options: Any) -> Quantity:
    """Λ′(p)."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = moment_lyapunov(problem, p, **options)
        return float(found.derivative[0]), float(found.derivative_error[0])

    return Quantity(f"Λ′({p:g})", solved)


def closed(p: int, tolerance: float | None = None) -> Quantity:
    """Λ(p) of an even p by the closed equations of the moments."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = even_moment(problem, p, tolerance)
        return found.value, found.error

    return Quantity(f"closed Λ({p})", solved)


@lru_cache(16)
def slopes(problem: Problem, p: float) -> Any:
    """∂Λ(p)/∂θ of all parameters, once for the rows of one problem."""
    return sensitivities(problem, p).moments[0]


def by(key: str, p: float) -> Quantity:
    """∂Λ(p)/∂θ of a parameter by its key."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = slopes(problem, p)[key]
        return found.value, found.error_estimate

    return Quantity(f"∂Λ({p:g})/∂{key}", solved)


def closed_by(key: str, p: int) -> Quantity:
    """∂Λ(p)/∂θ of an even p by the closed equations of the moments."""
    return Quantity(f"closed ∂Λ({p})/∂{key}", lambda problem: even_moment(problem, p).slope(key))


def exponent(**options: Any) -> Quantity:
    """λ."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = lyapunov_exponent(problem, **options)
        return found.value, found.error_estimate

    return Quantity("λ", solved)


def index(**options: Any) -> Quantity:
    """δ_p."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = stability_index(problem, **options)
        assert found, found
        return found.value, found.error_estimate

    return Quantity("δ_p", solved)


def variance_rate(**options: Any) -> Quantity:
    """Λ″(0)."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = ExponentSolver(problem, **options).variance_rate()
        return found.value, found.error_estimate

    return Quantity("Λ″(0)", solved)


def moments(
    problem: Problem | Callable[[], Problem],
    values: dict[float, float | Callable[[], float]],
    doubt: float,
    most: float,
    source: str,
    **options: Any,
) -> Sequence[Row]:
    """Rows of Λ(p) of one problem, by p."""
    return [Row(problem, moment(p, **options), value, doubt, most, source) for p, value in values.items()]


def number(solve: Callable[..., Any], **options: Any) -> Quantity:
    """Any other number of a solver, as `impact_rate`."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = solve(ExponentSolver(problem, **options))
        return found.value, found.error_estimate

    return Quantity(solve.__name__, solved)


def slope_by(key: str, p: float, **options: Any) -> Quantity:
    """∂Λ(p)/∂key, for p = 0 that of λ."""

    def solved(problem: Problem) -> tuple[float, float]:
        found = sensitivities(problem, p or 1.0, **options)
        by = found.moments[0] if p else found.summary_numbers["lyapunov_exponent"]
        return by[key].value, by[key].error_estimate

    return Quantity(f"∂Λ({p:g})/∂{key}", solved)
