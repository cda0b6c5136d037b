"""Noises that were fitted to measurements: as sections of a case, on the terminal, as files and as a figure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import chdtri

from fpsolve import __version__
from fpsolve.analysis.spreads import LEVEL, Spread
from fpsolve.arrays import FloatArray
from fpsolve.case.new import case_text, sum_text
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.rewrite import with_noise
from fpsolve.drawing import COLOURS, figure_for, label_axes, plain_numbers
from fpsolve.files import write_json, write_text
from fpsolve.measured.fit import NAMES, NoiseFit
from fpsolve.measured.signals import SIGNALS
from fpsolve.measured.spectrum import SIDES, UNITS
from fpsolve.model import Noise
from fpsolve.output.screen import Column, Grid, Screen
from fpsolve.output.terminal import percent, print_remark, sampled
from fpsolve.study.noise import Critical, NoiseOutcome, density_of

FILES = ("noise.json", "noise.png", "noise.pdf", "noise.toml")
DIGITS = 7
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
    for name, section, noise in zip(NAMES, sections if len(fit.parts) > 1 else sections[:1], fit.parts, strict=False):
        found += f"\n{f'[{section}]':34}  # {about}\n" + "".join(f"{line}\n" for line in _lines(noise, fit, name))
    return found


def _lines(noise: Noise, fit: NoiseFit, part: str) -> Iterator[str]:
    yield f'kind = "{noise.kind}"'
    errors = fit.errors
    values = {name: each for name, each in noise.values.items() if not isinstance(each, str)}
    if noise.kind == "filter":
        yield from (_line(name, values[name], errors, part, len(fit.parts)) for name in ("omega", "zeta", "s"))
        error = errors.get("c1", errors.get(f"{part}.c1"))
        remark = "c0 and c1 of ξ = c0 y + c1 y′" + (f", c1 ± {error:.2g}" if error is not None else "")
        output = f"output = [{_number(values['c0'], 0.0)}, {_number(values['c1'], error or 0.0)}]"
        yield f"{output:34}  # {remark}"
    else:
        yield from (_line(name, values[name], errors, part, len(fit.parts)) for name in values)


def _line(name: str, value: float, errors: Mapping[str, float], part: str, parts: int) -> str:
    error = errors.get(name if parts == 1 else f"{part}.{name}")
    text = f"{name} = {_number(value, error or 0.0)}"
    return text if error is None else f"{text:34}  # ± {error:.2g}"


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
    if wanted.case:
        return with_noise(wanted.case, sections, folder)
    count = len(outcome.fit.parts)
    if math.isnan(wanted.modes.zeta[0]) or len(wanted.modes.omega) > 1 or count == len(NAMES):
        return ""
    if count > 1:
        return sum_text(wanted.modes, NAMES[:count], wanted.noise_in, sections)
    kind = "parametric" if wanted.noise_in == "stiffness" else "oscillator"
    return case_text(kind, wanted.modes, sections)


def summary(outcome: NoiseOutcome, source: Path) -> dict[str, Any]:
    """All numbers; null where one is not known."""
    wanted, fit, scaled = outcome.wanted, outcome.fit, outcome.scaled

    def numbers(each: NoiseFit) -> dict[str, Any]:
        return {
            "parameters": dict(each.parameters),
            "errors": dict(each.errors),
            "covariance": each.covariance.tolist(),
        }

    def spread(each: Spread | None) -> dict[str, float] | None:
        if each is None:
            return None
        return {"value": each.value, "standard_error": each.deviation, "probability_below_0": each.below}

    def critical(each: Critical | None) -> dict[str, float] | None:
        if each is None:
            return None
        return {"value": each.value, "standard_error": each.error}

    omega = [each.omega for each in fit.misfit]
    densities, errors = density_of(fit, omega) if omega else (np.zeros(0), np.zeros(0))
    return {
        "file": source.name,
        "fpsolve_version": __version__,
        "of": wanted.of,
        "noise_in": wanted.noise_in,
        "kind": wanted.kind,
        "method": fit.method,
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
        "critical_damping_ratio": {"lyapunov_exponent": critical(outcome.exponent), "moment": critical(outcome.moment)},
        "lyapunov_exponent": outcome.verdict and spread(outcome.verdict.exponent),
        "second_moment": outcome.verdict and spread(outcome.verdict.moment),
        "warnings": [each.words(CASE_WORDS) for each in (*fit.messages, *filter(None, [outcome.failure]))],
    }


def print_noise(outcome: NoiseOutcome, source: Path, shown: Convention) -> None:
    """The sections of a case, the fit where it matters, and what it means."""
    screen, fit = Screen.of(), outcome.fit
    screen.lines([*noise_sections(outcome).strip().splitlines(), ""])
    if fit.misfit:
        screen.show(_misfit_grid(outcome, source, shown))
    for line in sentences(outcome):
        screen.say(line)
    for message in fit.messages:
        print_remark(f"{source.name}: {message.words(CASE_WORDS)}", message.severity)
    if outcome.failure is not None:
        print_remark(f"{source.name}: {outcome.failure.words(CASE_WORDS)}", outcome.failure.severity)


def _misfit_grid(outcome: NoiseOutcome, source: Path, shown: Convention) -> Grid:
    """A row for each frequency that matters."""
    fit, noise_in = outcome.fit, outcome.wanted.noise_in
    headings = "", f"{shown.symbol} ({shown.per})", "S fitted", "± s.e.", "measured/fitted"
    unit = "s" if noise_in == "stiffness" else "1/s"
    remark = f"S of the {SIGNAL_WORDS[noise_in]}, two-sided, in {unit}; G = {shown.factor:.4g} S as in the figure"
    grid = Grid(
        f"{source.name}: where stability depends on the noise",
        [*map(Column, headings), Column("± s.e.", 1)],
        remark=remark,
    )
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
    for symbol, each, below, above in (
        ("λ", outcome.verdict.exponent, "almost every path decays", "almost every path grows"),
        ("Λ(2)", outcome.verdict.moment, "the mean square decays", "the mean square grows"),
    ):
        if each is None:
            continue
        number = f"{symbol} = {sampled(each.value, each.deviation)} ± {each.deviation:.1g} 1/s"
        is_below = each.below >= 0.5
        sure = percent(each.below if is_below else 1 - each.below)
        yield f"{number}: {symbol} {'<' if is_below else '>'} 0 with {sure}, {below if is_below else above}."
    off = f", and that it is {outcome.fit.off:.0%} off where stability depends on it" if outcome.fit.off else ""
    yield f"The probabilities count the standard errors of the fit{off}; see the page From a measurement to a case."


def _missing(outcome: NoiseOutcome) -> str:
    """What to do for λ and Λ(2)."""
    if len(outcome.fit.parts) == len(NAMES):
        return "No case takes three noises; for λ and Λ(2) use --terms 1 or 2."
    if len(outcome.wanted.modes.omega) > 1:
        return "For λ and Λ(2) of two modes state their case by --case; `fpsolve new my.toml --kind modes` starts one."
    return "For λ and Λ(2) of an oscillator state its damping by --damping-ratio."


def _percent(each: Critical) -> str:
    """A damping ratio in percent with two digits of its error."""
    value, error = 100 * each.value, 100 * each.error
    return f"({sampled(value, error) if error > 0 else f'{value:.4g}'} ± {error:.1g}) %"


def band_of(fit: NoiseFit) -> tuple[FloatArray, FloatArray] | None:
    """Ends of the interval that holds S with `LEVEL` by each measured value, of the law of a mean of periodograms."""
    spectrum = fit.spectrum
    if spectrum.relative_error is None:
        return None
    freedom = 2 / spectrum.relative_error**2
    tail = 0.5 * (1 - LEVEL)
    ends = (spectrum.density * freedom / chdtri(freedom, share) for share in (tail, 1 - tail))
    low, high = ends
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
        axes.loglog(x, factor * spectrum.density, ".", color="0.35", markersize=4, label="measured")
        values, _ = density_of(fit, fine.tolist())
        axes.loglog(shown.frequency(fine), factor * values, "-", color=COLOURS[0], label="fitted")
        for each in fit.misfit:
            place = shown.frequency(each.omega) if each.omega else x[0]
            axes.axvline(place, color=COLOURS[1], linestyle=(0, (4, 2)), linewidth=1.2)
            name = each.name.replace("ω", shown.symbol) if each.omega else "← 0"
            axes.annotate(name, (place, 1.0), (3, -3), xycoords=("data", "axes fraction"), textcoords="offset points",
                          va="top", color=COLOURS[1], fontsize="small")  # fmt: skip
        axes.plot([], [], color=COLOURS[1], linestyle=(0, (4, 2)), linewidth=1.2, label="what stability depends on")
        axes.set_xlim(0.9 * x[0], x[-1] / 0.9)
        for axis in (axes.xaxis, axes.yaxis):
            plain_numbers(axis)
        low, high = np.nanmin(factor * spectrum.density), np.nanmax(factor * spectrum.density)
        axes.set_ylim(0.3 * low, 3 * high)
        sides = {"one": "one-sided", "two": "two-sided"}[shown.sided]
        symbol = {"Hz": "$f$", "rad/s": r"$\omega$"}[shown.per]
        label_axes(
            axes,
            {"long_name": "frequency", "symbol": symbol, "units": shown.per},
            {
                "long_name": f"{sides} density of {words}",
                "symbol": f"$G({symbol.strip('$')})$",
                "units": shown.unit(noise_in),
            },
        )
