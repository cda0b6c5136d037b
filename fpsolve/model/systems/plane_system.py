"""Any linear system, from its coefficient matrices."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import ClassVar, Self, cast

import numpy as np

from fpsolve.arrays import real_number, require, shown
from fpsolve.model.faults import TableError
from fpsolve.model.plane import (
    CoefficientMatrix,
    CubicTerms,
    Jump,
    LinearMotion,
    ParameterDerivative,
    Stop,
    as_plane,
)
from fpsolve.model.systems.equations import EquationSystem, walls_of


@dataclass(frozen=True)
class LinearSystem(LinearMotion):
    """ẋ = Σ ε^k g(ξ) A x for a state x of n = 1 to 200 numbers, from its parts, see `LinearMotion`.

    >>> from fpsolve.model import CoefficientMatrix, LinearSystem
    >>> free = CoefficientMatrix(0, ((0, 1, 0), (-1, -0.2, 0.5), (0, -0.5, -1)))  # an oscillator with a voltage
    >>> LinearSystem([free]).dimension
    3

    Args:
        terms: one at least, all of the same n.
        jumps: stretches at rays that are passed with a speed which no noise changes, as x = 0 is where ẋ = v, n = 2.
        epsilon: ε > 0.
        stop: the wall of one coordinate, n ≥ 3.
        cubic: what is of degree 3 in its rates, n = 2, by which it has a stationary response; None for nothing.

    Raises:
        ValueError: there is no term, these differ in n, ε is not a positive number, or n is none that a part is for.
    """

    parts: ClassVar[Sequence[str]] = ("terms", "jumps", "epsilon", "stop", "cubic")

    def __post_init__(self) -> None:
        for each in fields(LinearMotion):
            if each.name not in self.parts and vars(self)[each.name] != each.default:
                raise TypeError(f"got {each.name}; {type(self).__name__} has {', '.join(self.parts)}; leave it out")
        require(self.stop, Stop | None, "stop", "a Stop, or None")
        require(self.cubic, CubicTerms | None, "cubic", "CubicTerms, or None")
        for name, given, kind in (("terms", self.terms, CoefficientMatrix), ("jumps", self.jumps, Jump)):
            stated = tuple(given) if isinstance(given, Iterable) else (None,)
            if not all(isinstance(each, kind) for each in stated):
                raise TypeError(f"got {name} = {shown(given)}; must be a list, each a {kind.__name__}")
            object.__setattr__(self, name, stated)
        real_number(self.epsilon, "epsilon")
        rays = np.sort(np.mod([jump.phase for jump in self.jumps], math.pi))
        if np.any(np.diff(np.append(rays, rays[:1] + math.pi)) < 1e-6) and rays.size > 1:
            raise ValueError(f"got jumps at {[jump.phase for jump in self.jumps]}; their phases must differ modulo pi")
        sizes = {len(term.matrix) for term in self.terms}
        if not (sizes and math.isfinite(self.epsilon) and self.epsilon > 0):
            raise ValueError(
                f"got {len(self.terms)} terms and epsilon = {self.epsilon}; needs one at least, and a positive number"
            )
        if len(sizes) > 1:
            told = " and ".join(map(str, sorted(sizes)))
            raise ValueError(f"got matrices of {told} rows; must have as many in all terms")
        if sizes != {2} and (self.jumps or self.cubic):
            told = f"got jumps or cubic terms of a system of {sizes.pop()} variables"
            raise ValueError(f"{told}; these are for two variables only: leave them out")
        object.__setattr__(self, "terms", as_plane(self.terms))

    @staticmethod
    def of_equations(
        variables: Sequence[str],
        drift: Sequence[str],
        parameters: Mapping[str, float] | None = None,
        *,
        noises: Mapping[str, str] | None = None,
        walls: Sequence[Mapping[str, float | str]] = (),
    ) -> EquationSystem:
        """The system of rates that are written as text, with exact derivatives by each of its parameters.

        >>> rates = "v", "-omega**2 * x - 2*zeta*omega * v - xi * x"  # ẍ + 2ζω ẋ + (ω² + ξ) x = 0
        >>> wall = {"at": "x = 0", "restitution": 0.8}
        >>> PlaneSystem.of_equations(("x", "v"), rates, {"omega": 2.0, "zeta": 0.1}, walls=[wall]).terms[0].matrix
        ((0.0, 1.0), (-4.0, -0.4))

        Args:
            variables: their names, two; more for a system beyond the plane.
            drift: their rates: linear in the variables and affine in the noise, of numbers, names, + - * / **, pi,
                exp() and sqrt().
            parameters: values by names. One called epsilon is ε, in whose powers all coefficients must be polynomials.
            noises: what the noise is called in the rates, and which section of keys it has; {"xi": "noise"} if None.
            walls: one reflection at most: v⁺ = −R v⁻ at x = 0, where ẋ must be c v, c > 0. R = `restitution` is a
                number or an expression.

        Raises:
            ValueError: with the place and the term that is not what it must be.
        """
        parameters, noises = {} if parameters is None else parameters, {"xi": "noise"} if noises is None else noises
        for key, given in (("parameters", parameters), ("noises", noises)):
            if not isinstance(given, Mapping):
                raise TableError(f"got {shown(given)}; must be a mapping from names", key)
        return EquationSystem(variables, drift, tuple(parameters.items()), tuple(noises.items()), walls_of(walls))

    @property
    def noise_sections(self) -> Sequence[str]:
        """The sections of the noises that the terms name."""
        return tuple(f"noise.{name}" if name else "noise" for name in self.driven_by) or super().noise_sections

    @property
    def values(self) -> Mapping[str, float | str]:
        return {"epsilon": float(self.epsilon)}

    def _with(self, values: Mapping[str, float | str]) -> Self:
        return replace(self, epsilon=cast("float", values.get("epsilon", self.epsilon)))

    def derivative(self, name: str) -> ParameterDerivative:
        return ParameterDerivative(terms=self.by_epsilon())


PlaneSystem = LinearSystem
"""One of two variables, as most are."""
