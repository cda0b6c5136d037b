"""The witness: Monte Carlo simulation of the system itself; it knows nothing of generators."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
