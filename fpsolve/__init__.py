"""Moment Lyapunov exponents of a vibro-impact oscillator under coloured noise, by finite elements.

>>> from fpsolve import NonGaussianNoise, VibroImpactOscillator, moment_lyapunov
>>> oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
>>> noise = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction()
>>> result = moment_lyapunov(oscillator, noise, 2.0)
>>> print(f"{result.value[0]:.10f}")
0.0141631437
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fpsolve.case import load_case as load_case
    from fpsolve.density import adjoint_density as adjoint_density
    from fpsolve.density import furstenberg_khasminskii as furstenberg_khasminskii
    from fpsolve.density import stationary_density as stationary_density
    from fpsolve.density import tilted_density as tilted_density
    from fpsolve.eigen import principal_pair as principal_pair
    from fpsolve.eigen import spectrum as spectrum
    from fpsolve.errors import CaseError as CaseError
    from fpsolve.errors import FpsolveError as FpsolveError
    from fpsolve.errors import NotConverged as NotConverged
    from fpsolve.exponent import ExponentSolver as ExponentSolver
    from fpsolve.function import MomentLyapunovFunction as MomentLyapunovFunction
    from fpsolve.function import moment_lyapunov as moment_lyapunov
    from fpsolve.generator import TiltedGenerator as TiltedGenerator
    from fpsolve.mesh import CylinderMesh as CylinderMesh
    from fpsolve.mesh import make_mesh as make_mesh
    from fpsolve.noise import NonGaussianNoise as NonGaussianNoise
    from fpsolve.noise import OrnsteinUhlenbeck as OrnsteinUhlenbeck
    from fpsolve.oscillator import VibroImpactOscillator as VibroImpactOscillator
    from fpsolve.report import run as run

_HOMES = {
    "CaseError": "errors",
    "CylinderMesh": "mesh",
    "ExponentSolver": "exponent",
    "FpsolveError": "errors",
    "MomentLyapunovFunction": "function",
    "NonGaussianNoise": "noise",
    "NotConverged": "errors",
    "OrnsteinUhlenbeck": "noise",
    "TiltedGenerator": "generator",
    "VibroImpactOscillator": "oscillator",
    "adjoint_density": "density",
    "furstenberg_khasminskii": "density",
    "load_case": "case",
    "make_mesh": "mesh",
    "moment_lyapunov": "function",
    "principal_pair": "eigen",
    "run": "report",
    "spectrum": "eigen",
    "stationary_density": "density",
    "tilted_density": "density",
}
__all__ = list(_HOMES)


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    """Import a public name on first use, so that the command line starts at once."""
    if name not in _HOMES:
        raise AttributeError(f"module 'fpsolve' has no attribute {name!r}")
    return getattr(import_module(f"fpsolve.{_HOMES[name]}"), name)
