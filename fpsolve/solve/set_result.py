"""What is found for the parameter sets of a case: plain values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.analysis.excursions import Excursion
from fpsolve.analysis.sensitivity import Sensitivities
from fpsolve.arrays import FloatArray, ReadOnly
from fpsolve.case.case import ParameterSet
from fpsolve.case.sections import EXCURSIONS, RESPONSE, SAME, SENSITIVITIES
from fpsolve.data import Quantity, Result, dataset
from fpsolve.exponent.error import Estimate, Failure
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, STABILITY_INDEX, SUMMARY_NUMBERS, VARIANCE_RATE
from fpsolve.messages import Code, Message, Severity, message_of
from fpsolve.model.quantity import MOMENT, OVER_P, P, moment_at
from fpsolve.nonlinear.rest import NearRest

if TYPE_CHECKING:
    import xarray

    from fpsolve.simulation.estimators import MonteCarlo
    from fpsolve.simulation.response import Response


class Status(IntEnum):
    """What became of a parameter set; after a case with one that fails the exit code is 3."""

    CONVERGED = 0
    PARTLY = 1
    FAILED = 2
    MISSING = 3
    BEYOND_RTOL = 4
    NO_STABILITY_INDEX = 5

    @property
    def word(self) -> str:
        return self.name.lower().replace("_", " ")

    @property
    def fails(self) -> bool:
        return self in (Status.PARTLY, Status.FAILED)


@dataclass(frozen=True, eq=False)
class MomentColumns(ReadOnly):
    """Λ(p) at those p of a parameter set that did not fail, in the order of the case; all of shape (n,).

    Attributes:
        p: the moments.
        value, derivative, derivative_error, error_estimate, residual: as in `MomentLyapunov`.
        perturbation: Eq. (37) at the same p.
    """

    p: FloatArray
    value: FloatArray
    derivative: FloatArray
    derivative_error: FloatArray
    error_estimate: FloatArray
    residual: FloatArray
    perturbation: FloatArray

    @property
    def rate_function(self) -> FloatArray:
        """I(s) = ps − Λ(p) at s = Λ′(p), shape (n,); its error is, to first order, that of Λ(p)."""
        return np.asarray(self.p * self.derivative - self.value) + 0.0


Number = float | FloatArray | None
"""What a quantity is of one parameter set, or at each of its p; None where there is none."""


def estimated(quantity: Quantity, estimate: Estimate | None) -> dict[Quantity, Number]:
    """A number and its error by their quantities; None where there is none."""
    return {quantity: estimate and estimate.value, quantity.error(): estimate and estimate.error_estimate}


NO_MOMENTS = MomentColumns(*[np.zeros(0)] * 7)
"""Λ(p) at no p."""


@dataclass(frozen=True, eq=False)
class ResponseDensity(ReadOnly):
    """The stationary density on a grid; of the phase both ends are there, of the others the middles of cells.

    Attributes:
        amplitude, phi, xi: the places, shapes (n,), (m,) and (k,).
        of_amplitude: ρ(a), shape (n,).
        of_plane: that of both variables at x₁ = a cos φ, x₂ = −s a sin φ, see `LinearMotion.aspect`, shape (n, m).
        whole: ρ(a, φ, ξ), shape (n, m, k), to the seven digits of a number of four bytes, which are what records and
            files hold of it.
    """

    amplitude: FloatArray
    phi: FloatArray
    xi: FloatArray
    of_amplitude: FloatArray
    of_plane: FloatArray
    whole: FloatArray

    def plane(self, has_wall: bool) -> tuple[FloatArray, FloatArray]:
        """φ and the density of both variables over the half-turn; without a wall over a turn, its halves alike."""
        if has_wall:
            return self.phi, self.of_plane
        beyond = self.phi[1:] + math.pi
        return np.concatenate([self.phi, beyond]), np.concatenate([self.of_plane, self.of_plane[:, 1:]], axis=1)


@dataclass(frozen=True, eq=False)
class SetResponse(NearRest):
    """The stationary response of one parameter set.

    Attributes:
        means: by their names in files.
        impact_rate: impacts in unit time; None without a wall.
        balance: what noise feeds into ln a less what impacts take, in unit time; 0 but for its error. This and the next
            three are None where the moments were solved alone.
        stability_index: δ_p of the linear system.
        least: the least density over the largest, negative where it is not resolved.
        unknowns: of the largest system solved.
        density: on a grid; None where it is not wanted.
    """

    means: Mapping[str, Estimate]
    impact_rate: Estimate | None = None
    balance: Estimate | None = None
    stability_index: float | None = None
    least: float | None = None
    unknowns: int | None = None
    density: ResponseDensity | None = None

    @property
    def numbers(self) -> dict[str, Estimate]:
        """The means and the impact rate, if there is one, by their names."""
        return {**self.means, **({} if self.impact_rate is None else {"impact_rate": self.impact_rate})}


@dataclass(frozen=True, eq=False, repr=False)
class SetResult(Result):
    """The numbers and messages of one parameter set, which a record can hold.

    Attributes:
        parameter_set: the parameters, the oscillator and the noise.
        moments: Λ(p); where some p failed, of the others.
        parts: what else was found, by the names of `Question`s; without what is not wanted, or did not converge.
        warnings: what limits these numbers.
        notes: where the theories compared with are not valid.
        failures: why some p are missing, or with all p some summary numbers.
        seconds: how long the processor took.
    """

    parameter_set: ParameterSet
    moments: MomentColumns
    parts: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[Message, ...] = ()
    notes: tuple[Message, ...] = ()
    failures: tuple[Failure, ...] = ()
    seconds: float = 0.0

    @property
    def estimates(self) -> Mapping[str, Estimate | None]:
        """The `SUMMARY_NUMBERS` by their names; None where there is none, it was not asked for, or not found."""
        return {name: self.parts.get(name) for name in SUMMARY_NUMBERS}

    @property
    def discretisation(self) -> dict[str, Any] | None:
        """What was used for the p of the largest size; None where no p was solved."""
        return self.parts.get("discretisation") or None

    @property
    def excursion(self) -> Excursion | None:
        """The probability that ‖x‖ ever exceeds a level."""
        return self.parts.get(EXCURSIONS)

    @property
    def response(self) -> SetResponse | None:
        """The stationary response of a system with terms of degree 3."""
        return self.parts.get(RESPONSE)

    @property
    def sensitivities(self) -> Sensitivities | None:
        """The derivatives of these numbers by the parameters."""
        return self.parts.get(SENSITIVITIES)

    @property
    def lyapunov_exponent(self) -> Estimate | None:
        """λ."""
        return self.parts.get(LYAPUNOV_EXPONENT.name)

    @property
    def stability_index(self) -> Estimate | None:
        """δ_p."""
        return self.parts.get(STABILITY_INDEX.name)

    @property
    def variance_rate(self) -> Estimate | None:
        """Λ″(0)."""
        return self.parts.get(VARIANCE_RATE.name)

    def moment(self, p: float) -> Estimate | None:
        """Λ at one p; None where it is not known."""
        for place in np.flatnonzero(np.isclose(self.moments.p, p, rtol=0, atol=SAME)).tolist():
            value, error = self.moments.value[place], self.moments.error_estimate[place]
            return Estimate(float(value), float(error), 0.0, quantity=moment_at(p))
        return None

    @property
    def status(self) -> Status:
        """Whether all that was asked for is there, within rtol."""
        if self.failures:
            return Status.PARTLY if self.moments.p.size or any(self.estimates.values()) else Status.FAILED
        codes = {message_of(each).code for each in self.warnings}
        if not codes.isdisjoint((Code.RTOL_MISSED, Code.NUMBER_RTOL_MISSED)):
            return Status.BEYOND_RTOL
        return Status.NO_STABILITY_INDEX if Code.NUMBER_MISSING in codes else Status.CONVERGED

    @property
    def remarks(self) -> dict[Severity, Sequence[str]]:
        """What is said of it, by how much that means."""
        reasons = [failure.reason for failure in self.failures]
        return {Severity.FAILURE: reasons, Severity.WARNING: self.warnings, Severity.NOTE: self.notes}

    def to_xarray(self) -> xarray.Dataset:
        """Λ(p) and Λ′(p) over p, Eq. (37), and the summary numbers that were found, with their errors."""
        found = self.moments
        numbers: dict[Quantity, Number] = {each: vars(found)[name] for name, each in OVER_P.items()}
        for name, each in self.estimates.items():
            numbers |= estimated(SUMMARY_NUMBERS[name], each) if each else {}
        title, places = f"{MOMENT.words}, {self.parameter_set.label}".removesuffix(", "), {P: found.p}
        more = {"warnings": self.warnings, "notes": self.notes, "failures": [each.reason for each in self.failures]}
        return dataset(title, "finite elements", numbers, places, self.parameter_set.parameters, **more)

    def _said(self) -> str:
        found, exponent = self.moments, self.lyapunov_exponent
        parts = [self.parameter_set.label, self.status.word, f"{found.p.size} p", f"λ = {exponent}" if exponent else ""]
        return ", ".join(filter(None, parts))


@dataclass(frozen=True, eq=False)
class SimulatedSet:
    """The simulation of one parameter set.

    Attributes:
        parameter_set: the parameter set.
        result: λ and Λ(p) of the linear system.
        response: the stationary response of the nonlinear system; None where there is none.
        warnings: what limits these numbers.
        interrupted: whether the simulation was stopped early.
    """

    parameter_set: ParameterSet
    result: MonteCarlo
    response: Response | None
    warnings: tuple[Message, ...]
    interrupted: bool = False

    @property
    def remarks(self) -> dict[Severity, Sequence[str]]:
        """What is said of it."""
        return {Severity.WARNING: self.warnings}

    @property
    def estimates(self) -> dict[str, tuple[float, float]]:
        """λ, Λ″(0) and what is counted at a wall, each with its standard error; a simulation gives no δ_p."""
        found = self.result
        return {
            LYAPUNOV_EXPONENT.name: (found.lyapunov_exponent, found.lyapunov_exponent_error),
            VARIANCE_RATE.name: (found.variance_rate, found.variance_rate_error),
            **found.wall,
        }
