from .curve import CurveResult as CurveResult
from .curve import SimulatedCurve as SimulatedCurve
from .table import Column as Column
from .table import Table as Table
