"""The figure of delays in the documentation: lobes of a tool that turns, and a delayed Mathieu equation under noise.

`python docs/lobes.py [file]` draws it. The dashed lobes are those without noise: at the limit x = e^(iΩt) solves
ẍ + 2ζẋ + x = −w(x − x(t − τ)), so that w = ((Ω² − 1)² + 4ζ²Ω²)/(2(Ω² − 1)) and Ωτ = 2(kπ − arctan((Ω² − 1)/(2ζΩ))).
"""

import math
import sys

import numpy as np

from fpsolve import Problem, load_case, moment_lyapunov
from fpsolve.analysis import Axis, boundary
from fpsolve.model import EquationSystem, White

MATHIEU = (
    "v",
    "-0.1*v - (1 + a*cos(2*pi*t))*x + 0.4*(1 + 0.3*cos(2*pi*t))*x(t - 1) + 0.45*(1 + 0.4*cos(2*pi*t))*v(t - 1)"
    " + w*(0.5*x + 0.35*x(t - 1))",
)


def lobe(number: int, zeta: float = 0.05):
    """Speeds and widths of one lobe without noise."""
    omega = np.linspace(1.001, 3.0, 2000)
    over = omega**2 - 1
    tau = 2 * (number * math.pi - np.arctan2(over, 2 * zeta * omega)) / omega
    return 2 * math.pi / tau, (over**2 + (2 * zeta * omega) ** 2) / (2 * over)


def draw(file: str) -> None:
    """The figure."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained", dpi=110)
    turning = next(iter(load_case("cases/systems/chatter.toml").sets())).problem
    axes = Axis("system.speed", 0.45, 2.0), Axis("system.w", 0.02, 0.7)
    for colour, s in zip(("#0072B2", "#D55E00"), (0.5, 1.0), strict=True):
        line = boundary(turning.at({"noise.s": s}), "moment(2) = 0", *axes)
        for branch in line.branches:
            left.plot(*branch.path, color=colour, label=rf"$\Lambda(2) = 0$, $s = {s:g}$")
    for number in range(1, 5):
        left.plot(*lobe(number), "--", color="0.35", label="without noise" if number == 1 else None)
    left.set(title="Lobes of a tool: the cut is stable below", xlim=(0.45, 2.0), ylim=(0.0, 0.7))
    left.set(xlabel="turns in a period of the tool", ylabel="width of the cut $w$")
    left.legend(frameon=False)
    amplitudes = np.linspace(0.0, 4.0, 33)
    for colour, s in zip(("#0072B2", "#D55E00"), (0.5, 1.0), strict=True):
        noise = White(s=s, interpretation="ito")
        found = [
            moment_lyapunov(
                Problem(EquationSystem(("x", "v"), MATHIEU, (("a", a),), (("w", "noise"),)), noise), 2.0
            ).value[0]
            for a in amplitudes
        ]
        right.plot(amplitudes, found, color=colour, label=f"$s = {s:g}$")
    right.axhline(0.0, color="0.7", linewidth=0.8)
    right.set(
        title="Growth of a delayed Mathieu equation",
        xlabel="amplitude $a$ of the load",
        ylabel=r"$\Lambda(2)$ (1/time)",
    )
    right.legend(frameon=False)
    figure.savefig(file)


if __name__ == "__main__":
    draw(sys.argv[1] if len(sys.argv) > 1 else "lobes.png")
