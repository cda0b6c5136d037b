"""A fitted noise in words, tables and a picture."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import chdtri

from fpsolve.analysis.spreads import LEVEL
from fpsolve.drawing import figure_for, label_axes, plain_numbers
from fpsolve.measured.signals import SIGNALS
from fpsolve.measured.spectrum import SIDES, UNITS
from fpsolve.solve.noise import Critical, NoiseOutcome, density_of
from fpsolve.tell.blocks import Block, Column, Grid, Sentence
from fpsolve.tell.notes import note_on
from fpsolve.tell.text import likely, sampled


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

    @property
    def unit(self) -> float:
        """Of frequencies, in rad/s."""
        return UNITS[self.per]

    @property
    def symbol(self) -> str:
        return "f" if self.per == "Hz" else "ω"


def draw_noise(outcome: NoiseOutcome, source: Path, shown: Convention, folder: Path) -> None:
    """noise.png and .pdf: what was measured with its 95 % interval, what was fitted, the frequencies that matter."""
    fit, noise_in = outcome.fit, outcome.wanted.noise_in
    spectrum, words = fit.spectrum, SIGNALS[noise_in].words
    paths = [folder / f"noise.{ending}" for ending in ("png", "pdf")]
    factor, x = shown.factor, spectrum.frequencies / shown.unit
    fine = np.geomspace(spectrum.frequencies[0], spectrum.frequencies[-1], 400)
    many = len(fit.parts)
    fitted = f"{fit.parts[0].kind} noise" if many == 1 else f"{many} {fit.parts[0].kind} noises"
    title = f"{source.name}: {SIGNALS[outcome.wanted.of].words}, fitted by {fitted}"
    density = factor * spectrum.density
    with figure_for(paths, title) as figure:
        axes = figure.subplots()
        if spectrum.relative_error is not None:
            freedom, tail = 2 / spectrum.relative_error**2, 0.5 * (1 - LEVEL)  # of the law of a mean of periodograms
            low, high = (density * freedom / chdtri(freedom, share) for share in (tail, 1 - tail))
            axes.fill_between(x, low, high, color="0.75", linewidth=0, label=f"{LEVEL:.0%} interval")
        axes.loglog(x, density, ".", color="0.35", label="formula" if spectrum.is_formula else "measured")
        values, _ = density_of(fit, fine.tolist())
        axes.loglog(fine / shown.unit, factor * values, label="fitted")
        for each in fit.misfit:
            place = each.omega / shown.unit or x[0]
            axes.axvline(place, color="C1", linestyle="--")
            name = each.name.replace("ω", shown.symbol) if each.omega else "← 0"
            corner = axes.get_xaxis_transform()
            axes.text(place, 0.99, f" {name}", transform=corner, va="top", color="C1", fontsize="small")
        axes.plot([], [], "--", color="C1", label="what stability depends on")
        axes.set(xlim=(0.9 * x[0], x[-1] / 0.9), ylim=(0.3 * np.nanmin(density), 3 * np.nanmax(density)))
        for axis in (axes.xaxis, axes.yaxis):
            plain_numbers(axis)
        frequency = {"long_name": "frequency", "symbol": f"${shown.symbol}$", "units": shown.per}
        about = {"long_name": f"{shown.sided}-sided density of {words}", "symbol": f"$G({shown.symbol})$"}
        per = "Hz" if shown.per == "Hz" else "(rad/s)"
        unit = f"1/{per}" if noise_in == "stiffness" else f"1/s^2/{per}"
        label_axes(axes, frequency, about | {"units": unit})


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
    remark = f"S of the {SIGNALS[noise_in].words}, two-sided, in {unit}; G = {shown.factor:.4g} S as in the figure"
    title = f"{source.name}: where stability depends on the noise"
    grid = Grid(title, [*map(Column, headings), Column("± s.e.", 1)], remark=remark)
    values, errors = density_of(fit, [each.omega for each in fit.misfit])
    for each, value, error in zip(fit.misfit, values.tolist(), errors.tolist(), strict=True):
        name, frequency = each.name.replace("ω", shown.symbol), f"{each.omega / shown.unit:.4g}"
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
            is_one = len(outcome.wanted.modes.omega) == 1
            remedy = "an oscillator state its damping by --damping-ratio."
            of_two = "two modes state their case by --case; `fpsolve new coupled` copies one."
            yield f"For λ and Λ(2) of {remedy if is_one else of_two}"
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


def _percent(each: Critical) -> str:
    """A damping ratio in percent with two digits of its error."""
    value, error = (100 * number for number in each)
    return f"({sampled(value, error)} ± {error:.1g}) %" if error else f"{value:.4g} %"
