"""What proofs take from a system and from a noise: coefficients as exact numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Exact = NDArray[Any]
"""An array of fractions."""
BasisKind = Literal["core", "whole", "circle", "states"]
"""Kinds of functions that a function of the noise in a proof may be made of, see `fpsolve.proofs.basis`."""


@dataclass(frozen=True)
class ExactJump:
    """x⁺ = R x⁻, R = factor · e^{log_factor}, where x passes the line through `ray`."""

    ray: Exact
    factor: Fraction
    log_factor: Fraction


@dataclass(frozen=True)
class ExactMotion:
    """ẋ = (A₀ + ξ A₁) x, with jumps at rays.

    Attributes:
        still, driven: A₀ and A₁, shape (2, 2).
    """

    still: Exact
    driven: Exact
    jumps: tuple[ExactJump, ...] = ()

    def speeds(self, jump: ExactJump) -> tuple[Fraction, Fraction]:
        """h₀ and h₁ at the ray of a jump, times the square of the ray's length: e′ᵀA e with e = (cos φ, −sin φ)."""
        first, second = jump.ray
        speeds: Any = [np.array([second, -first]) @ a @ jump.ray for a in (self.still, self.driven)]
        return speeds[0], speeds[1]


@dataclass(frozen=True)
class ExactLaw:
    """The law of z = ξ/unit: of dz = −ν b(z) dt + √ν dW, of cos θ with dθ = √ν dW, of a chain, or z dt = dW.

    Attributes:
        bases: what functions of the noise may be made of: "core" of a diffusion, "core" and "whole" of a bounded one,
            "circle" of cos θ, "states" of a chain, and of white noise as if it had one.
        squared_unit: that of the unit.
        nu: ν.
        slope: b′(0); b = slope z, or b = slope z/(1 − z²) of bounded noise, |z| < 1.
        states: the values of ξ in a chain, shape (n,).
        rates: from each state to each, shape (n, n); the diagonal is minus the sum of its row.
        white: the sense of white noise; empty for other noise.
    """

    bases: tuple[BasisKind, ...]
    squared_unit: Fraction = Fraction(1)
    nu: Fraction = Fraction(0)
    slope: Fraction = Fraction(0)
    states: Exact | None = None
    rates: Exact | None = None
    white: Literal["", "stratonovich", "ito"] = ""

    def in_stratonovich(self, motion: ExactMotion) -> ExactMotion:
        """The motion with A₀ − ½s²A₁² in place of A₀ where white noise is meant in Itô's sense."""
        if self.white != "ito":
            return motion
        return replace(motion, still=motion.still - motion.driven @ motion.driven * self.squared_unit / 2)

    def passing(self, still: Fraction, driven: Fraction) -> int:
        """The sign of still + ξ driven for all ξ of the noise; 0 where it has none."""
        if self.states is not None and not self.white:
            signs = {_sign(still + driven * state) for state in self.states}
            return signs.pop() if len(signs) == 1 else 0
        is_one = not driven if self.white or self.bases == ("core",) else driven**2 * self.squared_unit < still**2
        return _sign(still) if is_one else 0


def _sign(number: Fraction) -> int:
    return (number > 0) - (number < 0)


def gaussian_law(alpha: Fraction, squared_sigma: Fraction) -> ExactLaw:
    """The law of dξ = −α ξ dt + σ dW in units of its standard deviation."""
    return ExactLaw(("core",), squared_sigma / (2 * alpha), 2 * alpha, Fraction(1, 2))


def chain_law(states: Exact, rates: Exact) -> ExactLaw:
    """The law of a chain, whatever stands on the diagonal of its rates."""
    jumps = rates - np.diag(np.diagonal(rates))
    return ExactLaw(("states",), states=states, rates=jumps - np.diag(jumps.sum(axis=1)))


def white_law(squared_intensity: Fraction, interpretation: str) -> ExactLaw:
    """The law of white noise, in units of s."""
    nothing = np.array([Fraction(0)])
    sense: Literal["stratonovich", "ito"] = "ito" if interpretation == "ito" else "stratonovich"
    return ExactLaw(("states",), squared_intensity, states=nothing, rates=np.diag(nothing), white=sense)


def bounded_law(nu: Fraction, slope: Fraction, squared_unit: Fraction) -> ExactLaw:
    """The law of bounded noise with b = slope z/(1 − z²)."""
    return ExactLaw(("core", "whole"), squared_unit, nu, slope)
