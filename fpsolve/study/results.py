"""What is found for the curves of a case: plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from fpsolve.analysis.sensitivity import Sensitivities
from fpsolve.arrays import FloatArray
from fpsolve.case.curves import Curve
from fpsolve.case.sections import Expectation, Varied
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import Estimate, Failure
from fpsolve.exponent.quantities import LYAPUNOV_EXPONENT, STABILITY_INDEX, VARIANCE_RATE
from fpsolve.exponent.solver import MomentLyapunov

if TYPE_CHECKING:  # numba takes half a second to import
    from fpsolve.simulation.estimators import MonteCarlo
    from fpsolve.simulation.response import Response


@dataclass(frozen=True, eq=False)
class CurveResult:
    """What was computed for one parameter set.

    Attributes:
        curve: the parameters, the oscillator and the noise.
        moments: Λ(p); where some p failed, of the others.
        moments_perturbation: Eq. (37) at the same p.
        estimates: of each of the `INDICES`, by its name; None where there is none, or it did not converge.
        eigenpairs: those whose eigenfunctions are written; none once they are no longer needed.
        stationary: the eigenpair at p = 0; None once it is no longer needed.
        discretisation: what was used for the p of the largest size; None where no p was solved.
        warnings: what limits these numbers.
        notes: where the theories compared with are not valid.
        failures: why some p are missing.
        sensitivities: the derivatives of these numbers by the parameters; None where they are not wanted.
    """

    curve: Curve
    moments: MomentLyapunov
    moments_perturbation: FloatArray
    estimates: Mapping[str, Estimate | None]
    eigenpairs: tuple[PrincipalPair, ...]
    stationary: PrincipalPair | None
    discretisation: dict[str, Any] | None
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    failures: tuple[Failure, ...] = ()
    sensitivities: Sensitivities | None = None

    @property
    def lyapunov_exponent(self) -> Estimate | None:
        """λ."""
        return self.estimates[LYAPUNOV_EXPONENT.name]

    @property
    def stability_index(self) -> Estimate | None:
        """δ_p."""
        return self.estimates[STABILITY_INDEX.name]

    @property
    def variance_rate(self) -> Estimate | None:
        """Λ″(0)."""
        return self.estimates[VARIANCE_RATE.name]

    def without_pairs(self) -> CurveResult:
        """The numbers without the eigenpairs; those of `moments` are solved again when they are asked for."""
        return replace(self, moments=self.moments.forgetful(), eigenpairs=(), stationary=None)


@dataclass(frozen=True, eq=False)
class SimulatedCurve:
    """What the simulation of one parameter set found.

    Attributes:
        curve: the parameter set.
        result: λ and Λ(p) of the linear system.
        response: the stationary response of the nonlinear system; None where c₂ = c₃ = 0 or there is none.
        warnings: what limits these numbers.
        interrupted: whether the simulation was stopped early.
    """

    curve: Curve
    result: MonteCarlo
    response: Response | None
    warnings: tuple[str, ...]
    interrupted: bool = False

    @property
    def estimates(self) -> dict[str, tuple[float, float]]:
        """λ and Λ″(0) by name, each with its standard error; a simulation gives no δ_p."""
        found = self.result
        return {
            LYAPUNOV_EXPONENT.name: (found.lyapunov_exponent, found.lyapunov_exponent_error),
            VARIANCE_RATE.name: (found.variance_rate, found.variance_rate_error),
        }


@dataclass(frozen=True)
class Comparison:
    """One expectation of a case and what was computed; `met` says whether they agree."""

    expectation: Expectation
    varied: Varied
    value: float | None
    tolerance: float
    met: bool
