"""From a measurement to a noise, and to what it means for a system."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
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
    verdict,
    weak_exponent,
    weak_moment,
)
from fpsolve.measured.fit import NAMES, slopes_of
from fpsolve.measured.signals import SIGNALS
from fpsolve.measured.stability import STEPS
from fpsolve.measured.weak import GRAVITY, Where, frequencies_that_matter
from fpsolve.messages import Code, Message
from fpsolve.model import ImpactLaw, ParametricOscillator, PlaneSystem, Problem, VibroImpactOscillator
from fpsolve.model.plane import STEADY, System
from fpsolve.model.systems.equations import EquationSystem

NON_GAUSSIAN = "non-gaussian"
STEPS_OF_A_FIT = 1 + STEPS
"""How often `measure` calls `progress` at most."""
RTOL = 1e-4
"""Of λ and Λ(2), whose errors by the fit are some percent."""
SECONDS = 20.0
"""Of a processor for λ and for Λ(2) each."""
FILES = ("noise.json", "noise.png", "noise.pdf", "noise.toml")
"""What is written of a measurement."""
IMPACT = "oscillator.impact"
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

    @property
    def second(self) -> float | None:
        return self.omega[1] if len(self.omega) > 1 else None


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

    @property
    def noise_unit(self) -> str:
        """Of ξ in the system."""
        own = "1/time²" if self.noise_in == "stiffness" else "1/time"
        return self.case.system.noise_unit if self.case else own


Number = tuple[float, float]
"""A number and its standard error."""


class Density(NamedTuple):
    """S(ω) of the relative stiffness, or of the damping, at a frequency ω that matters, in rad/s.

    Attributes:
        measured: as the values near ω, or the formula, have it; None where the kind is fitted to moments.
    """

    name: str
    omega: float
    measured: Number | None
    fitted: Number


@dataclass(frozen=True, eq=False)
class NoiseOutcome:
    """What became of a measurement.

    Attributes:
        data: what was measured, in the unit of its signal.
        fit: of the relative stiffness, or of the damping in 1/s.
        scaled: the same in the unit in which the system takes it.
        system: under this noise; None where none is stated.
        densities: at the frequencies that matter.
        exponent, moment: of one mode the damping ratios above which λ < 0 and Λ(2) < 0 in weak noise without walls.
        verdict: of the system; None where nothing of it was solved.
        failure: why it, or a part of it, was not solved.
    """

    wanted: Wanted
    data: Spectrum | Record
    fit: NoiseFit
    scaled: NoiseFit
    system: System | None
    densities: Sequence[Density]
    exponent: Number | None = None
    moment: Number | None = None
    verdict: Verdict | None = None
    failure: Message | None = None

    @property
    def messages(self) -> Sequence[Message]:
        return (*self.fit.messages, *filter(None, [self.failure]))


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
        try:
            under_sum(case.system)
        except ValueError as error:
            raise FpsolveError(f"got --terms {terms} for {case.path}: {error}") from None
        if isinstance(case.system, VibroImpactOscillator) and (case.vary.file or IMPACT in case.vary.keys):
            raise FpsolveError(
                f"got --terms {terms} for {case.path}, whose [oscillator] then becomes an equation; leave out [vary] "
                "of the impact law or with a file, or write the system as an equation"
            )
    place = {"1/time": "damping", "1/time²": "stiffness"}.get(unit, noise_in)
    if place != noise_in:
        raise FpsolveError(
            f"{case.path}: has its noise in the {place}, but the file has the {noise_in}; use [oscillator] for noise "
            'in the damping, [system] with kind = "parametric" for the stiffness'
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
        densities = [*_densities(fit, wanted)]
        scaled, critical = fit.scaled(_factor(wanted)), _critical(densities, wanted)
        system = _system(wanted)
        outcome = NoiseOutcome(wanted, data, fit, scaled, system, densities, *critical)
        if system is None:
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
    converted = data.scaled(1 / (wanted.height or (GRAVITY if wanted.of == "acceleration" else 1.0)))
    if wanted.kind != NON_GAUSSIAN:
        return fit_noise(
            converted, wanted.kind, frequency=wanted.modes.omega[0], second_frequency=wanted.modes.second,
            noise_in=wanted.noise_in, terms=wanted.terms, segment=wanted.segment,
        )  # fmt: skip
    if not isinstance(converted, Record):
        raise ValueError("a spectrum does not tell r0; name a record by --record")
    if wanted.terms > 1:
        raise ValueError(f"got --terms {wanted.terms} for --kind {NON_GAUSSIAN}, which has one; leave it out")
    return non_gaussian_from_record(converted)


def _factor(wanted: Wanted) -> float:
    """What the relative stiffness, or the damping, is multiplied by to be ξ of the system."""
    if wanted.noise_unit == "1/time²":
        return wanted.modes.omega[0] ** 2
    return 1 / wanted.case.system.linear().epsilon if wanted.case and wanted.noise_unit == "1/time" else 1.0


def _system(wanted: Wanted) -> System | None:
    """The system of the case, or the oscillator that is stated, under all terms of the noise; None without either."""
    omega, zeta, r = wanted.modes.omega[0], wanted.modes.zeta, wanted.modes.restitution or 1.0
    if wanted.case:
        system = wanted.case.system
    elif math.isnan(zeta) or wanted.modes.second:
        return None
    elif wanted.noise_in == "stiffness":
        system = ParametricOscillator(stiffness=omega**2, damping=zeta * omega, restitution=r)
    else:
        c1, impact = -2 * zeta * omega, ImpactLaw.RESTITUTION
        system = VibroImpactOscillator(omega=omega, restitution=r, c1=c1, epsilon=1.0, impact=impact)
    return under_sum(system) if wanted.terms > 1 else system


def under_sum(system: System) -> EquationSystem:
    """An equation with the sum of two noises in place of a system's noise. Raises `ValueError` where there is none."""
    total, noises = " + ".join(NAMES), {name: f"noise.{name}" for name in NAMES}
    if type(system) is EquationSystem:
        [(symbol, _)] = system.noises
        rates = [re.sub(rf"\b{symbol}\b", f"({total})", rate) for rate in system.drift]
        return replace(system, drift=rates, noises=tuple(noises.items()))
    if isinstance(system, ParametricOscillator):
        rate, restitution = f"-(stiffness + {total})*x - 2*damping*v", "restitution"
    elif isinstance(system, VibroImpactOscillator):
        rate = f"-omega**2*x + epsilon*({total})*v + epsilon**2*(c1 - c2*x**2 - c3*v**2)*v"
        loss = "epsilon**2*(1 - restitution)"
        restitution = f"exp(-{loss})" if system.impact == ImpactLaw.DELTA else f"1 - {loss}"
    else:
        raise ValueError("this kind of system has one noise; write the system as an equation, with variables and drift")
    numbers = {name: value for name, value in system.values.items() if isinstance(value, float)}
    wall = {"at": "x = 0", "restitution": restitution}
    return PlaneSystem.of_equations(("x", "v"), ("v", rate), numbers, noises=noises, walls=[wall])


def _densities(fit: NoiseFit, wanted: Wanted) -> Iterator[Density]:
    matter = frequencies_that_matter(wanted.modes.omega[0], wanted.modes.second, wanted.noise_in)
    values, errors = density_of(fit, [*matter.values()])
    for i, (name, omega) in enumerate(matter.items()):
        measured, fitted = None, (float(values[i]), float(errors[i]))
        if fit.misfit:
            found = fitted[0] * (1 + fit.misfit[i].relative)
            measured = found, found * fit.misfit[i].error
        yield Density(name, omega, measured, fitted)


def _critical(densities: Sequence[Density], wanted: Wanted) -> tuple[Number | None, Number | None]:
    """The damping ratios at which λ and Λ(2) vanish in weak noise, by the densities that were measured or named."""
    if wanted.modes.second or wanted.noise_unit == "unknown":
        return None, None  # of equations that have a coefficient of their own for the noise
    omega, noise_in = wanted.modes.omega[0], wanted.noise_in
    (double, its_error), (zero, zero_error) = [*(each.measured or each.fitted for each in densities), (0.0, 0.0)][:2]

    def moment(at_double: float, at_zero: float) -> float:
        return weak_moment(2, omega, 0.0, at_double, at_zero, noise_in) / (2 * omega)

    value, error = (weak_exponent(omega, 0.0, each, noise_in) / omega for each in (double, its_error))
    return (value, error), (moment(double, zero), math.hypot(moment(its_error, 0.0), moment(0.0, zero_error)))


def density_of(fit: NoiseFit, omega: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """S(ω) of a fit at several ω, and its standard errors to first order, by central differences."""

    def densities(each: NoiseFit) -> FloatArray:
        return np.array([each.spectral_density(w) for w in omega])

    slopes = slopes_of(lambda values: densities(fit.at(values)), fit.values) / fit.values
    return densities(fit), np.sqrt(np.maximum(np.einsum("ik,kl,il->i", slopes, fit.covariance, slopes), 0.0))
