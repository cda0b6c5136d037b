"""What is said of a case and of all its curves together, in blocks that terminal and report share."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
