from .vtk import write_density as write_density
from .vtk import write_eigenfunctions as write_eigenfunctions
