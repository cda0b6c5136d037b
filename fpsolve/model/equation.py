"""A motion and its noises in words, as reports show them: "ẍ = −x − 0.2 ẋ − ξ x"."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.noises.clock import Wave
from fpsolve.model.plane import STEADY, Function, System, written_sum


def equations_of(system: System) -> list[str]:
    """The motion with its numbers: of the second order where x₂ is a multiple of ẋ₁, else the rates; and its walls.

    >>> from fpsolve import VibroImpactOscillator
    >>> equations_of(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1))
    ['ẍ = −x + 0.001 ẋ + 0.1 ξ ẋ', '|ẋ|⁺ = 0.9980019987 |ẋ|⁻ at x = 0']
    """
    linear, named = system.linear(), len(system.noise_sections) > 1
    whole, states = linear.forced or linear, linear.states
    n = whole.dimension
    sums, driven = whole.by_noise(), dict[str, FloatArray]()
    still = sums.pop(STEADY)
    for (noise, g), matrix in sums.items():
        letter, wave = f"ξ_{noise}" if named and noise else "ξ", g.f if isinstance(g, Function) else None
        name = letter if wave is None else wave.at(linear.clock.nu) if isinstance(wave, Wave) else f"g({letter})"
        driven[name] = driven.get(name, 0.0) + matrix
    cubic = np.array(linear.cubic.matrix) if linear.cubic else np.zeros((n, 4))
    names = linear.columns or states

    def rate(i: int, names: Sequence[str], speed: float = 1.0) -> str:
        """That of a variable, what is constant first: "−x + 0.001 ẋ − 0.2 x² ẋ + 0.1 ξ ẋ"; of x₂ over a speed."""
        (x, y), scale = names[:2], np.append(speed, np.ones(len(names) - 1))
        bent = cubic[i] * speed ** np.array([1.0, 0.0, -1.0, -2.0])
        terms = [*zip(still[i] * scale, names, strict=True)]
        terms += zip(bent, (f"{x}³", f"{x}² {y}", f"{x} {y}²", f"{y}³"), strict=True)
        for name, matrix in driven.items():
            terms += zip(matrix[i] * scale, [f"{name} {each}".rstrip() for each in names], strict=True)
        return written_sum(terms)

    speed, x = float(still[0, 1]), names[0].removesuffix("₁")
    first = [still[0, 0], *cubic[0], *(each for matrix in driven.values() for each in matrix[0])]
    if n == 2 and speed != 0 and not any(first) and len(x) == 1:
        names = x, _dotted(x, 1)
        told = [f"{_dotted(x, 2)} = {rate(1, names, speed)}"]
    else:
        told = [f"d{name}/dt = {rate(i, names)}" for i, name in enumerate(states)]
    return told + [line for wall in linear.barriers for line in wall.told(names)]


def _dotted(letter: str, count: int) -> str:
    """A derivative by time."""
    return unicodedata.normalize("NFC", letter + "\u0307\u0308"[count - 1])
