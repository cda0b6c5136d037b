"""A fitted noise in words, tables and a picture."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.special import chdtri

from fpsolve.analysis.spreads import LEVEL
from fpsolve.drawing import figure_for, label_axes, plain_numbers
from fpsolve.measured.signals import SIGNALS
from fpsolve.measured.spectrum import UNITS
from fpsolve.results.noise import DENSITY_UNITS, remedy
from fpsolve.solve.noise import NoiseOutcome, Number
from fpsolve.tell.blocks import Block, Column, Grid, Sentence, filled
from fpsolve.tell.notes import note_on
from fpsolve.tell.text import likely, sampled

SYMBOLS = {"Hz": "f", "rad/s": "ω"}
"""Of frequencies, by their unit."""


def draw_noise(outcome: NoiseOutcome, source: Path, per: str, folder: Path) -> None:
    """noise.png and .pdf: what was measured with its 95 % interval, what was fitted, the frequencies that matter."""
    fit, noise_in = outcome.fit, outcome.wanted.noise_in
    spectrum, words = fit.spectrum, SIGNALS[noise_in].words
    paths = [folder / f"noise.{ending}" for ending in ("png", "pdf")]
    unit, x = UNITS[per], spectrum.frequencies / UNITS[per]
    fine = np.geomspace(spectrum.frequencies[0], spectrum.frequencies[-1], 400)
    kinds = " and ".join(each.kind for each in fit.parts)
    title = f"{source.name}: {SIGNALS[outcome.wanted.of].words}, fitted by {kinds} noise"
    with figure_for(paths, title) as figure:
        axes = figure.subplots()
        if spectrum.relative_error is not None:
            freedom, tail = 2 / spectrum.relative_error**2, 0.5 * (1 - LEVEL)  # of the law of a mean of periodograms
            low, high = (spectrum.density * freedom / chdtri(freedom, share) for share in (tail, 1 - tail))
            axes.fill_between(x, low, high, color="0.75", linewidth=0, label=f"{LEVEL:.0%} interval")
        axes.loglog(x, spectrum.density, ".", color="0.35", label="formula" if spectrum.is_formula else "measured")
        axes.loglog(fine / unit, [fit.spectral_density(each) for each in fine], label="fitted")
        for each in outcome.densities:
            place = each.omega / unit or x[0]
            axes.axvline(place, color="C1", linestyle="--")
            name = each.name.replace("ω", SYMBOLS[per]) if each.omega else "← 0"
            corner = axes.get_xaxis_transform()
            axes.text(place, 0.99, f" {name}", transform=corner, va="top", color="C1", fontsize="small")
        axes.plot([], [], "--", color="C1", label="what stability depends on")
        axes.set(xlim=(0.9 * x[0], x[-1] / 0.9), ylim=(0.3 * spectrum.density.min(), 3 * spectrum.density.max()))
        plain_numbers(axes.xaxis)
        plain_numbers(axes.yaxis)
        frequency = {"long_name": "frequency", "symbol": f"${SYMBOLS[per]}$", "units": per}
        about = {"long_name": f"two-sided density of {words}", "symbol": "$S$", "units": DENSITY_UNITS[noise_in]}
        label_axes(axes, frequency, about)


def show(outcome: NoiseOutcome, source: Path, per: str) -> Iterator[Block]:
    """What was read, the fit where it matters, its meaning, and what limits it."""
    read = f"{source.name}: {outcome.data.read}\n" if outcome.data.read else ""
    yield density_grid(outcome, read, per)
    yield from map(Sentence, sentences(outcome))
    yield from (note_on(source.name, message) for message in outcome.messages)


def density_grid(outcome: NoiseOutcome, read: str, per: str) -> Grid:
    """A row for each frequency that matters, below what was read."""
    noise_in, is_formula = outcome.wanted.noise_in, outcome.fit.spectrum.is_formula
    about = f"{SIGNALS[noise_in].words} in {DENSITY_UNITS[noise_in]}"
    title = f"{read}Density S of the {about}, where stability depends on it"
    found = "formula" if is_formula else "measured"
    headings = "", f"{SYMBOLS[per]} ({per})", found, "± s.e.", "fitted", "± s.e.", f"{found} / fitted"
    rows = list[list[str]]()
    for each in outcome.densities:
        row = [each.name.replace("ω", SYMBOLS[per]), f"{each.omega / UNITS[per]:.4g}"]
        for number in (each.measured, each.fitted):
            row += f"{number[0]:.4g}" if number else "", f"{number[1]:.2g}" if number and not is_formula else ""
        rows.append([*row, f"{each.measured[0] / each.fitted[0]:.4g}" if each.measured else ""])
    return filled(title, [*map(Column, headings)], rows, "S is two-sided; a one-sided density per Hz is 2 S")


def sentences(outcome: NoiseOutcome) -> Iterator[str]:
    """What the fit means: critical damping ratios, and λ and Λ(2) of the system with their probabilities."""
    if outcome.exponent and outcome.moment:
        exponent, moment = _percent(outcome.exponent), _percent(outcome.moment)
        yield f"Damping needed in weak noise without walls, for λ < 0: {exponent} of critical, for Λ(2) < 0: {moment}."
    if outcome.system is None:
        one = "an oscillator state its damping by --damping-ratio."
        two = "two modes state their case by --case; `fpsolve new coupled` copies one."
        yield f"For λ and Λ(2) of {two if outcome.wanted.modes.second else one}"
    if outcome.verdict is None:
        return
    is_formula = outcome.fit.spectrum.is_formula
    for symbol, each, what in (
        ("λ", outcome.verdict.exponent, "almost every path"),
        ("Λ(2)", outcome.verdict.moment, "the mean square"),
    ):
        if each is not None:
            number, error = sampled(each.value, each.deviation), "" if is_formula else f" ± {each.deviation:.1g}"
            fate = likely(what, each.below).partition(" with" if is_formula else "\n")[0]
            if not each.is_decided:
                fate = f"not decided{'' if is_formula else f', {fate}'}; {remedy(outcome, each)}"
            yield f"{symbol} = {number}{error} 1/s: {fate}."
    if not is_formula:
        yield "The probabilities count the errors of the noise, not of frequency and damping."


def _percent(each: Number) -> str:
    """A damping ratio in percent with two digits of its error."""
    value, error = (100 * number for number in each)
    return f"({sampled(value, error)} ± {error:.1g}) %" if error else f"{value:.4g} %"
