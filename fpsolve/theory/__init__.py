"""What paper and pencil know: perturbation theory, still noise, equations of even moments, where valid."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
