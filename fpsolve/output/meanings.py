"""What a problem and its numbers say, in words: the equation with its numbers, and what λ, Λ(p) and δ_p mean."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fpsolve.analysis.regions import Region
from fpsolve.analysis.zero import Zero
from fpsolve.arrays import FloatArray
from fpsolve.exponent.error import Estimate, digits
from fpsolve.exponent.quantities import CRITICAL_IMPACT_FACTOR, IMPACT_RATE
from fpsolve.model.plane import affine
from fpsolve.model.problem import Problem
from fpsolve.output.terminal import sampled
from fpsolve.study.results import CurveResult, SimulatedCurve

DIGITS = 7
SURE = 3
"""Standard errors from 0 at which a simulated sign is told."""
_NAMES = {"varepsilon": "ε", "varphi": "φ", "partial": "∂", "ln": "ln", "dot": "", "rm": "", "mathrm": "", "infty": "∞"}
_PARTS = re.compile(r"([_^])(?:\{([^{}]*)\}|(\\[A-Za-z]+|.))|\\([A-Za-z]+) ?|([^_^\\{}]+)|.", re.DOTALL)


class Part(NamedTuple):
    """A piece of a symbol, and where it stands: "" on the line, "_" below, "^" above."""

    text: str
    place: str = ""


def parts_of(latex: str) -> list[Part]:
    r"""A symbol in LaTeX in pieces without commands: r"$\tau_0$" as τ and 0 below it."""
    found = list[Part]()
    for place, group, letter, command, text in _PARTS.findall(latex.strip("$")):
        if place:
            found.append(Part("".join(part.text for part in parts_of(group or letter)), place))
        elif command or text:
            found.append(Part(_letter(command) if command else text))
    return found


def _letter(command: str) -> str:
    """A Greek letter, or what else a command of LaTeX stands for; its name where that is not known."""
    if command in _NAMES:
        return _NAMES[command]
    size = "CAPITAL" if command[0].isupper() else "SMALL"
    try:
        return unicodedata.lookup(f"GREEK {size} LETTER {command.upper().replace('LAMBDA', 'LAMDA')}")
    except KeyError:
        return command


def equations_of(problem: Problem) -> list[str]:
    """The motion with its numbers: of the second order where x₂ is a multiple of ẋ₁, else the rates; and its walls."""
    system, named = problem.system, len(problem.system.noise_sections) > 1
    n = problem.dimension
    still, driven = np.zeros((n, n)), dict[str, FloatArray]()
    for term in system.terms:
        line, size = affine(term.g), system.epsilon**term.order * np.array(term.matrix)
        letter = f"ξ_{term.noise}" if named and term.noise else "ξ"
        offset, slope = (0.0, 1.0) if line is None else line
        still += offset * size
        if slope:
            name = letter if line else f"g({letter})"
            driven[name] = driven.get(name, np.zeros((n, n))) + slope * size
    speed = float(still[0, 1])
    cubic = np.array(system.cubic.matrix) if system.cubic else np.zeros((n, 4))
    first = [still[0, 0], *cubic[0], *(each for matrix in driven.values() for each in matrix[0])]
    rows: list[tuple[str, FloatArray, FloatArray, dict[str, FloatArray], Sequence[str]]]
    names = problem.system.states
    x = names[0].removesuffix("₁")
    if n == 2 and speed != 0 and not any(first) and len(x) == 1:
        scale, names = np.array([speed, 1.0]), (x, _dotted(x, 1))
        bent = cubic[1] * speed ** np.array([1, 0, -1, -2])
        by_noise = {name: each[1] * scale for name, each in driven.items()}
        rows = [(_dotted(x, 2), still[1] * scale, bent, by_noise, names)]
    else:
        each = [{key: matrix[i] for key, matrix in driven.items()} for i in range(n)]
        rows = [(f"d{names[i]}/dt", still[i], cubic[i], each[i], names) for i in range(n)]
    lines = [f"{row[0]} = {_sum(*row[1:])}" for row in rows]
    for jump in system.jumps:
        factor = f"{math.exp(jump.log_factor):.10g}"
        at_wall = math.isclose(math.cos(jump.phase), 0.0, abs_tol=1e-12)
        words = (
            f"|{names[1]}|⁺ = {factor} |{names[1]}|⁻ at {names[0]} = 0"
            if at_wall
            else f"‖x‖⁺ = {factor} ‖x‖⁻ at φ = {jump.phase:.6g} and φ + π"
        )
        lines += [words] if jump.log_factor or not at_wall else []
    return lines


def _dotted(letter: str, count: int) -> str:
    """A derivative by time."""
    return unicodedata.normalize("NFC", letter + "\u0307\u0308"[count - 1])


def _sum(constant: FloatArray, cubic: FloatArray, by_noise: Mapping[str, FloatArray], states: Sequence[str]) -> str:
    """A sum of multiples of states, the constant ones first: "−x + 0.001 ẋ − 0.2 x² ẋ + 0.1 ξ ẋ"."""
    x, y = states[:2]
    products = f"{x}³", f"{x}² {y}", f"{x} {y}²", f"{y}³"
    terms = [(float(size), state) for size, state in zip(constant, states, strict=True)]
    terms += [(float(size), product) for size, product in zip(cubic, products, strict=True)]
    terms += [
        (float(size), f"{name} {s}") for name, row in by_noise.items() for size, s in zip(row, states, strict=True)
    ]
    text = "".join(
        f" {'−' if size < 0 else '+'} {'' if abs(size) == 1 else f'{abs(size):.10g} '}{name}"
        for size, name in terms
        if size
    )
    return re.sub(r"^ \+ |^ (?=−)", "", text).replace("− ", "−", text.startswith(" −")) or "0"


def noises_of(problem: Problem) -> list[str]:
    """Each noise in a sentence: its kind, and how strong and how slow it is."""
    lines = list[str]()
    for section, noise in zip(problem.system.noise_sections, problem.noise.parts.values(), strict=True):
        size, time = noise.standard_deviation, noise.correlation_time
        numbers = [f"standard deviation {size:.6g}"] if 0 < size < math.inf else []
        numbers += [f"correlation time {time:.6g}"] if 0 < time < math.inf else []
        name = f"ξ of [{section}]" if len(problem.noise.parts) > 1 else "ξ"
        lines.append(f"{name} is noise of the kind {noise.kind}{', with ' if numbers else ''}{' and '.join(numbers)}.")
        lines[-1] += f" The equation is meant in {noise.sense} sense." if noise.sense else ""
    return lines


def meanings(result: CurveResult, time_unit: str) -> Iterator[str]:
    """What λ, Λ(2), δ_p, N and R_c of a curve say, for each that is there."""
    exponent, index = result.lyapunov_exponent, result.stability_index
    rate, critical = (result.estimates[each.name] for each in (IMPACT_RATE, CRITICAL_IMPACT_FACTOR))
    path = 0.0 if exponent is None else _sign(exponent.value, exponent.error_estimate)
    if exponent is not None:
        yield f"λ = {_shown(exponent)}{_fate('almost every path', exponent.value, path, time_unit)}"
    found = result.moments
    for p, value, error in zip(found.p.tolist(), found.value.tolist(), found.error_estimate.tolist(), strict=True):
        if p == 2:
            sign = _sign(value, error)
            yield f"Λ(2) = {digits(value, error, DIGITS)}{_fate('the mean square', value, sign, time_unit)}"
            if sign > 0 > path:
                yield (
                    "Paths decay but their mean square grows: bursts of rare paths carry it. A design that is judged "
                    "by the mean square, by energy or by fatigue is unstable, though one record most likely looks calm."
                )
    size = "" if index is None else f"{abs(index.value):.3g}"
    if index is not None and index.value > 0:
        yield (
            f"δ_p = {_shown(index)} > 0: moments of the orders 0 < p < δ_p decay, those of p > δ_p grow. The "
            f"probability that a path ever exceeds A times its start falls as A to the power −{size}."
        )
    elif index is not None:
        yield (
            f"δ_p = {_shown(index)} < 0: moments of the orders δ_p < p < 0 decay, as almost every path grows. The "
            f"probability that a path ever falls below a small share a of its start goes as a to the power {size}."
        )
    if rate is not None and rate.value > 0:
        yield f"N = {_shown(rate)}: the mean number of impacts in a unit of time."
    if critical is not None:
        loss = "more loss" if critical.value < 1 else "any loss"
        yield (
            f"R_c = {_shown(critical)}: with this factor of the speed at an impact λ would be 0; {loss} makes almost "
            "every path decay."
        )


def simulated_meanings(simulated: SimulatedCurve, time_unit: str) -> Iterator[str]:
    """What λ of a simulation says."""
    value, error = simulated.result.lyapunov_exponent, simulated.result.lyapunov_exponent_error
    sign = _sign(value, SURE * error)
    yield f"λ = {sampled(value, error)} ± {error:.1e}{_fate('almost every path', value, sign, time_unit)}"


def region_meaning(region: Region, zeros: Iterable[Zero]) -> str:
    """What becomes in a region of a chart: "Almost every path decays and the mean square grows."."""
    told, signs = list[str](), set[int]()
    for zero in sorted(zeros, key=lambda each: (each.kind == "moment", each.p)):
        sign = region.signs.get(zero.name, 0)
        if sign and zero.kind in ("lyapunov_exponent", "moment"):
            what = (
                "almost every path"
                if zero.kind != "moment"
                else "the mean square"
                if zero.p == 2
                else f"E‖x‖^{zero.p:g}"
            )
            told.append(f"{what} {'grows' if sign > 0 else 'decays'}")
            signs.add(sign)
    carried = ", which rare paths carry" if len(signs) == 2 and told[0].endswith("path decays") else ""
    text = " and ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)
    return f" {text[0].upper()}{text[1:]}{carried}." if told else ""


def _shown(estimate: Estimate) -> str:
    return digits(estimate.value, estimate.error_estimate, DIGITS)


def _sign(value: float, error: float) -> float:
    """−1 or 1; 0 where the error leaves it open."""
    return math.copysign(1, value) if abs(value) > error else 0.0


def _fate(what: str, rate: float, sign: float, time_unit: str) -> str:
    """What becomes of something, and in which time."""
    if not sign:
        return f" cannot be distinguished from 0 within its error: {what} is at the border of stability, or near it."
    time = f"in a time of {math.log(2) / abs(rate):.3g}" + ("" if time_unit == "time" else f" {time_unit}")
    return f" > 0: {what} grows, doubling {time}." if sign > 0 else f" < 0: {what} decays, halving {time}."
