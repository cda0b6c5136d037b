from .curves import curve_grid as curve_grid
from .problem import equations_of as equations_of
from .problem import noises_of as noises_of
