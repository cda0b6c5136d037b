"""Functions of the noise ξ, in the inner product weighted by its stationary law.

On the line of a diffusion the functions are continuous elements in z = ξ/std, and the noise's part of the generator is
−½σ²∫P_s u′v′: constants are in its kernel on every mesh. A Markov chain has a value for each state.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.sparse import csr_matrix, diags, identity

from fpsolve.arrays import Coefficient, FloatArray, one
from fpsolve.errors import MeshError
from fpsolve.fem.line import LineSpace
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import Diffusion
from fpsolve.model.problem import AnyNoise

_SAMPLES = 2001


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
    values: csr_matrix
    factor: FloatArray


class NoiseSpace(Protocol):
    """What the generator and its users ask of the functions of ξ."""

    @property
    def size(self) -> int:
        """Number of unknowns."""

    @property
    def axes(self) -> tuple[LineSpace, ...]:
        """The elements, none for a chain."""

    @property
    def tilt(self) -> float:
        """s of the factor exp(s z) that every function carries; 0 where there is none."""

    @property
    def support(self) -> FloatArray:
        """ξ between whose extremes the noise lives, or its states: there the sign of the phase speed is looked at."""

    def mass(self, g: Coefficient = one) -> csr_matrix:
        """∫ P_s g(ξ) u v."""

    def generator(self) -> csr_matrix:
        """∫ P_s v L_ξ u, L_ξ the generator of the noise."""

    def constant(self) -> FloatArray:
        """Coefficients of the function 1, times the factor, shape (size,)."""

    def samples(self, local: FloatArray | None = None) -> Samples:
        """At local coordinates in [0, 1] of every cell, or at the quadrature points; of a chain at its states."""

    def projection(self, other: Any) -> FloatArray:
        """The matrix that takes a function of another space to its projection on this one, shape (size, other.size)."""


class DiffusionSpace:
    """Continuous elements in z = ξ/std, for noise that diffuses.

    With a tilt s every function carries the factor exp(s (z − c)): where T ~ exp(s z) the polynomials stand for what
    is left of it. The products of two functions are then weighted by P_s exp(2s z), which for Ornstein-Uhlenbeck
    noise is P_s moved to 2s, however far that is.

    Args:
        noise: the noise.
        lines: vertices in z, within the support of the noise.
        degree: of the elements.
        tilt: s.

    Attributes:
        line: the elements, in the weight `weight`.
        unit: ξ/z.
        center: c, where the weight is largest.
        rate: ½σ²/std², the diffusion of z.

    Raises:
        MeshError: a cell's polynomials cannot be told apart under the weight.
    """

    def __init__(self, noise: Diffusion, lines: FloatArray, degree: int, tilt: float = 0.0) -> None:
        self.unit, self.tilt, self.center = noise.standard_deviation, tilt, 0.0
        self._log_density, self._log_weight = noise.log_density, -math.log(self.unit)
        self.rate = 0.5 * (noise.diffusion / self.unit) ** 2
        if tilt:
            inside = np.linspace(lines[0], lines[-1], _SAMPLES)[1:-1]
            sizes = self._log_density(self.unit * inside) + 2 * tilt * inside
            self.center, self._log_weight = float(inside[sizes.argmax()]), float(sizes.max())
        end, exponent = noise.half_width / self.unit, noise.end_exponent
        ends = exponent * (lines[0] <= -end), exponent * (lines[-1] >= end)
        self.line = LineSpace(lines, degree, self.weight, end_exponents=ends)

    @property
    def size(self) -> int:
        return self.line.size

    @property
    def axes(self) -> tuple[LineSpace, ...]:
        return (self.line,)

    @property
    def support(self) -> FloatArray:
        return self.unit * np.concatenate([self.line.lines, self.line.points])

    def weight(self, z: FloatArray) -> FloatArray:
        """P_s exp(2s z): without a tilt the stationary density of z, otherwise with its largest value, at c, made 1."""
        return np.exp(self._log_density(self.unit * z) + 2 * self.tilt * z - self._log_weight)

    def factor(self, z: FloatArray, other: DiffusionSpace | None = None) -> FloatArray:
        """exp(s (z − c)), which every function carries, over that of another space; kept within e^±600."""
        exponent = self.tilt * (z - self.center)
        if other is not None:
            exponent = exponent - other.tilt * (z - other.center)
        return np.exp(np.clip(exponent, -600, 600))

    def mass(self, g: Coefficient = one) -> csr_matrix:
        return self.line.mass() if g is one else self.line.mass(lambda z: g(self.unit * z))

    def generator(self) -> csr_matrix:
        """−½σ² ∫ P_s (u′ + s u)(v′ + s v); at the ends no probability flux is the natural condition."""
        return -self.rate * self.line.stiffness(self.tilt)

    def constant(self) -> FloatArray:
        return self.line.constant()

    def samples(self, local: FloatArray | None = None) -> Samples:
        if local is None:
            return self._sampled(self.line.points, self.line.weights, self.line.values)
        z, values = self.line.evaluation(local)
        return self._sampled(z, np.repeat(np.diff(self.line.lines) / local.size, local.size), values)

    def at(self, z: FloatArray, inside: FloatArray | None = None) -> Samples:
        """At any z, see `LineSpace.at`; the measure is 0."""
        return self._sampled(z, np.zeros_like(z), self.line.at(z, inside))

    def _sampled(self, z: FloatArray, measure: FloatArray, values: csr_matrix) -> Samples:
        return Samples(self.unit * z, self.weight(z) / self.unit, self.unit * measure, values, self.factor(z))

    def projection(self, other: DiffusionSpace) -> FloatArray:
        return self.line.projection(other.line, lambda z: other.factor(z, self))


class ChainSpace:
    """One value for each state of a Markov chain: ∫ P_s becomes a sum over the states with their probabilities."""

    tilt, axes = 0.0, ()

    def __init__(self, noise: MarkovChain) -> None:
        self.support, self.rates = np.array(noise.states), np.array(noise.rates)
        self._probabilities = noise.probabilities
        self.size = self.support.size

    def mass(self, g: Coefficient = one) -> csr_matrix:
        return csr_matrix(diags(self._probabilities * g(self.support)))

    def generator(self) -> csr_matrix:
        """diag(π) Q."""
        return csr_matrix(self._probabilities[:, None] * self.rates)

    def constant(self) -> FloatArray:
        return np.ones(self.size)

    def samples(self, local: FloatArray | None = None) -> Samples:
        ones = np.ones(self.size)
        return Samples(self.support, self._probabilities, ones, csr_matrix(identity(self.size)), ones)

    def projection(self, other: ChainSpace) -> FloatArray:
        return np.eye(self.size)


def noise_space(noise: AnyNoise, mesh: CylinderMesh, tilt: float = 0.0) -> NoiseSpace:
    """The functions of a noise on a mesh, which for a chain has no lines in z.

    Raises:
        MeshError: the mesh has lines where the noise has states, or none where it has a line.
    """
    if isinstance(noise, MarkovChain) == bool(mesh.z_lines.size):
        raise MeshError("noise with states needs a mesh without z_lines, and noise on a line one with them")
    if isinstance(noise, MarkovChain):
        return ChainSpace(noise)
    return DiffusionSpace(noise, mesh.z_lines, mesh.xi_degree, tilt)
