"""A motion and its noises in words, as reports show them: "ẍ = −x − 0.2 ẋ − ξ x"."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping, Sequence

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.noises.clock import Wave
from fpsolve.model.plane import STEADY, Function, System, by_noise, written_sum


def equations_of(system: System) -> list[str]:
    """The motion with its numbers: of the second order where x₂ is a multiple of ẋ₁, else the rates; and its walls.

    >>> from fpsolve import VibroImpactOscillator
    >>> equations_of(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1))
    ['ẍ = −x + 0.001 ẋ + 0.1 ξ ẋ', '|ẋ|⁺ = 0.9980019987 |ẋ|⁻ at x = 0']
    """
    whole, named = system.forced or system, len(system.noise_sections) > 1
    n = whole.dimension
    sums, driven = by_noise(whole, whole.terms), dict[str, FloatArray]()
    still = sums.pop(STEADY)
    for (noise, g), matrix in sums.items():
        letter, wave = f"ξ_{noise}" if named and noise else "ξ", g.f if isinstance(g, Function) else None
        name = letter if wave is None else wave.at(system.clock.nu) if isinstance(wave, Wave) else f"g({letter})"
        driven[name] = driven.get(name, 0.0) + matrix
    speed = float(still[0, 1])
    cubic = np.array(system.cubic.matrix) if system.cubic else np.zeros((n, 4))
    first = [still[0, 0], *cubic[0], *(each for matrix in driven.values() for each in matrix[0])]
    rows: list[tuple[str, FloatArray, FloatArray, dict[str, FloatArray], Sequence[str]]]
    rates, names = len(system.states), system.columns
    x = names[0].removesuffix("₁")
    if n == 2 and speed != 0 and not any(first) and len(x) == 1:
        scale, names = np.array([speed, 1.0]), (x, _dotted(x, 1))
        bent = cubic[1] * speed ** np.array([1, 0, -1, -2])
        by_name = {name: each[1] * scale for name, each in driven.items()}
        rows = [(_dotted(x, 2), still[1] * scale, bent, by_name, names)]
    else:
        each = [{key: matrix[i] for key, matrix in driven.items()} for i in range(rates)]
        rows = [(f"d{names[i]}/dt", still[i], cubic[i], each[i], names) for i in range(rates)]
    told = [f"{row[0]} = {_sum(*row[1:])}" for row in rows]
    return told + [line for wall in system.barriers for line in wall.told(names)]


def _dotted(letter: str, count: int) -> str:
    """A derivative by time."""
    return unicodedata.normalize("NFC", letter + "\u0307\u0308"[count - 1])


def _sum(constant: FloatArray, cubic: FloatArray, driven: Mapping[str, FloatArray], states: Sequence[str]) -> str:
    """A sum of multiples of states, the constant ones first: "−x + 0.001 ẋ − 0.2 x² ẋ + 0.1 ξ ẋ"."""
    x, y = states[:2]
    products = f"{x}³", f"{x}² {y}", f"{x} {y}²", f"{y}³"
    terms = [(float(size), state) for size, state in zip(constant, states, strict=True)]
    terms += [(float(size), product) for size, product in zip(cubic, products, strict=True)]
    terms += [
        (float(size), f"{name} {s}".rstrip())
        for name, row in driven.items()
        for size, s in zip(row, states, strict=True)
    ]
    return written_sum(terms)
