from .eigenfunctions import write_density as write_density
from .eigenfunctions import write_eigenfunctions as write_eigenfunctions
from .netcdf import open_results as open_results
from .table import Column as Column
from .table import Table as Table
