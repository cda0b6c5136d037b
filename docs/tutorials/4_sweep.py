r"""
4. A thousand parameter sets
============================

A sweep solves a case for many parameter sets. This tutorial makes a thousand of them from one case file, solves
them, and looks at the result with xarray.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import xarray as xr

import fpsolve

# %%
# A case with two varied keys
# ---------------------------
# ``[vary]`` with ``mode = "product"`` makes all combinations of 40 frequencies and 25 intensities. ``quantities`` names
# the numbers to compute, and fpsolve computes no others.
CASE = """
title = "A thousand oscillators"

[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1

[noise]
D0 = 0.1
tau0 = 0.5
r0 = 0.95
treatment = "ou-reduction"

[moments]
p = [2.0]

[vary]
mode = "product"
"oscillator.omega" = { start = 0.5, stop = 4.0, num = 40 }
"noise.D0" = { start = 0.05, stop = 2.0, num = 25, scale = "log" }

[output]
quantities = ["moment", "lyapunov_exponent"]
figure = false
"""
folder = Path(tempfile.mkdtemp())
(folder / "thousand.toml").write_text(CASE, encoding="utf-8")

# %%
# Solve
# -----
# ``jobs=None`` uses all processors. fpsolve writes each finished set at once: if you kill the process, the same line
# resumes it. The command is ``fpsolve run thousand.toml``.
results = fpsolve.run(folder / "thousand.toml", folder / "results", jobs=None)
print(len(results), "sets")

# %%
# Look at it
# ----------
# ``results.nc`` has labelled arrays. Reading it does not need fpsolve.
found = xr.load_dataset(folder / "results/thousand/results.nc")
print(found.sizes)
print(found.moment.attrs["long_name"], "in", found.moment.attrs["units"])

# %%
# Here is :math:`\Lambda(2)` over both keys, with the line on which it is zero:
moment = found.moment.sel(p=2.0)
figure, axes = plt.subplots(layout="constrained")
sides = {"x": "oscillator.omega", "y": "noise.D0", "ax": axes}
moment.plot.pcolormesh(**sides, cmap="RdBu_r", vmin=-0.03, vmax=0.03)
moment.plot.contour(**sides, levels=[0], colors="black")
axes.set(yscale="log", title=r"$\Lambda(2)$, and where it is zero")

# %%
# For how many of the sets does almost every path decay, but the mean square grow?
both = (found.lyapunov_exponent < 0) & (found.moment.sel(p=2.0) > 0)
print(int(both.sum()), "of", both.size)

# %%
# ``fpsolve.open_results("results/*")`` reads several runs as one table, see :doc:`/guide/sweeps`.
