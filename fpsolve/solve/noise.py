"""From a measurement to a noise, and to what it means for a system."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.kinds import made_of
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Budget
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
from fpsolve.model import Problem
from fpsolve.model.plane import STEADY, System

NON_GAUSSIAN = "non-gaussian"
STEPS_OF_A_FIT = 1 + STEPS
"""How often `measure` calls `progress` at most."""
RTOL = 1e-4
"""Of λ and Λ(2), whose errors by the fit are some percent."""
SECONDS = 20.0
"""Of a processor for λ and for Λ(2) each."""
FILES = ("noise.json", "noise.png", "noise.pdf", "noise.toml")
"""What is written of a measurement."""
STILL = 1e-6
"""Of a modulus: imaginary parts below are none."""


@dataclass(frozen=True)
class Modes:
    """What is known of the system.

    Attributes:
        omega: natural frequencies, in rad/s, one or two.
        zeta: damping ratio of the first; NaN where it is not known.
        restitution: speed after a bounce over that before; None where there is no wall.
    """

    omega: tuple[float, ...]
    zeta: float
    restitution: float | None = None


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is to be fitted, and for what.

    Attributes:
        of: what was measured, one of `SIGNALS`.
        kind, terms: as for `fit_noise`, or the kind "non-gaussian" of a record.
        modes: natural frequencies, damping, a wall.
        height: GM where its variation was measured.
        case: whose system the noise is for; None for an oscillator with the first mode's damping.
        segment: of a record, in s; None for what the frequencies need.
        rtol, seconds: tolerance and time for λ and for Λ(2).
    """

    of: str
    kind: str
    terms: int
    modes: Modes
    height: float | None = None
    case: Case | None = None
    segment: float | None = None
    rtol: float = RTOL
    seconds: float = SECONDS

    @property
    def noise_in(self) -> Where:
        return SIGNALS[self.of].noise_in


Critical = tuple[float, float]
"""A damping ratio above which a moment decays in weak noise without walls, and its standard error."""


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
    values = np.linalg.eigvals(system.linear().by_noise()[STEADY])
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


def measure(data: Spectrum | Record, wanted: Wanted, progress: Callable[[], None]) -> NoiseOutcome:
    """Fit a noise to what was measured, and say what it means.

    Args:
        data: in the unit of its signal, 1, 1/s, m/s² or m.
        wanted: see there.
        progress: called once for the fit, and as `verdict` does.

    Raises:
        FpsolveError: the kind does not fit, or nothing was measured where it matters.
    """
    try:
        fit = _fit(data, wanted)
        fit = replace(fit, messages=(*(Message(Code.AS_READ, text=each) for each in data.notes), *fit.messages))
        progress()
        outcome = NoiseOutcome(wanted, fit, fit.scaled(_factor(wanted)), *_critical(fit, wanted))
        if (system := _system(wanted, len(fit.parts))) is None:
            return outcome
        problem = Problem(system, outcome.scaled.noise)
        rtol, budget = max(choose(problem).usual_rtol, wanted.rtol), Budget(seconds=wanted.seconds)
        known = verdict(problem, outcome.scaled, rtol=rtol, budget=budget, progress=progress)
    except NotConverged as failure:
        return replace(outcome, failure=failure.message)
    except ValueError as error:
        raise FpsolveError(str(error)) from None
    return replace(outcome, verdict=known, failure=known.failure)


def _fit(data: Spectrum | Record, wanted: Wanted) -> NoiseFit:
    """The noise of the relative stiffness, or of the damping. Raises `ValueError`, `FpsolveError`."""
    factor = of_support_acceleration() if wanted.of == "acceleration" else 1.0
    converted = data.scaled(factor if wanted.height is None else of_stability_height(wanted.height))
    if wanted.kind != NON_GAUSSIAN:
        first, *others = wanted.modes.omega
        return fit_noise(
            converted, wanted.kind, frequency=first, second_frequency=next(iter(others), None),
            noise_in=wanted.noise_in, terms=wanted.terms, segment=wanted.segment,
        )  # fmt: skip
    if not isinstance(converted, Record):
        raise ValueError("a spectrum does not tell r0; name a record by --record")
    if wanted.terms > 1:
        raise ValueError(f"got --terms {wanted.terms} for --kind {NON_GAUSSIAN}, which has one; leave it out")
    return non_gaussian_from_record(converted)


def _factor(wanted: Wanted) -> float:
    """What the relative stiffness, or the damping, is multiplied by to be ξ of the system."""
    system = wanted.case.system if wanted.case else None
    if system is None:
        return of_relative_stiffness(wanted.modes.omega[0]) if wanted.noise_in == "stiffness" else 1.0
    if system.noise_unit == "1/time²":
        return of_relative_stiffness(natural_frequencies(system)[0])
    return 1 / system.linear().epsilon if system.noise_unit == "1/time" else 1.0


def _system(wanted: Wanted, terms: int) -> System | None:
    """The system of the case, or the oscillator that is stated; None without either."""
    if wanted.case:
        return wanted.case.system
    _, table = oscillator_of(wanted, terms)
    system: Any = made_of("system", table) if table else None
    return system


def oscillator_of(wanted: Wanted, terms: int) -> tuple[str, dict[str, Any]]:
    """The section and the table of an oscillator with the damping and the wall that are stated; nothing without these.

    Under the sum of two noises it is an equation.
    """
    omega, zeta, r = wanted.modes.omega[0], wanted.modes.zeta, wanted.modes.restitution
    if math.isnan(zeta) or len(wanted.modes.omega) > 1:
        return "", {}
    if terms > 1:
        total = " + ".join(NAMES)
        force = f"+ ({total}) * v" if wanted.noise_in == "damping" else f"- ({total}) * x"
        return "system", {
            "variables": ["x", "v"],
            "drift": ["v", f"-omega**2 * x - 2*zeta*omega * v {force}"],
            "parameters": {"omega": omega, "zeta": zeta},
            "noises": {name: f"noise.{name}" for name in NAMES},
            "walls": [] if r is None else [{"at": "x = 0", "restitution": r}],
        }
    wall = {"restitution": r or 1.0}
    if wanted.noise_in == "stiffness":
        return "system", {"kind": "parametric", "stiffness": omega**2, "damping": zeta * omega, **wall}
    return "oscillator", {"omega": omega, "c1": -2 * zeta * omega, "impact": "restitution", "epsilon": 1.0, **wall}


def _critical(fit: NoiseFit, wanted: Wanted) -> tuple[Critical | None, Critical | None]:
    """The damping ratios at which λ and Λ(2) vanish in weak noise, by the densities that were measured or named."""
    if len(wanted.modes.omega) > 1 or (wanted.case and wanted.case.system.noise_unit == "unknown"):
        return None, None  # of equations that have a coefficient of their own for the noise
    omega = wanted.modes.omega[0]
    values, errors = density_of(fit, [2 * omega, 0.0])
    for i, each in enumerate(fit.misfit):
        values[i] *= 1 + each.relative
        errors[i] = each.error * values[i]

    def moment(at_double: float, at_zero: float) -> float:
        return weak_moment(2, omega, 0.0, at_double, at_zero, wanted.noise_in) / (2 * omega)

    value, error = (weak_exponent(omega, 0.0, each, wanted.noise_in) / omega for each in (values[0], errors[0]))
    return (value, error), (moment(*values), math.hypot(moment(errors[0], 0.0), moment(0.0, errors[1])))


def density_of(fit: NoiseFit, omega: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """S(ω) of a fit at several ω, and its standard errors to first order, by central differences."""

    def densities(each: NoiseFit) -> FloatArray:
        return np.array([each.spectral_density(w) for w in omega])

    slopes = list[FloatArray]()
    for key, value in fit.parameters.items():
        h = 1e-5 * value
        up, down = (densities(fit.at({key: value + step})) for step in (h, -h))
        slopes.append((up - down) / (2 * h))
    return densities(fit), np.sqrt(np.maximum(np.einsum("ki,kl,li->i", slopes, fit.covariance, slopes), 0.0))
