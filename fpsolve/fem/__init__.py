"""Functions and matrices: finite elements on the cylinder of phase and noise, and the tilted generator on them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
