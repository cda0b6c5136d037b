from .curves import curve_grid as curve_grid
from .moments import index_grid as index_grid
from .moments import moment_grid as moment_grid
from .problem import equations_of as equations_of
from .problem import noises_of as noises_of
