from .case import Case as Case
from .case import Curve as Curve
from .case import load_case as load_case
