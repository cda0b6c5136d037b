from .columns import columns_of as columns_of
from .columns import row_of as row_of
from .datasets import open_results as open_results
from .eigenfunctions import write_density as write_density
from .eigenfunctions import write_eigenfunctions as write_eigenfunctions
from .table import Column as Column
from .table import Table as Table
