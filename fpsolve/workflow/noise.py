"""From a measurement to a noise, and to what it means: the fit, its files, and what is said of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomlkit
from scipy.special import chdtri

from fpsolve import __version__
from fpsolve.analysis.spreads import LEVEL, Spread
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.kinds import made_of
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.rewrite import rewritten
from fpsolve.drawing import COLOURS, figure_for, label_axes, plain_numbers
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import Budget
from fpsolve.fem.factors import one_thread
from fpsolve.files import alone, writable, write_json, write_text
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
from fpsolve.measured.spectrum import SIDES, UNITS
from fpsolve.measured.stability import STEPS
from fpsolve.measured.weak import Where
from fpsolve.messages import Code, Message
from fpsolve.model import Noise, Problem
from fpsolve.model.plane import STEADY, System
from fpsolve.page.page import Block, Column, Grid, Sentence
from fpsolve.results.text import likely, sampled
from fpsolve.show.notes import note_on
from fpsolve.workflow.progress import SILENT, SOLVES, Phase, Watch

NON_GAUSSIAN = "non-gaussian"
STEPS_OF_A_FIT = 1 + STEPS
"""How often `measure` calls `progress` at most."""
RTOL = 1e-4
"""Of λ and Λ(2), whose errors by the fit are some percent."""
SECONDS = 20.0
"""Of a processor for λ and for Λ(2) each."""
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


class Critical(NamedTuple):
    """A damping ratio above which a moment decays in weak noise without walls, and its standard error."""

    value: float
    standard_error: float


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
                segment=wanted.segment,
            )
    except ValueError as error:
        raise FpsolveError(str(error)) from None
    fit = replace(fit, messages=(*(Message(Code.AS_READ, text=each) for each in data.notes), *fit.messages))
    progress()
    scaled = fit.scaled(_factor(wanted))
    found = _critical(fit, wanted)
    system = _system(wanted, len(fit.parts))
    if system is not None:
        try:
            problem = Problem(system, scaled.noise)
            rtol, budget = max(choose(problem).usual_rtol, wanted.rtol), Budget(seconds=wanted.seconds)
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
    return 1 / system.linear().epsilon if system.noise_unit == "1/time" else 1.0


def _system(wanted: Wanted, terms: int) -> System | None:
    """The system of the case, or the oscillator that is stated; None without either."""
    if wanted.case:
        return wanted.case.system
    _, table = _oscillator(wanted, terms)
    system: Any = made_of("system", table) if table else None
    return system


def _oscillator(wanted: Wanted, terms: int) -> tuple[str, dict[str, Any]]:
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


def _critical(fit: NoiseFit, wanted: Wanted) -> dict[str, Any]:
    """The damping ratios at which λ and Λ(2) vanish in weak noise, by the densities that were measured or named."""
    if len(wanted.modes.omega) > 1 or (wanted.case and wanted.case.system.noise_unit == "unknown"):
        return {}  # of equations that have a coefficient of their own for the noise
    omega, where = wanted.modes.omega[0], wanted.noise_in
    values, errors = density_of(fit, [2 * omega, 0.0])
    for i, each in enumerate(fit.misfit):
        values[i] *= 1 + each.relative
        errors[i] = each.error * values[i]
    of_zero = [weak_moment(2, omega, 0.0, 0.0, each, where) for each in (values[1], errors[1])]
    of_double = [weak_moment(2, omega, 0.0, each, 0.0, where) for each in (values[0], errors[0])]
    exponent = [weak_exponent(omega, 0.0, each, where) / omega for each in (values[0], errors[0])]
    moment = (of_double[0] + of_zero[0]) / (2 * omega), math.hypot(of_double[1], of_zero[1]) / (2 * omega)
    return {"exponent": Critical(*exponent), "moment": Critical(*moment)}


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


FILES = ("noise.json", "noise.png", "noise.pdf", "noise.toml")
SIGNAL_WORDS = {"stiffness": "relative stiffness", "damping": "damping"}


@dataclass(frozen=True)
class Convention:
    """How densities are shown: as the file has them, or one-sided per Hz.

    Attributes:
        per: "Hz" or "rad/s".
        sided: "one" or "two".
    """

    per: str
    sided: str

    @property
    def factor(self) -> float:
        """G over S: 2 for one-sided values per Hz, 1/π per rad/s."""
        return 1 / SIDES[self.sided] / (2 * math.pi if self.per == "rad/s" else 1.0)

    def frequency(self, omega: Any) -> Any:
        """ω in the unit of frequencies."""
        return omega / UNITS[self.per]

    @property
    def symbol(self) -> str:
        return "f" if self.per == "Hz" else "ω"

    def unit(self, noise_in: str) -> str:
        """Of densities."""
        per = {"Hz": "Hz", "rad/s": "(rad/s)"}[self.per]
        return f"1/{per}" if noise_in == "stiffness" else f"1/s^2/{per}"


def noise_sections(outcome: NoiseOutcome) -> str:
    """[noise] as a case file has it, with standard errors as remarks; of a sum [noise.first] and so on."""
    wanted, fit = outcome.wanted, outcome.scaled
    sections = wanted.case.system.noise_sections if wanted.case else ("noise",)
    if len(fit.parts) > 1:
        sections = tuple(f"noise.{name}" for name in NAMES)
    unit = (
        wanted.case.system.noise_unit if wanted.case else {"stiffness": "1/time²", "damping": "1/time"}[wanted.noise_in]
    )
    told = {"1/time²": "ω² times the relative stiffness, in 1/s²", "1/time": "the damping, in 1/s"}
    about = told.get(unit, f"the {SIGNAL_WORDS[wanted.noise_in]}")
    found = ""
    for name, section, noise in zip(NAMES, sections, fit.parts, strict=False):
        found += f"\n{f'[{section}]':34}  # {about}\n" + "".join(f"{line}\n" for line in _lines(noise, fit, name))
    return found


def _lines(noise: Noise, fit: NoiseFit, part: str) -> Iterator[str]:
    yield f'kind = "{noise.kind}"'
    yield from (f'{name} = "{word}"' for name, word in noise.words.items())
    errors = fit.errors
    values = {name: each for name, each in noise.values.items() if not isinstance(each, str)}
    is_filter = noise.kind == "filter"
    for name in ("omega", "zeta", "s") if is_filter else values:
        error = errors.get(name if len(fit.parts) == 1 else f"{part}.{name}")
        text = f"{name} = {_number(values[name], error or 0.0)}"
        yield f"{text:34}  # ± {error:.2g}" if error else text
    if is_filter:
        error = errors.get("c1", errors.get(f"{part}.c1"))
        remark = "c0 and c1 of ξ = c0 y + c1 y′" + (f", c1 ± {error:.2g}" if error is not None else "")
        output = f"output = [{_number(values['c0'], 0.0)}, {_number(values['c1'], error or 0.0)}]"
        yield f"{output:34}  # {remark}"


def _number(value: float, error: float) -> str:
    """With four digits more than its error has, as TOML has it."""
    digits = 10 if not error else min(max(4 + math.ceil(math.log10(abs(value) / error)), 5), 12)
    text = f"{value:.{digits}g}"
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def write_noise(outcome: NoiseOutcome, source: Path, shown: Convention, folder: Path) -> list[str]:
    """noise.json, noise.png, noise.pdf, and noise.toml where there is a system: their names."""
    text = case_of(outcome, folder)
    write_json(folder / "noise.json", summary(outcome, source))
    if text:
        write_text(folder / "noise.toml", text)
    else:  # of other options
        (folder / "noise.toml").unlink(missing_ok=True)
    draw_noise(outcome, source, shown, folder)
    return [name for name in FILES if text or name != "noise.toml"]


def case_of(outcome: NoiseOutcome, folder: Path) -> str:
    """The case with the noise, ready to run; empty where there is no system."""
    wanted, sections = outcome.wanted, noise_sections(outcome)
    omega, zeta = wanted.modes.omega[0], wanted.modes.zeta
    if wanted.case:
        return rewritten(wanted.case, folder, without=["noise", "expect"], more=sections)
    section, table = _oscillator(wanted, len(outcome.fit.parts))
    if not table:
        return ""
    hertz = f"{omega / (2 * math.pi):.4g} Hz, {zeta:.4g} of critical damping"
    data = {
        "title": f"Oscillator with noise in its {wanted.noise_in}: {hertz}",
        section: {key: float(f"{each:.12g}") if isinstance(each, float) else each for key, each in table.items()},
        "units": {"time": "s"},
        "moments": {"p": {"start": -2.0, "stop": 4.0, "num": 25}},
    }
    return tomlkit.dumps(data) + sections


def summary(outcome: NoiseOutcome, source: Path) -> dict[str, Any]:
    """All numbers; null where one is not known."""
    wanted, fit, scaled = outcome.wanted, outcome.fit, outcome.scaled

    def numbers(each: NoiseFit) -> dict[str, Any]:
        return {
            "parameters": dict(each.parameters),
            "errors": dict(each.errors),
            "covariance": each.covariance.tolist(),
        }

    def spread(each: Spread | None) -> dict[str, float | None] | None:
        if each is None:
            return None
        error, below = (None, None) if fit.spectrum.is_formula else (each.deviation, each.below)
        return {"value": each.value, "standard_error": error, "probability_below_0": below}

    omega = [each.omega for each in fit.misfit]
    densities, errors = density_of(fit, omega) if omega else (np.zeros(0), np.zeros(0))
    return {
        "file": source.name,
        "fpsolve_version": __version__,
        "of": wanted.of,
        "noise_in": wanted.noise_in,
        "kind": wanted.kind,
        "units": {"time": "s"},
        "natural_frequencies": list(wanted.modes.omega),
        "fit": {"signal": SIGNAL_WORDS[wanted.noise_in], **numbers(fit)},
        "noise": numbers(scaled),
        "frequencies": [
            {
                "name": each.name,
                "omega": each.omega,
                "density": float(density),
                "density_error": float(error),
                "measured_over_fitted": 1 + each.relative,
                "measured_over_fitted_error": each.error,
            }
            for each, density, error in zip(fit.misfit, densities, errors, strict=True)
        ],
        "critical_damping_ratio": {
            "lyapunov_exponent": outcome.exponent and outcome.exponent._asdict(),
            "moment": outcome.moment and outcome.moment._asdict(),
        },
        "lyapunov_exponent": outcome.verdict and spread(outcome.verdict.exponent),
        "second_moment": outcome.verdict and spread(outcome.verdict.moment),
        "warnings": [each.words(CASE_WORDS) for each in (*fit.messages, *filter(None, [outcome.failure]))],
    }


def band_of(fit: NoiseFit) -> tuple[FloatArray, FloatArray] | None:
    """Ends of the interval that holds S with `LEVEL` by each measured value, of the law of a mean of periodograms."""
    spectrum = fit.spectrum
    if spectrum.relative_error is None:
        return None
    freedom, tail = 2 / spectrum.relative_error**2, 0.5 * (1 - LEVEL)
    low, high = (spectrum.density * freedom / chdtri(freedom, share) for share in (tail, 1 - tail))
    return low, high


def draw_noise(outcome: NoiseOutcome, source: Path, shown: Convention, folder: Path) -> None:
    """noise.png and .pdf: what was measured with its 95 % interval, what was fitted, the frequencies that matter."""
    fit, noise_in = outcome.fit, outcome.wanted.noise_in
    spectrum, words = fit.spectrum, SIGNAL_WORDS[noise_in]
    paths = [folder / f"noise.{ending}" for ending in ("png", "pdf")]
    factor, x = shown.factor, shown.frequency(spectrum.frequencies)
    fine = np.geomspace(spectrum.frequencies[0], spectrum.frequencies[-1], 400)
    kind = fit.parts[0].kind
    title = f"{source.name}: {SIGNALS[outcome.wanted.of].words}, fitted by {kind} noise"
    if len(fit.parts) > 1:
        title = title.replace(f"{kind} noise", f"{len(fit.parts)} {kind} noises")
    with figure_for(paths, title) as figure:
        axes = figure.subplots()
        if (band := band_of(fit)) is not None:
            axes.fill_between(x, factor * band[0], factor * band[1], color="0.75", linewidth=0, label="95 % interval")
        source_label = "formula" if spectrum.is_formula else "measured"
        axes.loglog(x, factor * spectrum.density, ".", color="0.35", markersize=4, label=source_label)
        values, _ = density_of(fit, fine.tolist())
        axes.loglog(shown.frequency(fine), factor * values, "-", color=COLOURS[0], label="fitted")
        dashed: dict[str, Any] = {"color": COLOURS[1], "linestyle": (0, (4, 2)), "linewidth": 1.2}
        for each in fit.misfit:
            place = shown.frequency(each.omega) if each.omega else x[0]
            axes.axvline(place, **dashed)
            name = each.name.replace("ω", shown.symbol) if each.omega else "← 0"
            axes.annotate(name, (place, 1.0), (3, -3), xycoords=("data", "axes fraction"), textcoords="offset points",
                          va="top", color=COLOURS[1], fontsize="small")  # fmt: skip
        axes.plot([], [], label="what stability depends on", **dashed)
        axes.set_xlim(0.9 * x[0], x[-1] / 0.9)
        for axis in (axes.xaxis, axes.yaxis):
            plain_numbers(axis)
        low, high = np.nanmin(factor * spectrum.density), np.nanmax(factor * spectrum.density)
        axes.set_ylim(0.3 * low, 3 * high)
        symbol = {"Hz": "$f$", "rad/s": r"$\omega$"}[shown.per]
        label_axes(
            axes,
            {"long_name": "frequency", "symbol": symbol, "units": shown.per},
            {
                "long_name": f"{shown.sided}-sided density of {words}",
                "symbol": f"$G({symbol.strip('$')})$",
                "units": shown.unit(noise_in),
            },
        )


def show(outcome: NoiseOutcome, source: Path, shown: Convention) -> Iterator[Block]:
    """The fit, its meaning, and what limits it."""
    if outcome.fit.misfit:
        yield misfit_grid(outcome, source, shown)
    yield from map(Sentence, sentences(outcome))
    for message in (*outcome.fit.messages, *filter(None, [outcome.failure])):
        yield note_on(source.name, message)


def misfit_grid(outcome: NoiseOutcome, source: Path, shown: Convention) -> Grid:
    """A row for each frequency that matters."""
    fit, noise_in = outcome.fit, outcome.wanted.noise_in
    headings = "", f"{shown.symbol} ({shown.per})", "S fitted", "± s.e.", "measured/fitted"
    unit = "s" if noise_in == "stiffness" else "1/s"
    remark = f"S of the {SIGNAL_WORDS[noise_in]}, two-sided, in {unit}; G = {shown.factor:.4g} S as in the figure"
    title = f"{source.name}: where stability depends on the noise"
    grid = Grid(title, [*map(Column, headings), Column("± s.e.", 1)], remark=remark)
    values, errors = density_of(fit, [each.omega for each in fit.misfit])
    for each, value, error in zip(fit.misfit, values.tolist(), errors.tolist(), strict=True):
        name, frequency = each.name.replace("ω", shown.symbol), f"{shown.frequency(each.omega):.4g}"
        numbers = f"{value:.4g}", f"{error:.2g}", f"{1 + each.relative:.4g}", f"{each.error:.2g}"
        grid.rows.append([name, frequency, *numbers])
    return grid


def sentences(outcome: NoiseOutcome) -> Iterator[str]:
    """What the fit means: critical damping ratios, and λ and Λ(2) of the system with their probabilities."""
    if outcome.exponent and outcome.moment:
        walls = " without walls" if outcome.wanted.modes.restitution not in (None, 1.0) or outcome.wanted.case else ""
        exponent, moment = _percent(outcome.exponent), _percent(outcome.moment)
        yield f"In weak noise{walls} λ < 0 above {exponent} of critical damping, and Λ(2) < 0 above {moment}."
    if outcome.verdict is None:
        if outcome.failure is None:
            yield _missing(outcome)
        return
    is_formula = outcome.fit.spectrum.is_formula
    for symbol, each, what in (
        ("λ", outcome.verdict.exponent, "almost every path"),
        ("Λ(2)", outcome.verdict.moment, "the mean square"),
    ):
        if each is not None:
            number, error = sampled(each.value, each.deviation), "" if is_formula else f" ± {each.deviation:.1g}"
            fate = likely(what, each.below).partition(" with" if is_formula else "\n")[0]
            if abs(each.value) <= each.deviation:
                fate = f"{what} is not decided; measure for longer, or try another --kind"
            yield f"{symbol} = {number}{error} 1/s: {fate}."
    if is_formula:
        return
    share = outcome.fit.off
    off = f", and that it is {share:.0%} off where stability depends on it (try another --kind)" if share else ""
    yield f"The probabilities count the standard errors of the fit{off}; see the page From a measurement to a case."


def _missing(outcome: NoiseOutcome) -> str:
    """What to do for λ and Λ(2)."""
    if len(outcome.wanted.modes.omega) > 1:
        return "For λ and Λ(2) of two modes state their case by --case; `fpsolve new coupled` copies one."
    return "For λ and Λ(2) of an oscillator state its damping by --damping-ratio."


def _percent(each: Critical) -> str:
    """A damping ratio in percent with two digits of its error."""
    value, error = 100 * each.value, 100 * each.standard_error
    return f"({sampled(value, error)} ± {error:.1g}) %" if error else f"{value:.4g} %"


def noise_case(
    data: Spectrum | Record, wanted: Wanted, source: Path, shown: Convention, out: Path, watch: Watch = SILENT
) -> tuple[NoiseOutcome, Path, list[str]]:
    """Fit a noise, and write it with a figure into a folder called as the file of the measurement.

    Args:
        data, wanted: see `measure`.
        source: the file.
        shown: how densities are shown.
        out: where the folder is made.
        watch: of the progress, with a bar for the fit and what it means.

    Returns:
        What became of it, the folder, and the names of the files.

    Raises:
        FpsolveError: there is no fit; nothing is written.
        OutputError: the folder cannot be made or written to, or another run writes into it.
    """
    folder = out / source.name  # with its ending, so that it is none of a case
    try:
        with one_thread(), watch.bar(Phase(source.stem, "solving", STEPS_OF_A_FIT, SOLVES)) as progress:
            outcome = measure(data, wanted, progress)  # the arrays are small
    except FpsolveError as error:
        raise FpsolveError(f"{source}: {error}") from None
    with alone(folder), writable(folder):
        names = write_noise(outcome, source, shown, folder)
    return outcome, folder, names
