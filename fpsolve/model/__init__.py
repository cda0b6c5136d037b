"""What is studied: linear systems in the plane, the noise that drives them, the paper's oscillator; no matrices."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
