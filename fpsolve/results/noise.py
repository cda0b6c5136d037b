"""The files of a fitted noise: noise.json, noise.toml."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import tomlkit

from fpsolve import __version__
from fpsolve.analysis.spreads import Spread
from fpsolve.case.rewrite import rewritten
from fpsolve.measured import NoiseFit
from fpsolve.measured.fit import NAMES
from fpsolve.measured.signals import SIGNALS
from fpsolve.model import Noise
from fpsolve.results.csv_json import Content, sampled
from fpsolve.solve.noise import NoiseOutcome, density_of, oscillator_of


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
    about = told.get(unit, f"the {SIGNALS[wanted.noise_in].words}")
    found = ""
    for name, section, noise in zip(NAMES, sections, fit.parts, strict=False):
        found += f"\n{f'[{section}]':34}  # {about}\n" + "".join(f"{line}\n" for line in _lines(noise, fit, name))
    return found


def _lines(noise: Noise, fit: NoiseFit, part: str) -> Iterator[str]:
    yield f'kind = "{noise.kind}"'
    yield from (f'{name} = "{word}"' for name, word in noise.words.items())
    errors, prefix = fit.errors, f"{part}." * (len(fit.parts) > 1)
    values = {name: each for name, each in noise.values.items() if not isinstance(each, str)}
    is_filter = noise.kind == "filter"
    for name in ("omega", "zeta", "s") if is_filter else values:
        error = errors.get(prefix + name)
        text = f"{name} = {_number(values[name], error or 0.0)}"
        yield f"{text:34}  # ± {error:.2g}" if error else text
    if is_filter:
        error = errors.get(f"{prefix}c1")
        remark = "c0 and c1 of ξ = c0 y + c1 y′" + (f", c1 ± {error:.2g}" if error is not None else "")
        output = f"output = [{_number(values['c0'], 0.0)}, {_number(values['c1'], error or 0.0)}]"
        yield f"{output:34}  # {remark}"


def _number(value: float, error: float) -> str:
    """With four digits more than its error has, as TOML has it."""
    digits = 10 if not error else min(max(4 + math.ceil(math.log10(abs(value) / error)), 5), 12)
    text = f"{value:.{digits}g}"
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def case_of(outcome: NoiseOutcome, folder: Path) -> str:
    """The case with the noise, ready to run; empty where there is no system."""
    wanted, sections = outcome.wanted, noise_sections(outcome)
    omega, zeta = wanted.modes.omega[0], wanted.modes.zeta
    if wanted.case:
        return rewritten(wanted.case, folder, without=["noise", "expect"], more=sections)
    section, table = oscillator_of(wanted, len(outcome.fit.parts))
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


def summary(outcome: NoiseOutcome, source: Path) -> Content:
    """All numbers; null where one is not known."""
    wanted, fit, is_formula = outcome.wanted, outcome.fit, outcome.fit.spectrum.is_formula

    def numbers(each: NoiseFit) -> Content:
        known = {"parameters": dict(each.parameters), "errors": dict(each.errors)}
        return {**known, "covariance": each.covariance.tolist()}

    def spread(each: Spread | None) -> Content | None:
        if each is None:
            return None
        error, below = (None, None) if is_formula else (each.deviation, each.below)
        return {**sampled(each.value, error), "probability_below_0": below}

    densities, errors = density_of(fit, [each.omega for each in fit.misfit])
    return {
        "file": source.name,
        "fpsolve_version": __version__,
        "of": wanted.of,
        "noise_in": wanted.noise_in,
        "kind": wanted.kind,
        "units": {"time": "s"},
        "natural_frequencies": list(wanted.modes.omega),
        "fit": {"signal": SIGNALS[wanted.noise_in].words, **numbers(fit)},
        "noise": numbers(outcome.scaled),
        "frequencies": [
            {
                "name": each.name,
                "omega": each.omega,
                "density": density,
                "density_error": error,
                "measured_over_fitted": 1 + each.relative,
                "measured_over_fitted_error": each.error,
            }
            for each, density, error in zip(fit.misfit, densities.tolist(), errors.tolist(), strict=True)
        ],
        "critical_damping_ratio": {
            "lyapunov_exponent": outcome.exponent and sampled(*outcome.exponent),
            "moment": outcome.moment and sampled(*outcome.moment),
        },
        "lyapunov_exponent": outcome.verdict and spread(outcome.verdict.exponent),
        "second_moment": outcome.verdict and spread(outcome.verdict.moment),
        "warnings": [*fit.messages, *filter(None, [outcome.failure])],
    }
