"""Any linear system in the plane, from its coefficient matrices or from a function of parameters that makes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.polynomial import chebyshev
from pydantic import BaseModel, Field
from pydantic.fields import FieldInfo

from fpsolve.arrays import FloatArray, identity, one, real_number, shown
from fpsolve.model.faults import TableError
from fpsolve.model.parameters import STRICT, parameter, stated_field, unknown_parameter
from fpsolve.model.plane import MOST_VARIABLES, CoefficientMatrix, Jump, Stop, System, as_plane, by_epsilon, is_driven
from fpsolve.model.quantity import Quantity
from fpsolve.model.systems.equations import EquationSystem, walls_of

Parts = Sequence[CoefficientMatrix] | tuple[Sequence[CoefficientMatrix], Sequence[Jump]]
"""The terms of a system, or these and its jumps."""
NODES = 9
"""Number of values of a parameter that give a derivative by it."""
REACH = 0.05
"""Distance of the farthest of these values, as a share of the parameter."""
LEAST = 0.05
"""Size that a smaller parameter counts as."""


@dataclass(frozen=True)
class Scaled:
    """Terms with numbers in place of the names by which they are multiplied, a function for `PlaneSystem.of`.

    Attributes:
        terms: pairs of a name, or "" for none, and a term.
        jumps: which do not change.
    """

    terms: Sequence[tuple[str, CoefficientMatrix]]
    jumps: Sequence[Jump] = ()

    def __call__(self, **values: float) -> tuple[Sequence[CoefficientMatrix], Sequence[Jump]]:
        sizes = {"": 1.0, **values}
        scaled = [replace(term, matrix=(sizes[name] * np.array(term.matrix)).tolist()) for name, term in self.terms]
        return scaled, self.jumps


Pair = Annotated[tuple[float, float], Field(strict=False)]


class StatedTerm(BaseModel):
    """A term in a case file."""

    model_config = STRICT

    matrix: Annotated[
        Annotated[tuple[Pair, Pair], Field(strict=False)],
        parameter("the matrix by which the state is multiplied", "matrix = [[0.0, 1.0], [-1.0, 0.0]]"),
    ]
    order: Annotated[int, parameter("the power of epsilon", "order = 0", ge=0)] = 0
    noise: Annotated[
        bool | Annotated[str, Field(pattern="[A-Za-z0-9_-]+")],
        parameter("whether the noise multiplies it; of several noises the name of one", "noise = true"),
    ] = False
    factor: Annotated[str, parameter("the parameter that multiplies it", 'factor = "damping"')] = ""


class StatedJump(BaseModel):
    """A jump in a case file."""

    model_config = STRICT

    phase: Annotated[float, parameter("where the phase passes a ray, in radians", "phase = 1.5707963267948966")]
    log_factor: Annotated[float, parameter("the logarithm of the factor of the state", "log_factor = -0.1")]


@dataclass(frozen=True)
class PlaneSystem(System):
    """A linear system in the plane from its parts, see `System`.

    >>> from fpsolve.model import CoefficientMatrix
    >>> PlaneSystem([CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2)))]).dimension
    2

    Args:
        terms: one at least.
        jumps: stretches at rays that are passed with a speed which no noise changes, as x = 0 is where ẋ = v.
        epsilon: ε > 0.
        build: makes both from parameters, see `of`, which is the usual way.
        named: the values of these parameters by their names.

    Raises:
        ValueError: there is no term, or ε is not a positive number.
    """

    terms: Sequence[CoefficientMatrix]
    jumps: Sequence[Jump] = ()
    epsilon: float = 1.0
    build: Callable[..., Parts] | None = None
    named: tuple[tuple[str, float], ...] = ()

    kind: ClassVar[str] = "plane"
    dimensions: ClassVar[Sequence[int]] = (2,)
    stated: ClassVar[Mapping[str, FieldInfo]] = {
        "terms": stated_field(
            Annotated[tuple[StatedTerm, ...], Field(strict=False, min_length=1)],
            "the terms of the motion",
            "terms = [{ matrix = [[0.0, 1.0], [-1.0, 0.0]] }]",
        ),
        "jumps": stated_field(
            Annotated[tuple[StatedJump, ...], Field(strict=False)],
            "jumps of the state at rays",
            "jumps = [{ phase = 1.5707963267948966, log_factor = -0.1 }]",
            (),
        ),
    }

    def __post_init__(self) -> None:
        for name, kind in (("terms", CoefficientMatrix), ("jumps", Jump)):
            given = getattr(self, name)
            stated = tuple(given) if isinstance(given, Iterable) else (None,)
            if not all(isinstance(each, kind) for each in stated):
                raise TypeError(f"got {name} = {shown(given)}; must be a list, each a {kind.__name__}")
            object.__setattr__(self, name, stated)
        real_number(self.epsilon, "epsilon")
        rays = np.sort(np.mod([jump.phase for jump in self.jumps], math.pi))
        if np.any(np.diff(np.append(rays, rays[:1] + math.pi)) < 1e-6) and rays.size > 1:
            raise ValueError(f"got jumps at {[jump.phase for jump in self.jumps]}; their phases must differ modulo pi")
        if not self.terms or not (math.isfinite(self.epsilon) and self.epsilon > 0):
            raise ValueError(
                f"got {len(self.terms)} terms and epsilon = {self.epsilon}; needs one at least, and a positive number"
            )
        sizes = sorted({len(term.matrix) for term in self.terms})
        if len(sizes) > 1 or sizes[0] not in self.dimensions:
            known = " to ".join(map(str, sorted({min(self.dimensions), max(self.dimensions)})))
            raise ValueError(
                f"got matrices of {' and '.join(map(str, sizes))} rows; {type(self).__name__} takes {known}, the same "
                "for all terms" + ("; take LinearSystem for more" if max(sizes) > max(self.dimensions) else "")
            )
        if sizes == [1]:
            size = max(abs(term.matrix[0][0]) for term in self.terms)
            object.__setattr__(self, "terms", as_plane(self.terms, size or 1.0))
        if self.jumps and sizes[0] != 2:
            raise ValueError(
                f"got {len(self.jumps)} jumps of a system of {sizes[0]} variables; jumps are for two "
                "variables only: leave them out"
            )

    @classmethod
    def of(cls, build: Callable[..., Parts], *, epsilon: float = 1.0, **named: float) -> Self:
        """The system that a function makes from named parameters, by each of which it has sensitivities and charts.

        >>> def beam(omega, damping):  # ẍ + 2 damping ẋ + (omega² + ξ) x = 0
        ...     free = CoefficientMatrix(0, ((0.0, 1.0), (-(omega**2), -2 * damping)))
        ...     return [free, CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), lambda xi: xi)]
        >>> PlaneSystem.of(beam, omega=2.0, damping=0.1).values["damping"]
        0.1

        Args:
            build: takes the parameters by name and returns the terms, or the terms and the jumps; smooth in each, with
                the same number of both for all values; a function of a module, so that results can be pickled.
            epsilon: ε > 0.
            named: the values of the parameters.

        Raises:
            ValueError: a parameter is not a finite number or is called epsilon, or as `PlaneSystem`.
        """
        for name, value in named.items():
            try:
                real_number(value, name)
            except ValueError:
                raise ValueError(f"got {name} = {value!r}; must be a finite number") from None
        terms, jumps = _parts(build, named)
        return cls(terms, jumps, epsilon, build, tuple((name, float(value)) for name, value in named.items()))

    @classmethod
    def of_terms(
        cls,
        terms: Sequence[tuple[str, CoefficientMatrix]],
        jumps: Sequence[Jump] = (),
        *,
        epsilon: float = 1.0,
        **named: float,
    ) -> Self:
        """The system whose terms are multiplied by named parameters.

        >>> stiffness, damping = ((0.0, 0.0), (-1.0, 0.0)), ((0.0, 0.0), (0.0, -2.0))
        >>> free = CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.0)))
        >>> PlaneSystem.of_terms([("", free), ("c", CoefficientMatrix(0, damping))], c=0.1).terms[1].matrix
        ((0.0, 0.0), (0.0, -0.2))

        Args:
            terms: pairs of the name of a parameter, or "" for none, and a term.
            jumps: stretches at rays.
            epsilon: ε > 0.
            named: the values of the parameters.

        Raises:
            ValueError: as `of`, or the names of the terms are not those of the values.
        """
        names = {name for name, _ in terms if name}
        if names != named.keys():
            raise ValueError(
                f"got values of {sorted(named)}; must be of {sorted(names)}, the names that the terms carry"
            )
        return cls.of(Scaled(tuple(terms), tuple(jumps)), epsilon=epsilon, **named)

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
            variables: their names, two; more for a system beyond the plane, which has one wall at most.
            drift: their rates: linear in the variables and affine in the noise, of numbers, names, + - * / **, pi,
                exp() and sqrt().
            parameters: values by names. One called epsilon is ε, in whose powers all coefficients must be polynomials.
            noises: what the noise is called in the rates, and which section of keys it has; {"xi": "noise"} if None.
            walls: where the state is reflected, v⁺ = −R v⁻ at x = 0, R = `restitution` a number or an expression; there
                ẋ must be c v, c > 0.

        Raises:
            ValueError: with the place and the term that is not what it must be.
        """
        known = {
            "parameters": {} if parameters is None else parameters,
            "noises": {"xi": "noise"} if noises is None else noises,
        }
        for key, given in known.items():
            if not isinstance(given, Mapping):
                raise TableError(f"got {shown(given)}; must be a mapping from names", key)
        named, noise = (tuple(each.items()) for each in known.values())
        return EquationSystem(variables, drift, named, noise, walls_of(walls))  # type: ignore[arg-type]

    @classmethod
    def takes(cls, key: str, table: Mapping[str, Any]) -> bool:
        """Any key: it is a parameter."""
        return True

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> PlaneSystem:
        named = {name: value for name, value in table.items() if name not in cls.stated}
        terms = [
            (each.factor, CoefficientMatrix(each.order, each.matrix, identity if each.noise else one, name))
            for each, name in ((each, each.noise if isinstance(each.noise, str) else "") for each in table["terms"])
        ]
        jumps = [Jump(each.phase, each.log_factor) for each in table.get("jumps", ())]
        return cls.of_terms(terms, jumps, **named)

    @property
    def noise_sections(self) -> Sequence[str]:
        """The sections of the noises that the terms name."""
        names = dict.fromkeys(term.noise for term in self.terms if is_driven(term.g))
        return tuple(f"noise.{name}" if name else "noise" for name in names) or super().noise_sections

    @property
    def values(self) -> Mapping[str, float | str]:
        """ε, and the named parameters."""
        return {"epsilon": float(self.epsilon), **dict(self.named)}

    def quantity_of(self, name: str) -> Quantity:
        """ε, or a named parameter, whose unit is not known."""
        key = f"{self.section}.{name}"
        return Quantity(key, key, "small parameter", r"$\varepsilon$") if name == "epsilon" else unknown_parameter(key)

    def at(self, values: Mapping[str, float | str]) -> Self:
        unknown = [name for name in values if name not in self.values]
        if unknown:
            raise ValueError(f"got {unknown[0]}; the parameters are {', '.join(self.values)}")
        new: dict[str, Any] = {**self.values, **values}
        epsilon = new.pop("epsilon")
        if self.build is None:
            return replace(self, epsilon=epsilon)
        terms, jumps = _parts(self.build, new)
        return replace(self, terms=terms, jumps=jumps, epsilon=epsilon, named=tuple(new.items()))

    def derivative(self, name: str) -> tuple[tuple[CoefficientMatrix, ...], tuple[float, ...]]:
        """∂/∂ε, or ∂/∂θ by the derivative of the polynomial through the matrices for `NODES` values of θ around it.

        Raises:
            ValueError: the number of terms or the rays of the jumps change with θ.
        """
        if name == "epsilon":
            return by_epsilon(self), ()
        assert self.build is not None
        named = dict(self.named)
        half = REACH * max(abs(named[name]), LEAST)
        x = np.cos(np.pi * np.arange(NODES) / (NODES - 1))
        around = [_parts(self.build, {**named, name: named[name] + half * each}) for each in x]
        middle = _parts(self.build, named)
        if any(_form(each) != _form(middle) for each in around):
            raise ValueError(
                f"the terms, their g or the rays of the jumps change with {name}; only matrices and ln R may"
            )
        polynomials = np.linalg.inv(chebyshev.chebvander(x, NODES - 1))  # by their values at x
        weights = np.asarray(chebyshev.chebval(0.0, chebyshev.chebder(polynomials))) / half
        matrices = _weighed(weights, [[term.matrix for term in terms] for terms, _ in around])
        slopes = _weighed(weights, [[jump.log_factor for jump in jumps] for _, jumps in around])
        changed = [replace(term, matrix=a.tolist()) for term, a in zip(middle[0], matrices, strict=True) if a.any()]
        return as_plane(changed), tuple(slopes.tolist()) if slopes.any() else ()


@dataclass(frozen=True)
class LinearSystem(PlaneSystem):
    """ẋ = Σ ε^k g(ξ) A x for a state x of n = 1 to 200 numbers, from its coefficient matrices; see `PlaneSystem`.

    >>> from fpsolve.model import CoefficientMatrix
    >>> free = CoefficientMatrix(0, ((0, 1, 0), (-1, -0.2, 0.5), (0, -0.5, -1)))  # an oscillator with a voltage
    >>> LinearSystem([free]).dimension
    3

    Args:
        terms: one at least, all of the same n.
        jumps: stretches at rays, for n = 2 alone.
        epsilon, build, named: as in `PlaneSystem`.
        stop: the wall of one coordinate, for n ≥ 3 alone.

    Raises:
        ValueError: as `PlaneSystem`, or the matrices differ in their size, or there are jumps beyond the plane.
    """

    stop: Stop | None = None

    kind: ClassVar[str] = "linear"
    dimensions: ClassVar[Sequence[int]] = range(1, MOST_VARIABLES + 1)


def _parts(
    build: Callable[..., Parts], named: Mapping[str, float]
) -> tuple[Sequence[CoefficientMatrix], Sequence[Jump]]:
    """The terms and the jumps that a function makes."""
    made: Any = tuple(build(**named))
    return (made, ()) if not made or isinstance(made[-1], CoefficientMatrix) else made


def _form(parts: tuple[Sequence[CoefficientMatrix], Sequence[Jump]]) -> tuple[Any, ...]:
    """The orders of the terms and the rays of the jumps, which must not change with a parameter."""
    terms, jumps = parts
    return tuple(term.order for term in terms), tuple(jump.phase for jump in jumps)


def _weighed(weights: FloatArray, values: Any) -> FloatArray:
    """The sum of values times weights, without what is zero but for rounding."""
    values = np.array(values)
    total, sizes = (np.tensordot(w, v, 1) for w, v in ((weights, values), (np.abs(weights), np.abs(values))))
    return np.where(np.abs(total) > 1e-14 * sizes, total, 0.0)
