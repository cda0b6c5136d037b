"""Moment Lyapunov exponents of linear systems under random loads, by finite elements.

`VibroImpactOscillator` is the system of the paper. `PlaneSystem.of_equations` states others as equations. More systems
and all noises are in `fpsolve.model`; what else can be computed is in the other packages that `dir(fpsolve)` names.

>>> from fpsolve import NonGaussianNoise, Problem, VibroImpactOscillator, moment_lyapunov
>>> oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
>>> noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction()
>>> result = moment_lyapunov(Problem(oscillator, noise), 2.0)
>>> print(f"{result.value[0]:.10f}")
0.0141631437
"""

from os.path import isdir

import lazy_loader

__getattr__, __dir__, _names = lazy_loader.attach_stub(__name__, __file__)  # the command line starts at once
__all__ = [name for name in _names if not isdir(f"{__path__[0]}/{name}")]  # noqa: PTH112  (pathlib takes a while)
__version__ = "0.2.0"
