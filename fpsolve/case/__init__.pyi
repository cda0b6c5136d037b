from .case import Case as Case
from .case import load_case as load_case
from .curves import Curve as Curve
