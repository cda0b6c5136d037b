"""Bounds on Λ(p), λ and δ_p that hold with certainty, and certificates from which others can verify them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
