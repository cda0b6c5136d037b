from .columns import columns_of as columns_of
from .columns import row_of as row_of
from .solve import solve_curve as solve_curve
