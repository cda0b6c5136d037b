"""The moment Lyapunov exponent Λ(p) with an error: eigenpairs, the choice of a mesh, Λ as a function of p."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
