from .case import Case as Case
from .case import ParameterSet as ParameterSet
from .case import load_case as load_case
