"""∂/∂θ of what a pair says, on its discretisation."""

from __future__ import annotations

import sys
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.exponent.eigen import PairDerivatives
from fpsolve.exponent.error import Estimate
from fpsolve.fem.axis import KroneckerSum
from fpsolve.model.problem import ParameterDerivative

_EPS = sys.float_info.epsilon


class Changed:
    """∂/∂θ of what a pair says, on its discretisation.

    Args:
        around: the pair; its derivatives by p are used where they are needed.
        by: the direction of θ.
    """

    def __init__(self, around: PairDerivatives, by: ParameterDerivative) -> None:
        self._around, self._pair, self._by = around, around.pair, by

    @cached_property
    def value(self) -> Estimate:
        """∂Λ/∂θ with the error of rounding, also in T and T*; the scale is that of the terms of L − Λ."""
        pair, operator = self._pair, self._operator(0)
        x, y, turns = pair.right, pair.left, pair.space.turns
        parts = turns * np.array([y @ (KroneckerSum([term]) @ x) for term in operator.terms])
        sizes, scale = turns * float(abs(y) @ (abs(operator) @ abs(x))), float(np.sum(np.abs(parts)))
        of_pair = (pair.residual + _EPS) * self._around.size / pair.generator.framed.unit_rate
        return Estimate(float(np.sum(parts)), _EPS * sizes + of_pair * scale, scale)

    @cached_property
    def slope(self) -> Estimate:
        """∂Λ′/∂θ at p = 0, where BT = 0."""
        around, x, y = self._around, self._pair.right, self._pair.left
        parts = [y @ self.image(x, 1), y @ self.image(around.by_p, 0, self.value.value)]
        return _summed(parts, around.norm)

    @cached_property
    def curvature(self) -> Estimate:
        """∂Λ″/∂θ at p = 0."""
        around, x, y = self._around, self._pair.right, self._pair.left
        image, more = self.image(around.by_p, 0, self.value.value), self.slope.value
        parts = (
            y @ self.image(x, 2),
            2 * (y @ self.image(around.by_p, 1, more)),
            2 * (around.adjoint_by_p @ self.image(x, 1, more)),
            2 * (around.adjoint_by_p @ image),
            y @ self.image(around.second_by_p, 0, self.value.value),
        )
        return _summed(parts, around.norm)

    def ratio(self, p: float) -> Estimate:
        """∂/∂θ of Λ(p)/p by the pair at p; for a small p, and of λ, by that at p = 0, without terms in p²."""
        if self._pair.p or not p:
            return scaled(1 / p, self.value) if p else self.slope
        slope, more = self.slope, scaled(0.5 * p, self.curvature)
        errors = slope.error_estimate + more.error_estimate + abs(p) * more.scale
        return Estimate(slope.value + more.value, errors, max(slope.scale, more.scale))

    def image(self, v: FloatArray, k: int, change: float = 0.0) -> FloatArray:
        """(∂L⁽ᵏ⁾ − Λ⁽ᵏ⁾∂M − change M)v."""
        found = self._operator(k) @ v
        return found - change * self._pair.space.weighed(v) if change else found

    def _operator(self, k: int) -> KroneckerSum:
        """∂L⁽ᵏ⁾ − Λ⁽ᵏ⁾∂M."""
        pair = self._pair
        rate = (pair.eigenvalue, pair.derivative)[k] if k < 2 else self._around.second_derivative
        return pair.generator.changed(self._by, pair.p, rate, derivative=k)


def _summed(parts: ArrayLike, norm: float) -> Estimate:
    """The sum of some parts over a norm, with about what rounding may change in it."""
    parts = np.asarray(parts)
    size = float(np.sum(np.abs(parts))) / norm
    return Estimate(float(np.sum(parts)) / norm, 1e3 * _EPS * size, size)


def scaled(factor: float, estimate: Estimate) -> Estimate:
    """A multiple of a number."""
    return Estimate(factor * estimate.value, abs(factor) * estimate.error_estimate, abs(factor) * estimate.scale)
