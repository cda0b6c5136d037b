r"""
2. Your own equation
====================

You can write any linear system of two variables in your own notation. Here a beam is loaded along its axis, with a stop
on one side:

.. math::

   \ddot x + 2\zeta\omega\dot x + (\omega^2 + \xi_1(t))\,x + \dot W\,s\,x = 0, \qquad \dot x_+ = -R\,\dot x_-
   \quad\text{at } x = 0.

The load :math:`\xi_1` is telegraph noise, which jumps between two values. The support shakes by white noise
:math:`\dot W`.
"""

import math

from fpsolve import PlaneSystem, Problem, lyapunov_exponent, moment_lyapunov, sensitivities, simulate
from fpsolve.model import CoefficientMatrix, Jump, Telegraph, White

# %%
# As equations
# ------------
# The rates of ``x`` and ``v`` are texts: linear in both, and affine in the noises.
drift = ("v", "-omega**2 * x - 2*zeta*omega * v - load * x - shake * x")
system = PlaneSystem.of_equations(
    ("x", "v"),
    drift,
    {"omega": 1.0, "zeta": 0.1},
    noises={"load": "noise.load", "shake": "noise.shake"},
)
loads = {"load": Telegraph(a=0.5, k=1.0), "shake": White(s=0.3)}
problem = Problem(system, loads)
print("Lambda(2) =", moment_lyapunov(problem, 2.0).value[0])

# %%
# Every parameter has a key. ``at`` makes the problem with other values, and ``sensitivities`` differentiates by all
# parameters.
print("with twice the damping:", moment_lyapunov(problem.at({"system.zeta": 0.2}), 2.0).value[0])
for key, slope in sensitivities(problem, 2.0).moments[0].items():
    print(f"d Lambda(2) / d {key}: {slope.value:.8f}")

# %%
# As matrices
# -----------
# Matrices can state the same system, :math:`\dot x = (A_0 + \xi_1 A_1 + \ldots)\,x`. A term has an order in
# :math:`\varepsilon`, a matrix, a function of the noise and the name of the noise. The two numbers must agree.
stiffness = ((0.0, 0.0), (-1.0, 0.0))


def identity(xi):
    """The noise enters as it is."""
    return xi


terms = [
    CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2))),
    CoefficientMatrix(1, stiffness, identity, "load"),
    CoefficientMatrix(1, stiffness, identity, "shake"),
]
by_matrices = Problem(PlaneSystem(terms), loads)
first, again = moment_lyapunov(problem, 2.0).value[0], moment_lyapunov(by_matrices, 2.0).value[0]
print(first, again)
assert math.isclose(first, again, rel_tol=1e-7)

# %%
# A wall
# ------
# A jump multiplies the state by :math:`R` where it crosses a ray. In the plane of :math:`x` and :math:`v` the wall
# :math:`x = 0` is the ray at :math:`\varphi = \pi/2`. ``Jump`` takes the phase of the ray and :math:`\ln R`. The wall
# takes energy out at every crossing.
wall = Jump(math.pi / 2, math.log(0.9))
walled = Problem(PlaneSystem(terms, [wall]), loads)
print("lambda without a wall:", lyapunov_exponent(by_matrices))
print("lambda with a wall:   ", lyapunov_exponent(walled))

# %%
# An independent check
# --------------------
# The simulation moves paths of the system itself. It shares no solver code with the finite elements. Compare the two
# results in units of the standard error.
alone = Problem(PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.2*v - xi*x")), Telegraph(a=0.5, k=1.0))
expected = moment_lyapunov(alone, 1.0).value[0]
estimate = simulate(alone, [1.0], paths=4096, time=200.0, seed=1).estimates[0]
print(f"finite elements {expected:.5f}, simulation {estimate.value:.5f} +- {estimate.standard_error:.5f}")
assert abs(estimate.value - expected) < 5 * estimate.standard_error

# %%
# Next: :doc:`where stability ends <3_chart>`. All kinds of noise are in :doc:`/guide/noises`.
