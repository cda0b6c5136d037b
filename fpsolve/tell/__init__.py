"""A table becomes words and pictures, on a terminal, in files, on a page."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
