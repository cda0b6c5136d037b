"""A noise that was fitted to a measurement: the fit where it matters, and what it means."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fpsolve.measured.fit import NAMES
from fpsolve.output.noises import SIGNAL_WORDS, Convention
from fpsolve.page.page import Block, Column, Grid, Sentence
from fpsolve.show.notes import note_on
from fpsolve.show.text import percent, sampled
from fpsolve.study.noise import Critical, NoiseOutcome, density_of


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
