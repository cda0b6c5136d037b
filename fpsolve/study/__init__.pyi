from .simulate import SimulatedCurve as SimulatedCurve
from .solve import Comparison as Comparison
from .solve import CurveResult as CurveResult
