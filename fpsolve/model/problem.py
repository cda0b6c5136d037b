"""What is solved: a motion and the noise that drives it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, real_numbers
from fpsolve.errors import NoSuchExponent
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import Diffusion, check_existence
from fpsolve.model.plane import System, crosses_both_ways

AnyNoise = Diffusion | MarkovChain
P = ParamSpec("P")
R_co = TypeVar("R_co", covariant=True)


@dataclass(frozen=True)
class Problem:
    """A motion and its noise.

    Attributes:
        system: `VibroImpactOscillator`, or a `PlaneSystem`.
        noise: `OrnsteinUhlenbeck`, or `NonGaussianNoise` for Eq. (7) as it stands, or a `MarkovChain`.

    Raises:
        TypeError: one of them is something else.
    """

    system: System
    noise: AnyNoise

    def __post_init__(self) -> None:
        halves = ((self.system, "motion", "drives"), (self.noise, "noise", "spectral_density"))
        for half, kind, needed in halves:
            if isinstance(half, type) or not hasattr(half, needed):
                raise TypeError(f"got {half!r} as a {kind}; the first arguments must be an oscillator and a noise")


def refuse_infinite(problem: Problem, p: float) -> None:
    """Refuse a p for which E‖x‖^p is infinite, or carried by a layer that no mesh resolves.

    Where the noise moves the phase to and fro over a ray at which ‖x‖^p grows by R^p, crossings add up. The speed of a
    diffusing noise changes between them by a factor u with E u^s = ½/sin(π(2s + 5)/6), H. P. McKean, J. Math. Kyoto
    Univ. 2, 1963, so that they have a finite mean only for R^p < 2 = 1/min E u^s. For a chain the layer is thin for
    R^p > e.

    Raises:
        NoSuchExponent: p is not among the `moments` of the noise, or there is such a ray.
    """
    noise, system = problem.noise, problem.system
    check_existence(noise, p)
    if not any(p * kick.log_factor > math.log(2.0) for kick in system.kicks):
        return
    if isinstance(noise, MarkovChain):
        xi, most = np.array(noise.states), math.e
    else:
        xi, most = min(noise.half_width, 1e6 * noise.standard_deviation) * np.linspace(-1, 1, 1001), 2.0
    for kick in system.kicks:
        if p * kick.log_factor > math.log(most) and crosses_both_ways(system, kick, xi):
            raise NoSuchExponent(
                f"Λ({p:g}) is infinite or out of reach: the noise moves the phase to and fro over the ray at "
                f"{kick.phase:.6g}, where ‖x‖^p grows by a factor > {most:.3g} each time; choose a p nearer to 0, or a "
                "ray on which no noise acts"
            )


def checked_moments(p: ArrayLike, problem: Problem, *, may_be_empty: bool = False) -> FloatArray:
    """p as an array of shape (n,), every one finite and with a finite Λ(p). Raises `ValueError`, `NoSuchExponent`."""
    points = real_numbers(p, "p", may_be_empty=may_be_empty)
    for point in points:
        refuse_infinite(problem, float(point))
    return points


class OfProblem(Protocol[P, R_co]):
    """A function of a `Problem`, or of its two halves."""

    @overload
    def __call__(self, problem: Problem, /, *args: P.args, **kwargs: P.kwargs) -> R_co: ...

    @overload
    def __call__(self, oscillator: System, noise: AnyNoise, /, *args: P.args, **kwargs: P.kwargs) -> R_co: ...


def of_problem(function: Callable[Concatenate[Problem, P], R_co]) -> OfProblem[P, R_co]:
    """Let a function whose first argument is a problem also take (oscillator, noise) there, by name or place."""

    @wraps(function)
    def with_pair(*args: Any, **kwargs: Any) -> R_co:
        return function(*problem_first(args, kwargs), **kwargs)

    return with_pair


def of_problem_too(method: Callable[..., None]) -> Callable[..., None]:
    """The same for a method, such as `__init__`."""

    @wraps(method)
    def with_pair(self: Any, *args: Any, **kwargs: Any) -> None:
        method(self, *problem_first(args, kwargs), **kwargs)

    return with_pair


def problem_first(args: tuple[Any, ...], kwargs: dict[str, Any]) -> tuple[Any, ...]:
    """Arguments with the problem made of the first two, if it is not the first; keywords that were used are removed.

    Raises:
        TypeError: there is neither a problem nor a motion and a noise.
    """
    if args and isinstance(args[0], Problem):
        return args
    if "problem" in kwargs:
        if not isinstance(kwargs["problem"], Problem):
            raise TypeError(
                f"got problem = {kwargs['problem']!r}; must be a Problem, made of an oscillator and a noise"
            )
        return (kwargs.pop("problem"), *args)
    halves = list(args[:2])
    for name in ("oscillator", "noise")[len(halves) :]:
        if name not in kwargs:
            raise TypeError(f"{name} is missing; the first arguments must be an oscillator and a noise, or a Problem")
        halves.append(kwargs.pop(name))
    return (Problem(*halves), *args[2:])
