"""Noises that were fitted to measurements: as sections of a case, as files and as a figure."""

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
from fpsolve.study.noise import Critical, NoiseOutcome, density_of

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
        source_label = "formula" if spectrum.is_formula else "measured"
        axes.loglog(x, factor * spectrum.density, ".", color="0.35", markersize=4, label=source_label)
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
