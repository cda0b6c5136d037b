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
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from fpsolve.arrays import Coefficient, FloatArray, dense, one
from fpsolve.fem.axis import Axis
from fpsolve.fem.phase import MAX_DENSE_UNKNOWNS
from fpsolve.model.noise import Noise, NoiseDerivative
from fpsolve.polynomials import Polynomials, gegenbauer, hermite, logarithm, stieltjes

REACH = 9.0
"""Noise units on either side of its centre, beyond which nothing is left of a weight that falls like a Gaussian."""
SHARP_ENDS = 50.0
"""Exponents from which on P_s leaves next to nothing at the ends of its support."""
NEAR_END, VANISHES = 1e-9, 1e-6
"""σ² vanishes at the ends of the support where so near to one it is less than this share of that at ξ = 0."""
STEP = 1e-5
"""Of ln ξ, by which a coefficient is differentiated."""
MORE_POINTS = 16
"""Quadrature points beyond the number of polynomials."""


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
    values: Any
    factor: FloatArray


class NoiseAxis(Axis):
    """What the generator and its users ask of the functions of ξ; matrices are arrays, or sparse where they are large.

    Attributes:
        tilt: s of the factor exp(s (z − c)) that every function carries.
        center: c, about the mean z of the weight.
        values: the functions at the points of a quadrature rule, or at the states, without factor, shape (n, size).
        measure: ∫ of the weight at those points, shape (n,).
        is_local: whether the functions can follow a kink in ξ.
    """

    tilt, center, is_local = 0.0, 0.0, True
    values: Any
    measure: FloatArray

    def __init__(self) -> None:
        super().__init__()
        self._changes: dict[tuple[NoiseDerivative, Coefficient | None], Any] = {}

    def changed(self, change: NoiseDerivative, g: Coefficient | None) -> Any:
        """∂/∂θ of `mass(g)`, for None of `generator()`, where the noise changes and the functions of ξ do not."""
        raise NotImplementedError

    def changed_matrix(self, change: NoiseDerivative, g: Coefficient | None) -> Any:
        """`changed(change, g)`, made once."""
        if (change, g) not in self._changes:
            self._changes[change, g] = self.changed(change, g)
        return self._changes[change, g]

    def generator_of_one(self) -> FloatArray:
        """`generator` with v the function 1, times the factor; shape (size,)."""
        return np.zeros(self.size)

    def samples(self) -> Samples:
        """At the points of the rule, or at the states."""
        raise NotImplementedError

    def finer_samples(self, count: int) -> Samples:
        """At the points of a rule for functions with kinks, some `count`."""
        return self.samples()

    def law(self) -> FloatArray:
        """The stationary law as weights of the `samples`, shape (n,)."""
        weights = self.measure / self.samples().factor ** 2
        return np.asarray(weights / weights.sum())

    def everywhere(self, count: int) -> tuple[FloatArray, Any]:
        """ξ that cover a bounded support, the ends included, some `count`, and the functions there with their factor.

        Returns:
            ξ, shape (n,), and values, shape (n, size); all states, if there are states.
        """
        at = self.samples()
        return at.xi, at.values


class LineAxis(NoiseAxis):
    """What functions on the line of a diffusion share.

    Attributes:
        unit: ξ/z.
        points: z of a quadrature rule, shape (n,).
    """

    points: FloatArray

    def __init__(self, noise: Noise, tilt: float = 0.0) -> None:
        super().__init__()
        self.noise, self.unit, self.tilt, self._log_weight = noise, noise.standard_deviation, tilt, 0.0
        self._log_weight -= math.log(self.unit)

    def rate(self, z: FloatArray) -> FloatArray:
        """½σ²/std², the diffusion of z."""
        return 0.5 * self.noise.squared_diffusion(self.unit * z) / self.unit**2

    def changed_weight(self, change: NoiseDerivative, g: Coefficient, logs: FloatArray, z: FloatArray) -> FloatArray:
        """∂(P_s g)/∂θ over P_s from ∂ ln P_s/∂θ, where ξ may be measured by a length that changes: z is held."""
        xi, weight = self.unit * z, logs * g(self.unit * z)
        if change.log_scale:
            weight = weight + change.log_scale * (g(xi * (1 + STEP)) - g(xi * (1 - STEP))) / (2 * STEP)
        return np.asarray(weight)

    def values_at(self, z: FloatArray) -> Any:
        """The functions at any z, shape (len(z), size)."""
        raise NotImplementedError

    def everywhere(self, count: int) -> tuple[FloatArray, Any]:
        """At points that are closer to each other near the ends, as those of Chebyshev."""
        z = -self.noise.half_width / self.unit * np.cos(np.linspace(0, np.pi, count + 1))
        return self.unit * z, self.values_at(z) * self._factor(z)[:, None]

    def finer_samples(self, count: int) -> Samples:
        """At midpoints of intervals, smaller ones near the ends of a bounded support."""
        end, x = self.noise.half_width / self.unit, (2 * np.arange(count) + 1) / count - 1
        if math.isfinite(end):
            z, measure = end * np.sin(0.5 * np.pi * x), end * np.cos(0.5 * np.pi * x) * np.pi / count
        else:
            z, measure = self.center + REACH * x, np.full(count, 2 * REACH / count)
        return self._sampled(z, self.unit * measure, self.values_at(z))

    def _factor(self, z: FloatArray) -> FloatArray:
        return np.exp(np.clip(self.tilt * (z - self.center), -600, 600))

    def weight(self, z: FloatArray) -> FloatArray:
        """P_s exp(2s z) as a density of z: its integral is 1."""
        return np.exp(self.noise.log_density(self.unit * z) + 2 * self.tilt * z - self._log_weight)

    def at(self, z: FloatArray) -> Samples:
        """At any z; the measure is 0."""
        return self._sampled(z, np.zeros_like(z), self.values_at(z))

    def samples(self) -> Samples:
        return self._sampled(self.points, self.unit * self.measure / self.weight(self.points), self.values)

    def _sampled(self, z: FloatArray, measure: FloatArray, values: Any) -> Samples:
        return Samples(self.unit * z, self.weight(z) / self.unit, measure, values, self._factor(z))

    def projection(self, other: LineAxis) -> FloatArray:
        exponent = other.tilt * (self.points - other.center) - self.tilt * (self.points - self.center)
        scaled = (self.measure * np.exp(np.clip(exponent, -600, 600)))[:, None] * dense(other.values_at(self.points))
        return np.asarray(np.linalg.solve(dense(self.matrix(one)), self.values.T @ scaled))


class PolynomialAxis(LineAxis):
    """Orthogonal polynomials: with P_s ~ (1 − x²)^a, x = ξ/ξ_s, and σ² ~ (1 − x²)^b at the ends of the noise those of

        P_s σ² exp(2s z)/(1 − x²),

    whose weight has the exponent a + b − 1: their derivatives are orthogonal in P_s σ². All matrices are banded: for
    Ornstein-Uhlenbeck noise, on the whole line, that of 1 is the identity, that of L_ξ without a tilt is diagonal, and
    that of ξ has one diagonal on each side. Near ±ξ_s expansions converge only like powers.

    Args:
        noise: the noise; P_s must end, or fall like a Gaussian.
        count: the number of polynomials.
        tilt: s.
    """

    is_local = False

    def __init__(self, noise: Noise, count: int, tilt: float = 0.0) -> None:
        super().__init__(noise, tilt)
        end = noise.half_width / self.unit
        if math.isinf(end):
            self._polynomials, x, self.values, slopes, self.measure = _hermite_table(count)
            self._shift, self._scale, self._log_weight = 2 * tilt, 1.0, self._log_weight + 2 * tilt**2
            self.points = x + self._shift
        else:
            self._shift, self._scale, self.slowest = 0.0, end, 1.0
            middle, near = noise.squared_diffusion(noise.half_width * np.array([0.0, 1 - NEAR_END]))
            missing = 0.0 if near < VANISHES * middle else 1.0  # 1 − b: by so much more does P_s fall at the ends
            more = min(abs(tilt) * end, 4 * tilt**2)
            points = 16 * math.ceil((2 * count + MORE_POINTS + more) / 16)  # few rules serve many spaces
            self._end = noise.end_exponent - missing
            x, weights = _gegenbauer_rule(points, self._end)
            self.points, damping = end * x, (1 - x**2) ** missing
            logs = np.log(weights) + 2 * tilt * self.points
            tilted = np.exp(logs - logs.max())
            own = gegenbauer(count, self._end)
            self._polynomials = stieltjes(x, tilted, count) if tilt else own
            self.values, slopes = self._polynomials.at(x)
            self.measure = tilted * damping / (tilted @ damping)
            self._log_weight += math.log((tilted @ damping) / (weights @ damping)) + float(logs.max())
        self._slopes = slopes / self._scale + tilt * self.values
        self._flux = self.measure * self.rate(self.points)
        self.center = float(self.measure @ self.points)
        self.size, self.cells, self.modes = count, np.zeros(count, dtype=int), np.arange(count)
        self.constant = np.eye(1, count)[0]

    def mass(self, g: Coefficient = one) -> FloatArray:
        return form(self.values, self.measure if g == one else self.measure * g(self.unit * self.points))

    def generator(self) -> FloatArray:
        """−½ ∫ P_s σ² (u′ + s u)(v′ + s v)."""
        return -form(self._slopes, self._flux)

    def changed(self, change: NoiseDerivative, g: Coefficient | None) -> FloatArray:
        logs, a = change.log_density(self.unit * self.points), self.noise.end_exponent
        if change.end_exponent and a < SHARP_ENDS:  # no rule of Gauss takes its ln(1 − x²) near ±1 as it stands
            x = self.points / self._scale
            logs = logs + change.end_exponent * (_end_logarithm(x.size, self._end, a) - np.log1p(-(x**2)))
        logs = np.asarray(logs - self.measure @ logs)
        if g is not None:
            return form(self.values, self.measure * self.changed_weight(change, g, logs, self.points))
        own = 2 * (change.log_diffusion - change.log_scale) * self.matrix(None)
        return own - form(self._slopes, self._flux * logs)

    def generator_of_one(self) -> FloatArray:
        return np.asarray(-self.tilt * (self._flux @ self._slopes))

    def values_at(self, z: FloatArray) -> FloatArray:
        return self._polynomials.at((z - self._shift) / self._scale)[0]


class CellAxis(LineAxis):
    """Continuous elements on an interval, for given meshes and algebraic tails.

    Args:
        noise: the noise.
        lines: vertices in z, within the support of the noise.
        degrees: of the elements in each cell.

    Attributes:
        line: the elements, in the weight P_s.

    Raises:
        MeshError: a cell's polynomials cannot be told apart under the weight.
    """

    def __init__(self, noise: Noise, lines: FloatArray, degrees: Any) -> None:
        from fpsolve.fem.line import LineSpace  # scikit-fem takes a while to import

        super().__init__(noise)
        end, exponent = noise.half_width / self.unit, noise.end_exponent
        reaches = (lines[0] <= -end * (1 - 1e-12), lines[-1] >= end * (1 - 1e-12))
        ends = (exponent * reaches[0], exponent * reaches[1])
        self.line = LineSpace(lines, degrees, self.weight, end_exponents=ends)
        self._inner = np.flatnonzero(self.line.kept)
        self.points, self.measure, self.values = self.line.points, self.line.measure, self.line.values[:, self._inner]
        self.size, self.cells, self.modes = self._inner.size, self.line.cells[self._inner], self.line.modes[self._inner]
        self.constant = self.line.constant()[self._inner]

    def mass(self, g: Coefficient = one) -> Any:
        return self._form(self.line.mass() if g == one else self.line.mass(lambda z: g(self.unit * z)))

    def generator(self) -> Any:
        """−½ ∫ P_s σ² u′v′; at the ends no probability flux is the natural condition."""
        return self._form(-self.line.stiffness(self.rate))

    def changed(self, change: NoiseDerivative, g: Coefficient | None) -> Any:
        mean = float(self.measure @ change.log_density(self.unit * self.points) / np.sum(self.measure))

        def log_change(z: FloatArray) -> FloatArray:
            return change.log_density(self.unit * z) - mean

        if g is not None:
            return self._form(self.line.mass(lambda z: self.changed_weight(change, g, log_change(z), z)))
        stiffness = self.line.stiffness(lambda z: self.rate(z) * log_change(z))
        return 2 * (change.log_diffusion - change.log_scale) * self.matrix(None) - self._form(stiffness)

    @cached_property
    def nested(self) -> Any:
        return self.line.nested[self._inner][:, self._inner]

    def values_at(self, z: FloatArray) -> Any:
        return self.line.at(z)[:, self._inner]

    def _form(self, matrix: Any) -> Any:
        """Of the functions that are kept; sparse where it is large."""
        inner = matrix[self._inner][:, self._inner]
        return inner.toarray() if inner.shape[0] <= MAX_DENSE_UNKNOWNS else inner


class StateAxis(NoiseAxis):
    """One value for each state of a Markov chain: ∫ P_s becomes a sum over the states with their probabilities.

    Attributes:
        support: the states.
    """

    def __init__(self, noise: Any) -> None:
        super().__init__()
        self.support, self.measure, self._rates = np.array(noise.states), noise.probabilities, np.array(noise.rates)
        self.size, self.constant, self.values = self.support.size, np.ones(self.support.size), np.eye(self.support.size)
        self.cells, self.modes = np.full(self.size, -1), np.zeros(self.size, dtype=int)

    def mass(self, g: Coefficient = one) -> FloatArray:
        return np.diag(self.measure * g(self.support))

    def generator(self) -> FloatArray:
        """diag(π) Q."""
        return self.measure[:, None] * self._rates

    def changed(self, change: NoiseDerivative, g: Coefficient | None) -> FloatArray:
        """With ∂π from πQ = 0: (∂π)Q = −π ∂Q, of the sum 0."""
        none = np.zeros(self.size)
        rates = np.array(change.rates) if change.rates else np.diag(none)
        states = np.array(change.states) if change.states else none
        unit = np.abs(self._rates).max()
        equations, right = np.vstack([self._rates.T / unit, none + 1]), np.append(-self.measure @ rates / unit, 0.0)
        weights = np.linalg.lstsq(equations, right, rcond=None)[0] if change.rates else none
        if g is None:
            return np.asarray(weights[:, None] * self._rates + self.measure[:, None] * rates)
        step = STEP * np.abs(self.support).max() / max(np.abs(states).max(), 1e-300)
        slope = (g(self.support + step * states) - g(self.support - step * states)) / (2 * step)
        return np.diag(weights * g(self.support) + self.measure * slope)

    def samples(self) -> Samples:
        return Samples(self.support, self.measure, np.ones(self.size), self.values, np.ones(self.size))

    def projection(self, other: StateAxis) -> FloatArray:
        return np.eye(self.size)


@lru_cache(maxsize=64)
def _hermite_table(count: int) -> tuple[Polynomials, FloatArray, FloatArray, FloatArray, FloatArray]:
    """The polynomials, points of a rule, values and slopes there, weights."""
    x, weights = hermite(count + MORE_POINTS).rule()
    polynomials = hermite(count)
    return polynomials, x, *polynomials.at(x), weights


@lru_cache(maxsize=64)
def _gegenbauer_rule(count: int, exponent: float) -> tuple[FloatArray, FloatArray]:
    return gegenbauer(count, exponent).rule()


@lru_cache(maxsize=64)
def _end_logarithm(count: int, exponent: float, a: float) -> FloatArray:
    """ln(1 − x²) at the points of a rule, as the polynomials of the exponent a have it."""
    return logarithm(_gegenbauer_rule(count, exponent)[0], a, count)


def form(values: FloatArray, measure: FloatArray) -> FloatArray:
    """∫ of the products of functions, without what is zero but for rounding."""
    matrix = (values * measure[:, None]).T @ values
    matrix[np.abs(matrix) < 1e-13 * np.max(np.abs(matrix))] = 0.0
    return matrix
