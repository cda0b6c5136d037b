"""From measured spectra and records to noises, and what their errors mean for stability."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
