"""The kinds of noise, one file for each: parameters, coefficients, stationary law, and how they change."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
