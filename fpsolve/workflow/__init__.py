"""Running a case: it is solved, simulated, charted or checked, written as it goes, and drawn in the end."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
