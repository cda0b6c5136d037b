"""What is solved: a motion and the noise that drives it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar, overload

from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import Diffusion
from fpsolve.model.plane import System

AnyNoise = Diffusion | MarkovChain
P = ParamSpec("P")
R_co = TypeVar("R_co", covariant=True)


@dataclass(frozen=True)
class Problem:
    """A motion and its noise.

    Attributes:
        system: `VibroImpactOscillator`, or a `PlaneSystem`.
        noise: `OrnsteinUhlenbeck`, or `NonGaussianNoise` for Eq. (7) as it stands, or a `MarkovChain`.
    """

    system: System
    noise: AnyNoise


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
        return (kwargs.pop("problem"), *args)
    halves = list(args[:2])
    for name in ("oscillator", "noise")[len(halves) :]:
        if name not in kwargs:
            raise TypeError(f"{name} is missing; the first arguments must be an oscillator and a noise, or a Problem")
        halves.append(kwargs.pop(name))
    for half, kind, needed in zip(halves, ("motion", "noise"), ("drives", "spectral_density"), strict=True):
        if not hasattr(half, needed):
            raise TypeError(f"got {half!r} as a {kind}; the first arguments must be an oscillator and a noise")
    return (Problem(*halves), *args[2:])
