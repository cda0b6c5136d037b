r"""
3. A chart of stability
=======================

A chart divides a plane of two parameters into regions. On its lines an exponent is zero. The example is white noise in
the stiffness, :math:`\ddot x + 2b\dot x + (1 + s\dot W)x = 0`. One of its lines is known exactly:
:math:`\Lambda(2) = 0` where :math:`s^2 = 4b`.
"""

import matplotlib.pyplot as plt
import numpy as np

from fpsolve import PlaneSystem, Problem, boundary, lyapunov_exponent, moment_lyapunov
from fpsolve.analysis import Axis
from fpsolve.model import White

# %%
# Two lines
# ---------
# ``boundary`` looks for a line on a grid and then follows it with its gradient. The lines here are simple: a coarse
# grid of 5 × 5 nodes is enough. The default is 13 × 13.
system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 2*b*v - xi*x"), {"b": 0.1})
problem = Problem(system, White(s=0.5))
frame = Axis("noise.s", 0.3, 1.2), Axis("system.b", 0.02, 0.3)
paths = boundary(problem, "lyapunov_exponent = 0", *frame, nodes=5)
square = boundary(problem, "moment(2) = 0", *frame, nodes=5)

# %%
# ``boundary`` solves every point to 1e-10 of the scale. So the line must agree with the known one:
branch = square.branches[0]
print("largest distance from s^2 = 4 b:", np.max(np.abs(branch.x**2 - 4 * branch.y)))
assert np.allclose(branch.x**2, 4 * branch.y, rtol=1e-7)

# %%
# What the regions mean
# ---------------------
figure, axes = plt.subplots(layout="constrained")
for line, name in ((paths, r"$\lambda = 0$"), (square, r"$\Lambda(2) = 0$")):
    for number, each in enumerate(line.branches):
        axes.plot(each.x, each.y, color="C0" if line is paths else "C1", label=name if number == 0 else None)
axes.set(xlabel="intensity $s$ of the noise", ylabel="damping $b$", xlim=(0.3, 1.2), ylim=(0.02, 0.3))
axes.text(0.4, 0.22, "all of it decays")
axes.text(1.03, 0.167, "almost every path decays,\nthe mean square grows", ha="center", va="center")
axes.text(1.08, 0.06, "almost every\npath grows", ha="center")
axes.legend(loc="lower right")

# %%
# The region between the two lines is dangerous. A test of a few specimens shows decay, but the mean square and the mean
# energy grow, by rare large excursions.
for s in (0.5, 0.8, 1.1):
    here = problem.at({"noise.s": s})
    paths, square = lyapunov_exponent(here).value, moment_lyapunov(here, 2.0).value[0]
    print(f"s = {s}: lambda = {paths:+.4f}, Lambda(2) = {square:+.4f}")

# %%
# On the command line ``fpsolve chart cases/systems/white_noise_chart.toml`` makes this chart. It also names and shades
# the regions, see :doc:`/guide/charts`. Next: :doc:`a thousand parameter sets <4_sweep>`.
