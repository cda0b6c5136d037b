"""Functions of the noise ξ, in the inner product weighted by its stationary law.

Where P_s falls fast, or ends, they are its orthogonal polynomials: one element on the whole support. On a given
interval, and for algebraic tails, they are continuous elements in z = ξ/std. A Markov chain has a value for each state.
The noise's part of the generator is −½∫P_s σ²(ξ) u′v′: constants are in its kernel in every space.

With a tilt s every function carries the factor exp(s (z − c)): where T ~ exp(s z) the polynomials stand for what is
left of it. The products of two functions are then weighted by P_s exp(2s z), which for Ornstein-Uhlenbeck noise is P_s
moved by 2s, however far that is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, Self

import numpy as np

from fpsolve.arrays import Coefficient, FloatArray, IntArray, Matrix, dense, one
from fpsolve.fem.axis import DividedAxis, FunctionAxis, ModeEffects, Rule
from fpsolve.fem.element import located, middles
from fpsolve.fem.line import LineSpace
from fpsolve.model.noise import Noise, NoiseDerivative
from fpsolve.polynomials import Polynomials, gegenbauer, hermite, logarithm, stieltjes

GAUSSIAN_REACH = 9.0
"""Distance from its centre, in standard deviations, beyond which nothing is left of a weight like a Gaussian."""
SHARP_ENDS = 50.0
"""Least exponent a of P_s ~ (1 − |z|)^a that leaves next to nothing at the ends of its support."""
NEAR_END = 1e-9
"""Distance from an end of the support, over its half width, at which σ² is asked whether it vanishes there."""
VANISHES = 1e-6
"""Largest share of σ² at ξ = 0 that is taken for none."""
STEP = 1e-5
"""Largest step of ξ, over the largest |ξ|, by which a coefficient is differentiated."""
MORE_POINTS = 16
"""Number of points of a quadrature beyond the number of polynomials."""
MAX_COUNT = 200
"""Largest number of polynomials, or highest degree of other functions; beyond, some are added for an error only."""


class Samples(NamedTuple):
    """Functions of a space at some points.

    Attributes:
        xi: the points, shape (n,).
        weight: the weight of the space there, shape (n,): a density in ξ, or probabilities.
        measure: what a point stands for in ∫ dξ, shape (n,); 1 for a state.
        values: E with u(ξ) = E @ coefficients, without the factor of the space, shape (n, size).
        factor: the factor that every function carries, shape (n,).
    """

    xi: FloatArray
    weight: FloatArray
    measure: FloatArray
    values: Matrix
    factor: FloatArray


@dataclass(frozen=True, eq=False)
class NoiseAxis(FunctionAxis):
    """What the generator and its users ask of the functions of ξ; matrices are arrays, or sparse where they are large.

    Attributes:
        noise: ξ.
        word: what the functions are, as a table says it.
        dimension: of the state of the noise.
        p: the moment that the tilt is for.
        center: c of the factor exp(s (z − c)) that every function carries, about the mean z of the weight.
        is_local: whether the functions can follow a kink in ξ.
    """

    noise: Any

    word, dimension = "", 1
    p, center, is_local = 1.0, 0.0, True

    @property
    def tilt(self) -> float:
        """s of this factor."""
        return self.slope * self.p

    @property
    def xi(self) -> FloatArray:
        """ξ at the points at which `product` takes a function."""
        raise NotImplementedError

    def product(self, f: FloatArray) -> Matrix:
        """∫ f u v in the weight of the axis, from f at the points ξ."""
        raise NotImplementedError

    def mass(self, g: Coefficient = one) -> Matrix:
        return self.product(g(self.xi))

    def changed(self, change: NoiseDerivative, g: Coefficient | None) -> Matrix:
        if g is None:
            return self._changed_generator(change)
        return self.product(self._changed_law(change) * g(self.xi) + slope_along(g, self.xi, self._moved(change)))

    def _changed_generator(self, change: NoiseDerivative) -> Matrix:
        """∂/∂θ of `generator()`."""
        raise NotImplementedError

    def _changed_law(self, change: NoiseDerivative) -> Any:
        """∂ ln P_s/∂θ at the points ξ, their own motion left out."""
        return 0.0

    def _moved(self, change: NoiseDerivative) -> FloatArray:
        """∂ξ/∂θ at the points ξ: a length by which ξ is measured may change."""
        return change.log_scale * self.xi

    def of(self, noise: Noise, p: float) -> Self:
        """The functions for a noise, with the tilt for p; no tables are kept."""
        return replace(self, noise=noise, **({"p": p} if self.slope else {}))

    @property
    def facts(self) -> dict[str, Any]:
        return {"xi": self.word, "xi_size": self.size, "tilt": self.tilt}

    def samples(self) -> Samples:
        """At the points of the rule, or at the states."""
        raise NotImplementedError

    def finer_samples(self, count: int) -> Samples:
        """At the points of a rule for functions with kinks, some `count`."""
        return self.samples()

    def projection(self, other: Any) -> Matrix:
        """The matrix that takes a function on another axis to its projection on this one, shape (size, other.size)."""
        return np.eye(self.size, other.size)

    def law(self) -> FloatArray:
        """The stationary law as weights of the `samples`, shape (n,)."""
        weights = self.rule.measure / self.samples().factor ** 2
        return weights / weights.sum()

    def everywhere(self, count: int) -> tuple[FloatArray, Matrix]:
        """ξ that cover a bounded support, the ends included, some `count`, and the functions there with their factor.

        Returns:
            ξ, shape (n,), and values, shape (n, size); all states, if there are states.
        """
        at = self.samples()
        return at.xi, at.values


@dataclass(frozen=True, eq=False)
class CountedAxis(NoiseAxis):
    """Functions on the whole of a noise by their degree: one cell, of which the function 1 is the first.

    Attributes:
        count: how many, or up to which degree.
    """

    count: int
    is_local = False

    @cached_property
    def cells(self) -> IntArray:
        return np.zeros(self.size, dtype=int)

    def enriched(self) -> Self:
        return replace(self, count=self.count + max(3, self.count // 8))

    def doubled(self) -> Self:
        return replace(self, count=min(2 * self.count, MAX_COUNT))

    def raised(self) -> Self:
        return replace(self, count=min(self.count + 2, MAX_COUNT))

    def refined(self, effects: ModeEffects, share: float) -> Self:
        needed = math.ceil(effects.needed(share)[0])
        return replace(self, count=max(self.count // 2, 3, min(needed, 3 * self.count // 2 + 3, MAX_COUNT)))


class LineAxis(NoiseAxis):
    """What functions on the line of a diffusion share; the points of their rule are z.

    Attributes:
        log_mass: ln ∫ P_s exp(2s z).
    """

    log_mass = 0.0

    @cached_property
    def unit(self) -> float:
        """ξ/z."""
        return float(self.noise.standard_deviation)

    def rate(self, z: FloatArray) -> FloatArray:
        """½σ²/std², the diffusion of z."""
        return 0.5 * self.noise.squared_diffusion(self.unit * z) / self.unit**2

    @property
    def xi(self) -> FloatArray:
        return self.unit * self.rule.points

    def energy(self, f: FloatArray) -> Matrix:
        """∫ f (u′ + s u)(v′ + s v) in the weight of the axis, from f at the points of the rule."""
        raise NotImplementedError

    def generator(self) -> Matrix:
        """−½ ∫ P_s σ² (u′ + s u)(v′ + s v); at the ends no probability flux is the natural condition."""
        return -self.energy(self.rate(self.rule.points))

    def _changed_generator(self, change: NoiseDerivative) -> Matrix:
        own = 2 * (change.log_diffusion - change.log_scale) * self.matrix(None)
        return own - self.energy(self.rate(self.rule.points) * self._changed_law(change))

    def _changed_law(self, change: NoiseDerivative) -> FloatArray:
        logs, measure = self._changed_logs(change), self.rule.measure
        return logs - measure @ logs / measure.sum()

    def _changed_logs(self, change: NoiseDerivative) -> FloatArray:
        """∂ ln P_s/∂θ at the points of the rule, but for a constant."""
        return change.log_density(self.xi)

    def values_at(self, z: FloatArray) -> Matrix:
        """The functions at any z, shape (len(z), size)."""
        raise NotImplementedError

    def everywhere(self, count: int) -> tuple[FloatArray, Matrix]:
        """At points that are closer to each other near the ends, as those of Chebyshev."""
        z = -self.noise.half_width / self.unit * np.cos(np.linspace(0, np.pi, count + 1))
        return self.unit * z, self.values_at(z) * self._factor(z)[:, None]

    def finer_samples(self, count: int) -> Samples:
        """At midpoints of intervals, smaller ones near the ends of a bounded support."""
        end, x = self.noise.half_width / self.unit, (2 * np.arange(count) + 1) / count - 1
        if math.isfinite(end):
            z, measure = end * np.sin(0.5 * np.pi * x), end * np.cos(0.5 * np.pi * x) * np.pi / count
        else:
            z, measure = self.center + GAUSSIAN_REACH * x, np.full(count, 2 * GAUSSIAN_REACH / count)
        return self.at(z, self.unit * measure)

    def _factor(self, z: FloatArray) -> FloatArray:
        return np.exp(np.clip(self.tilt * (z - self.center), -600, 600))

    def weight(self, z: FloatArray) -> FloatArray:
        """P_s exp(2s z) as a density of z: its integral is 1."""
        logs = self.noise.log_density(self.unit * z) + 2 * self.tilt * z - self.log_mass
        return self.unit * np.exp(logs)

    def at(self, z: FloatArray, measure: Any = 0.0) -> Samples:
        """At any z, with what each stands for, in ξ."""
        return Samples(
            self.unit * z, self.weight(z) / self.unit, measure + np.zeros_like(z), self.values_at(z), self._factor(z)
        )

    def started(self, xi: float) -> FloatArray:
        """The functions with their factor at one ξ, shape (size,)."""
        at = self.at(np.array([xi]) / self.unit)
        return dense(at.values)[0] * at.factor[0]

    def samples(self) -> Samples:
        z, measure, _ = self.rule[:3]
        return self.at(z, self.unit * measure / self.weight(z))

    def projection(self, other: LineAxis) -> FloatArray:
        z, measure, values = self.rule[:3]
        exponent = other.tilt * (z - other.center) - self.tilt * (z - self.center)
        scaled = (measure * np.exp(np.clip(exponent, -600, 600)))[:, None] * dense(other.values_at(z))
        return np.linalg.solve(dense(self.matrix(one)), values.T @ scaled)


class Table(NamedTuple):
    """A `Rule` with ∂/∂z and the tilt at its points, ln ∫ P_s exp(2s z), and the polynomials of (z − shift)/scale."""

    points: FloatArray
    measure: FloatArray
    values: FloatArray
    slopes: FloatArray
    log_mass: float
    polynomials: Polynomials
    shift: float
    scale: float


@lru_cache(maxsize=64)
def _hermite_table(count: int) -> Table:
    """That of Gaussian noise without a tilt."""
    polynomials, (x, weights) = hermite(count), hermite(count + MORE_POINTS).rule
    return Table(x, weights, *polynomials.at(x), 0.0, polynomials, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class PolynomialAxis(CountedAxis, LineAxis):
    """Orthogonal polynomials: with P_s ~ (1 − x²)^a, x = ξ/ξ_s, and σ² ~ (1 − x²)^b at the ends of the noise those of

        P_s σ² exp(2s z)/(1 − x²),

    whose weight has the exponent a + b − 1: their derivatives are orthogonal in P_s σ². All matrices are banded: for
    Ornstein-Uhlenbeck noise, on the whole line, that of 1 is the identity, that of L_ξ without a tilt is diagonal, and
    that of ξ has one diagonal on each side. Near ±ξ_s expansions converge only like powers.

    Attributes:
        noise: P_s must end, or fall like a Gaussian.
        count: the number of polynomials.
        slope: s/p.
    """

    slope: float = 0.0
    p: float = 1.0

    word = "polynomials"

    @property
    def is_orthonormal(self) -> bool:  # type: ignore[override]
        return math.isinf(self.noise.half_width)

    @property
    def band(self) -> int:  # type: ignore[override]
        return 1 if self.is_orthonormal else 3

    @property
    def size(self) -> int:
        return self.count

    @cached_property
    def center(self) -> float:  # type: ignore[override]
        return float(self.rule.measure @ self.rule.points)

    @cached_property
    def modes(self) -> IntArray:
        return np.arange(self.count)

    @property
    def slowest(self) -> float:  # type: ignore[override]
        return 0.0 if math.isinf(self.noise.half_width) else 1.0

    @cached_property
    def rule(self) -> Table:  # type: ignore[override]
        tilt, end = self.tilt, self.noise.half_width / self.unit
        if math.isinf(end):
            x, weights, values, slopes, *_, polynomials, _, _ = _hermite_table(self.count)
            return Table(x + 2 * tilt, weights, values, slopes + tilt * values, 2 * tilt**2, polynomials, 2 * tilt, 1.0)
        # the exponent a + b − 1 of the weight, and 1 − b, by which P_s falls more; b < 1 counts as 0, for a ≤ 0 as 1
        middle, near = self.noise.squared_diffusion(self.noise.half_width * np.array([0.0, 1 - NEAR_END]))
        missing = float(self.noise.end_exponent > 0 and near >= VANISHES * middle)  # the weight must be integrable
        exponent = self.noise.end_exponent - missing
        more = min(abs(tilt) * end, 4 * tilt**2)
        points = 16 * math.ceil((2 * self.count + MORE_POINTS + more) / 16)  # few rules serve many spaces
        x, weights = gegenbauer(points, exponent).rule
        damping, logs = (1 - x**2) ** missing, np.log(weights) + 2 * tilt * end * x
        tilted = np.exp(logs - logs.max())
        polynomials = stieltjes(x, tilted, self.count) if tilt else gegenbauer(self.count, exponent)
        values, slopes = polynomials.at(x)
        log_mass = math.log((tilted @ damping) / (weights @ damping)) + logs.max()
        measure, slopes = tilted * damping / (tilted @ damping), slopes / end + tilt * values
        return Table(end * x, measure, values, slopes, log_mass, polynomials, 0.0, end)

    @property
    def log_mass(self) -> float:  # type: ignore[override]
        return self.rule.log_mass

    def product(self, f: FloatArray) -> FloatArray:
        return form(self.rule.values, self.rule.measure * f)

    def energy(self, f: FloatArray) -> FloatArray:
        return form(self.rule.slopes, self.rule.measure * f)

    def _changed_logs(self, change: NoiseDerivative) -> FloatArray:
        logs, a = super()._changed_logs(change), self.noise.end_exponent
        if change.end_exponent and a < SHARP_ENDS:  # no rule of Gauss takes its ln(1 − x²) near ±1 as it stands
            x = self.rule.points / self.rule.scale
            logs = logs + change.end_exponent * (logarithm(x, a, x.size) - np.log1p(-(x**2)))
        return logs

    def values_at(self, z: FloatArray) -> FloatArray:
        return self.rule.polynomials.at((z - self.rule.shift) / self.rule.scale)[0]


@dataclass(frozen=True, eq=False)
class CellAxis(DividedAxis, LineAxis):
    """Continuous elements on an interval of z within the support, for given meshes and algebraic tails."""

    word = "cells"

    @property
    def size(self) -> int:
        return int(np.sum(self.degrees)) + 1

    @property
    def facts(self) -> dict[str, Any]:
        return super().facts | {"xi_min": float(self.lines[0]), "xi_max": float(self.lines[-1])}

    @cached_property
    def line(self) -> LineSpace:
        """The elements, in the weight P_s. Raises `MeshError` where those of a cell cannot be told apart."""
        end, exponent = self.noise.half_width / self.unit, self.noise.end_exponent
        reaches = (self.lines[0] <= -end * (1 - 1e-12), self.lines[-1] >= end * (1 - 1e-12))
        ends = (exponent * reaches[0], exponent * reaches[1])
        return LineSpace(self.lines, self.degrees, self.weight, end_exponents=ends)

    @cached_property
    def rule(self) -> Rule:
        return Rule(self.line.points, self.line.measure, self.line.values)

    @cached_property
    def cells(self) -> IntArray:
        return self.line.cells

    @cached_property
    def modes(self) -> IntArray:
        return self.line.modes

    @cached_property
    def constant(self) -> FloatArray:
        return self.line.constant()

    def between(self, lines: FloatArray) -> CellAxis:
        """Those between other lines, each with the degree of the cell that its middle is in, or is next to."""
        own, _ = located(self.lines, middles(lines), None)
        return self.on(lines, self.degrees[own])

    def reaching(self, below: bool, above: bool) -> CellAxis:
        """With one more cell at the ends whose effect exceeds its share."""
        first, last, end = self.lines[0], self.lines[-1], self.noise.half_width / self.unit * (1 - 1e-12)
        lower = [max(1.6 * first, -end)] if below and first > -end else []
        upper = [min(1.6 * last, end)] if above and last < end else []
        return self.between(np.concatenate([lower, self.lines, upper]))

    def product(self, f: FloatArray) -> Matrix:
        return self.stored(self.line.mass(f))

    def energy(self, f: FloatArray) -> Matrix:
        return self.stored(self.line.stiffness(f))

    @cached_property
    def nested(self) -> Matrix:
        return self.line.nested

    def values_at(self, z: FloatArray) -> Matrix:
        return self.line.at(z)


@dataclass(frozen=True, eq=False)
class StateAxis(NoiseAxis):
    """One value for each state of a Markov chain: ∫ P_s becomes a sum over the states with their probabilities."""

    word, dimension = "states", 0

    @property
    def size(self) -> int:
        return self.xi.size

    @cached_property
    def xi(self) -> FloatArray:
        return np.array(self.noise.states)

    @cached_property
    def rule(self) -> Rule:
        return Rule(self.xi, self.noise.probabilities, np.eye(self.size))

    @cached_property
    def constant(self) -> FloatArray:
        return np.ones(self.size)

    @cached_property
    def _rates(self) -> FloatArray:
        return np.array(self.noise.rates)

    def product(self, f: FloatArray) -> FloatArray:
        return np.diag(self.rule.measure * f)

    def generator(self) -> FloatArray:
        """diag(π) Q."""
        return self.rule.measure[:, None] * self._rates

    def _changed_rates(self, change: NoiseDerivative) -> FloatArray:
        """∂Q."""
        return np.array(change.rates) if change.rates else np.zeros((self.size, self.size))

    def _changed_generator(self, change: NoiseDerivative) -> FloatArray:
        logs = self._changed_law(change)[:, None]
        return self.rule.measure[:, None] * (logs * self._rates + self._changed_rates(change))

    def _changed_law(self, change: NoiseDerivative) -> FloatArray:
        """With ∂π from πQ = 0: (∂π)Q = −π ∂Q, of the sum 0."""
        unit = np.abs(self._rates).max()
        equations = np.vstack([self._rates.T / unit, np.ones(self.size)])
        right = np.append(-self.rule.measure @ self._changed_rates(change) / unit, 0.0)
        return np.linalg.lstsq(equations, right, rcond=None)[0] / self.rule.measure

    def _moved(self, change: NoiseDerivative) -> FloatArray:
        return np.array(change.states) if change.states else np.zeros(self.size)

    def started(self, xi: float) -> FloatArray:
        """The functions at one ξ, shape (size,): their mean over the states that have this value."""
        chosen = np.isclose(self.xi, xi, rtol=1e-9, atol=0) * self.rule.measure
        return chosen / chosen.sum()

    def samples(self) -> Samples:
        return Samples(self.xi, self.rule.measure, np.ones(self.size), self.rule.values, np.ones(self.size))


def slope_along(g: Coefficient, xi: FloatArray, moved: FloatArray) -> FloatArray:
    """g′(ξ) ∂ξ/∂θ, from the points ξ and ∂ξ/∂θ there."""
    step = STEP * (np.abs(xi).max() or 1.0) / (np.abs(moved).max() or 1.0)
    return (g(xi + step * moved) - g(xi - step * moved)) / (2 * step)


def form(values: FloatArray, measure: FloatArray) -> FloatArray:
    """∫ of the products of functions, without what is zero but for rounding."""
    matrix = (values * measure[:, None]).T @ values
    matrix[np.abs(matrix) < 1e-13 * np.max(np.abs(matrix))] = 0.0
    return matrix
