"""What is studied: linear systems in the plane, the noise that drives them, the paper's oscillator; no matrices."""

import warnings

import lazy_loader

_known, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_RENAMED = {"Drive": "CoefficientMatrix", "Kick": "Jump", "Diffusion": "Noise"}


def __getattr__(name: str) -> object:
    if name in _RENAMED:
        warnings.warn(f"{name} is called {_RENAMED[name]} now", DeprecationWarning, stacklevel=2)
        name = _RENAMED[name]
    return _known(name)
