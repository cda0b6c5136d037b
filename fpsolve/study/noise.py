"""From what was measured to a noise, and to what it means for a system; nothing is written."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray, one
from fpsolve.case.case import Case
from fpsolve.case.new import Modes
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.adapt import Budget
from fpsolve.measured import (
    NoiseFit,
    Record,
    Spectrum,
    Verdict,
    fit_noise,
    non_gaussian_from_record,
    of_relative_stiffness,
    of_stability_height,
    of_support_acceleration,
    verdict,
    weak_exponent,
    weak_moment,
)
from fpsolve.measured.fit import NAMES
from fpsolve.measured.signals import SIGNALS
from fpsolve.measured.stability import STEPS
from fpsolve.measured.weak import Where
from fpsolve.messages import Code, Message
from fpsolve.model import ParametricOscillator, PlaneSystem, Problem, VibroImpactOscillator
from fpsolve.model.plane import System
from fpsolve.model.systems.vibro_impact import ImpactLaw

NON_GAUSSIAN = "non-gaussian"
CLOSE = 0.02
"""By which share of it two statements of a frequency may differ."""
STEPS_OF_A_FIT = 1 + STEPS
"""How often `measure` calls `progress` at most."""
RTOL = 1e-4
"""Of λ and Λ(2), whose errors by the fit are some percent."""
SECONDS = 20.0
"""Of a processor for λ and for Λ(2) each."""
STILL = 1e-6
"""Of a modulus: imaginary parts below are none."""


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is to be fitted, and for what.

    Attributes:
        of: what was measured, one of `SIGNALS`.
        kind, terms, method: as for `fit_noise`, or the kind "non-gaussian" of a record.
        modes: natural frequencies, and damping ratios that may be NaN.
        height: GM where its variation was measured.
        case: whose system the noise is for; None for an oscillator with the first mode's damping.
        segment: of a record, in s; None for what the frequencies need.
        rtol, seconds: tolerance and time for λ and for Λ(2).
    """

    of: str
    kind: str
    terms: int
    method: Literal["spectrum", "whittle"]
    modes: Modes
    height: float | None = None
    case: Case | None = None
    segment: float | None = None
    rtol: float = RTOL
    seconds: float = SECONDS

    @property
    def noise_in(self) -> Where:
        return SIGNALS[self.of].noise_in


class Critical(NamedTuple):
    """A damping ratio above which a moment decays in weak noise without walls, and its standard error."""

    value: float
    error: float


@dataclass(frozen=True, eq=False)
class NoiseOutcome:
    """What became of a measurement.

    Attributes:
        fit: of the relative stiffness, or of the damping in 1/s.
        scaled: the same in the unit in which the system takes it.
        exponent, moment: the critical damping ratios for λ and for Λ(2), of one mode.
        verdict: of the system; None where there is no system, or nothing of it was solved.
        failure: why it, or a part of it, was not solved.
    """

    wanted: Wanted
    fit: NoiseFit
    scaled: NoiseFit
    exponent: Critical | None = None
    moment: Critical | None = None
    verdict: Verdict | None = None
    failure: Message | None = None


def natural_frequencies(system: System) -> tuple[float, ...]:
    """The moduli of the complex pairs of eigenvalues without noise, increasing: ω of an oscillator, in rad/time."""
    still: FloatArray = np.sum(
        [system.epsilon**each.order * np.array(each.matrix) for each in system.terms if each.g == one], axis=0
    )
    values = np.linalg.eigvals(still)
    return tuple(sorted(float(abs(each)) for each in values if each.imag > STILL * abs(each)))


def refuse_wrong_case(case: Case, wanted_of: str, terms: int) -> None:
    """Refuse a case whose noise cannot be replaced by one that was measured. Raises `FpsolveError`."""
    noise_in, unit = SIGNALS[wanted_of].noise_in, case.system.noise_unit
    sections = case.system.noise_sections
    if len(sections) > 1:
        raise FpsolveError(
            f"{case.path}: has the noises {', '.join(sections)}; a fit replaces the only noise of a case"
        )
    if any(key.startswith("noise.") for key in case.vary.keys):
        raise FpsolveError(f"{case.path}: varies its noise, which the fit replaces; leave these keys out of [vary]")
    if terms > 1:
        raise FpsolveError(f"got --terms {terms} for {case.path}, which has one noise; state --damping-ratio instead")
    place = {"1/time": "damping", "1/time²": "stiffness"}.get(unit, noise_in)
    if place != noise_in:
        raise FpsolveError(
            f"{case.path}: has its noise in the {place}, but the {noise_in} was measured; use [oscillator] for noise "
            'in the damping, and [system] with kind = "parametric" for noise in the stiffness'
        )
    if case.units.time not in ("time", "s"):
        raise FpsolveError(f"{case.path}: has the unit of time {case.units.time}, and measurements are in s; use s")


def measure(data: Spectrum | Record, wanted: Wanted, progress: Callable[[], None] = lambda: None) -> NoiseOutcome:
    """Fit a noise to what was measured, and say what it means.

    Args:
        data: in the unit of its signal, 1, 1/s, m/s² or m.
        wanted: see there.
        progress: called once for the fit, and as `verdict` does.

    Raises:
        FpsolveError: the kind does not fit, or nothing was measured where it matters.
    """
    converted = data.scaled(
        of_support_acceleration()
        if wanted.of == "acceleration"
        else of_stability_height(wanted.height)
        if wanted.of == "height" and wanted.height is not None
        else 1.0
    )
    omega = wanted.modes.omega
    try:
        if wanted.kind == NON_GAUSSIAN:
            if not isinstance(converted, Record):
                raise ValueError("a spectrum does not tell r0; name a record by --record")
            if wanted.terms > 1:
                raise ValueError(f"got --terms {wanted.terms} for --kind {NON_GAUSSIAN}, which has one; leave it out")
            if wanted.method != "spectrum":
                raise ValueError(
                    f"got --method {wanted.method} for --kind {NON_GAUSSIAN}, which has none; leave it out"
                )
            fit = non_gaussian_from_record(converted)
        else:
            second = omega[1] if len(omega) > 1 else None
            fit = fit_noise(
                converted,
                wanted.kind,
                frequency=omega[0],
                second_frequency=second,
                noise_in=wanted.noise_in,
                terms=wanted.terms,
                method=wanted.method,
                segment=wanted.segment,
            )
    except ValueError as error:
        raise FpsolveError(str(error)) from None
    fit = replace(fit, messages=(*(Message(Code.AS_READ, text=each) for each in data.notes), *fit.messages))
    progress()
    scaled = fit.scaled(_factor(wanted))
    found = {"exponent": None, "moment": None, "verdict": None, "failure": None} | _critical(fit, wanted)
    system = _system(wanted, len(fit.parts))
    if system is not None and wanted.terms < len(NAMES):
        try:
            problem = Problem(system, scaled.noise)
            rtol, budget = max(problem.usual_rtol, wanted.rtol), Budget(seconds=wanted.seconds)
            known = verdict(problem, scaled, rtol=rtol, budget=budget, progress=progress)
            found |= {"verdict": known, "failure": known.failure}
        except NotConverged as failure:
            found["failure"] = failure.message
        except ValueError as error:
            raise FpsolveError(str(error)) from None
    return NoiseOutcome(wanted, fit, scaled, **found)


def _factor(wanted: Wanted) -> float:
    """What the relative stiffness, or the damping, is multiplied by to be ξ of the system."""
    system = wanted.case.system if wanted.case else None
    if system is None:
        return of_relative_stiffness(wanted.modes.omega[0]) if wanted.noise_in == "stiffness" else 1.0
    if system.noise_unit == "1/time²":
        return of_relative_stiffness(natural_frequencies(system)[0])
    return 1 / system.epsilon if system.noise_unit == "1/time" else 1.0


def _system(wanted: Wanted, terms: int) -> System | None:
    """The system of the case, or an oscillator with the damping and the wall that are stated; None without either."""
    if wanted.case:
        return wanted.case.system
    omega, zeta, r = wanted.modes.omega[0], wanted.modes.zeta[0], wanted.modes.restitution
    if math.isnan(zeta) or len(wanted.modes.omega) > 1 or terms == len(NAMES):
        return None
    if terms > 1:
        names = NAMES[:terms]
        drive, sign = (" + ".join(names), "+") if wanted.noise_in == "damping" else (" + ".join(names), "-")
        force = f"{sign} ({drive}) * {'v' if wanted.noise_in == 'damping' else 'x'}"
        return PlaneSystem.of_equations(
            ("x", "v"),
            ("v", f"-omega**2 * x - 2*zeta*omega * v {force}"),
            {"omega": omega, "zeta": zeta},
            noises={name: f"noise.{name}" for name in names},
            walls=[] if r is None else [{"at": "x = 0", "restitution": r}],
        )
    if wanted.noise_in == "stiffness":
        return ParametricOscillator(stiffness=omega**2, damping=zeta * omega, restitution=r or 1.0)
    return VibroImpactOscillator(omega, r or 1.0, -2 * zeta * omega, 1.0, impact=ImpactLaw.RESTITUTION)


def _critical(fit: NoiseFit, wanted: Wanted) -> dict[str, Any]:
    """The damping ratios at which λ and Λ(2) vanish in weak noise, with errors as those of `verdict`."""
    if len(wanted.modes.omega) > 1:
        return {}
    omega = wanted.modes.omega[0]

    def ratios(each: NoiseFit) -> FloatArray:
        at_double, at_zero = each.spectral_density(2 * omega), each.spectral_density(0.0)
        exponent = weak_exponent(omega, 0.0, at_double, wanted.noise_in) / omega
        return np.array([exponent, weak_moment(2, omega, 0.0, at_double, at_zero, wanted.noise_in) / (2 * omega)])

    values, slopes = ratios(fit), slopes_of(fit, ratios)
    errors = np.sqrt(np.maximum(np.einsum("ki,kl,li->i", slopes, fit.covariance, slopes), 0.0))
    errors = np.hypot(errors, fit.off * values)
    exponent, moment = (Critical(float(a), float(b)) for a, b in zip(values, errors, strict=True))
    return {"exponent": exponent, "moment": moment}


def slopes_of(fit: NoiseFit, numbers: Any) -> FloatArray:
    """∂/∂θ of numbers of a fit, shape (k, n), by central differences.

    Args:
        fit: at whose parameters θ.
        numbers: takes a fit and gives an array of shape (n,).
    """
    rows = []
    for key, value in fit.parameters.items():
        h = 1e-5 * value
        up, down = (numbers(fit.at({key: value + step})) for step in (h, -h))
        rows.append((up - down) / (2 * h))
    return np.array(rows)


def density_of(fit: NoiseFit, omega: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """S(ω) of a fit at several ω, and its standard errors to first order."""

    def densities(each: NoiseFit) -> FloatArray:
        return np.array([each.spectral_density(w) for w in omega])

    slopes = slopes_of(fit, densities)
    return densities(fit), np.sqrt(np.maximum(np.einsum("ki,kl,li->i", slopes, fit.covariance, slopes), 0.0))
