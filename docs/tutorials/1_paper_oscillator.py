r"""
1. A first oscillator
=====================

A mass on a spring hits a wall at :math:`x = 0` and loses a share of its speed. Noise acts on its damping:

.. math::

   \ddot x + \omega^2 x - \varepsilon^2 c_1 \dot x = \varepsilon\,\xi(t)\,\dot x \quad (x > 0),
   \qquad \dot x_+ = -R\,\dot x_- \quad (x = 0).

The damping :math:`c_1 > 0` feeds energy in, and each impact takes energy out. Does the motion grow or decay? That
depends on which average you look at. This tutorial computes all of them.
"""

import matplotlib.pyplot as plt
import numpy as np

from fpsolve import (
    MomentLyapunovFunction,
    NonGaussianNoise,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    moment_lyapunov,
    stability_index,
    tilted_density,
)

# %%
# State the system and the noise
# ------------------------------
# ``epsilon`` scales the noise. Its square scales the damping and the loss at the wall. ``omega`` is in rad/time, ``c1``
# and ``D0`` are in 1/time, ``tau0`` is in time.
oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95)
problem = Problem(oscillator, noise)

# %%
# One moment
# ----------
# The mean of :math:`\|x\|^p` grows like :math:`e^{\Lambda(p) t}`. Here is the second moment. Every number comes with an
# estimate of its error.
second = moment_lyapunov(problem, 2.0)
print(second.value[0], "+-", second.error_estimate[0])

# %%
# It is positive: the mean square grows. Almost every single path grows or decays by the largest Lyapunov exponent,
# :math:`\lambda = \Lambda'(0)`.
print("lambda =", lyapunov_exponent(problem))

# %%
# The noise has two treatments. ``noise`` is the bounded noise of Eq. (7). ``noise.ou_reduction()`` is the
# Ornstein-Uhlenbeck noise that the paper puts in its place, Eqs. (12)-(15). This is the error of the reduction:
reduced = moment_lyapunov(Problem(oscillator, noise.ou_reduction()), 2.0)
print(f"{reduced.value[0]:.10f} reduced, {second.value[0]:.10f} exact")
print(f"the reduction is off by {(reduced.value[0] / second.value[0] - 1):.1%}")

# %%
# All moments
# -----------
# :math:`\Lambda` is a convex function of :math:`p` with :math:`\Lambda(0) = 0`. ``MomentLyapunovFunction`` makes it a
# Python function. This takes four solves, however many points you evaluate.
exponent = MomentLyapunovFunction(problem, (-2.0, 6.0))
p = np.linspace(-2, 6, 201)
figure, axes = plt.subplots(layout="constrained")
axes.plot(p, exponent(p))
axes.axhline(0, color="0.6", linewidth=0.8)
axes.set(xlabel="$p$", ylabel=r"$\Lambda(p)$ in 1/time", title="Moment Lyapunov exponent")

# %%
# The other zero is the stability index :math:`\delta_p`. It is negative here, as :math:`\lambda > 0`: almost every
# path grows, and only moments of an order between :math:`\delta_p` and 0 decay.
print("delta_p =", stability_index(problem))

# %%
# The paths that carry the second moment
# --------------------------------------
# Few paths carry a moment. The tilted density is the density of phase and noise on these paths. For :math:`p = 2` the
# mean of the noise on them is positive, although its stationary mean is zero:
density = tilted_density(second.pairs[0])
print("mean of the noise on these paths:", density.mean(lambda phi, xi: xi))
density.plot(cmap="magma")

# %%
# ``fpsolve.explore(problem)`` shows a slider for every parameter, see :doc:`/guide/explore`.
#
# Next: :doc:`your own equation <2_own_equation>`. The page :doc:`/guide/meaning` explains the signs for a structure.
