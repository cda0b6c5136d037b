"""The files of a fitted noise: noise.json, noise.toml."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import tomlkit

from fpsolve import __version__
from fpsolve.case.rewrite import rewritten
from fpsolve.measured import NoiseFit, Record
from fpsolve.measured.fit import NAMES
from fpsolve.measured.signals import SIGNALS
from fpsolve.measured.stability import GrowthRate
from fpsolve.model import Noise
from fpsolve.model.systems.equations import EquationSystem
from fpsolve.results.csv_json import Content, sampled
from fpsolve.solve.noise import NoiseOutcome, Number

DENSITY_UNITS = {"stiffness": "s", "damping": "1/s"}
"""Of S, by where the noise is."""


def noise_sections(outcome: NoiseOutcome) -> str:
    """[noise] as a case file has it, with standard errors as remarks; of a sum [noise.first] and so on."""
    wanted, fit = outcome.wanted, outcome.scaled
    sections = wanted.case.system.noise_sections if wanted.case else ("noise",)
    if len(fit.parts) > 1:
        sections = tuple(f"noise.{name}" for name in NAMES)
    told = {"1/time²": "ω² times the relative stiffness, in 1/s²", "1/time": "the damping, in 1/s"}
    about = told.get(wanted.noise_unit, f"the {SIGNALS[wanted.noise_in].words}")
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
    wanted, system, sections = outcome.wanted, outcome.system, noise_sections(outcome)
    if system is None:
        return ""
    old, gone, table = wanted.case and wanted.case.system, ["noise", "expect"], dict[str, object]()
    if wanted.terms > 1 and isinstance(system, EquationSystem):
        table = {"variables": [*system.variables], "drift": [*system.drift], "noises": dict(system.noises)}
        if not isinstance(old, EquationSystem):  # else all other keys are there, with their symbols
            table |= {"parameters": dict(system.named), "walls": [dict(each) for each in system.walls]}
            gone += ["oscillator", "system"]
    if wanted.case:
        others = {f"system.{key}": each for key, each in table.items()}
        text = rewritten(wanted.case, folder, without=gone, others=others, more=sections)
        keys = "|".join(wanted.case.system.values)
        return re.sub(rf"\boscillator\.(?=({keys})\b)", "system.", text) if table else text
    omega, zeta = wanted.modes.omega[0], wanted.modes.zeta
    hertz = f"{omega / (2 * math.pi):.4g} Hz, {zeta:.4g} of critical damping"
    data = {
        "title": f"Oscillator with noise in its {wanted.noise_in}: {hertz}",
        system.section: table or {"kind": system.kind, **system.values},
        "units": {"time": "s"},
        "moments": {"p": {"start": -2.0, "stop": 4.0, "num": 25}},
    }
    return tomlkit.dumps(data) + sections


def remedy(outcome: NoiseOutcome, rate: GrowthRate) -> str:
    """What to do that the sign of λ or Λ(2) is decided, where it is not."""
    if rate.numerical > max(rate.misfit, rate.scatter):
        return "state a smaller --rtol"
    if math.isinf(rate.times):
        more = " or --terms 2" if outcome.wanted.terms == 1 else ""
        return f"the fit is off where it matters, so that no more data but another --kind{more} helps"
    data, times = outcome.data, math.ceil(10 * rate.times) / 10
    if isinstance(data, Record):
        number, unit = data.duration, "s of record"
    elif data.relative_error is not None:
        number, unit = data.relative_error[0] ** -2, "averages"
    else:
        return f"state --averages; by the scatter of the values some {times:g} times as many are needed"
    return f"take some {float(f'{times * number:.2g}'):,g} {unit} in place of {number:,.4g}"


def summary(outcome: NoiseOutcome, source: Path) -> Content:
    """All numbers; null where one is not known."""
    wanted, fit, is_formula = outcome.wanted, outcome.fit, outcome.fit.spectrum.is_formula

    def numbers(each: NoiseFit) -> Content:
        known = {"errors": dict(each.errors), "covariance": each.covariance.tolist()}
        return {"parameters": dict(each.parameters)} | ({} if is_formula else known)

    def number(each: Number) -> Content:
        return sampled(each[0], None if is_formula else each[1])

    def rate(each: GrowthRate | None) -> Content | None:
        if each is None:
            return None
        todo = {"times_as_long": each.times if math.isfinite(each.times) else None, "what_to_do": remedy(outcome, each)}
        below = None if is_formula else each.below
        known = {
            "probability_below_0": below,
            "decided": each.is_decided,
            "to_decide": None if each.is_decided else todo,
        }
        return number((each.value, each.deviation)) | known

    return {
        "file": source.name,
        "read": outcome.data.read,
        "fpsolve_version": __version__,
        "of": wanted.of,
        "noise_in": wanted.noise_in,
        "kind": wanted.kind,
        "is_formula": is_formula,
        "units": {"time": "s"},
        "natural_frequencies": list(wanted.modes.omega),
        "fit": {"signal": SIGNALS[wanted.noise_in].words, **numbers(fit)},
        "noise": numbers(outcome.scaled),
        "frequencies": [
            {
                "name": each.name,
                "omega": each.omega,
                "measured_density": each.measured and number(each.measured),
                "fitted_density": number(each.fitted),
                "measured_over_fitted": each.measured and each.measured[0] / each.fitted[0],
                "unit": DENSITY_UNITS[wanted.noise_in],
            }
            for each in outcome.densities
        ],
        "critical_damping_ratio": {
            "lyapunov_exponent": outcome.exponent and number(outcome.exponent),
            "moment": outcome.moment and number(outcome.moment),
        },
        "lyapunov_exponent": outcome.verdict and rate(outcome.verdict.exponent),
        "second_moment": outcome.verdict and rate(outcome.verdict.moment),
        "warnings": [*outcome.messages],
    }
