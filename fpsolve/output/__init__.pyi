from .eigenfunctions import draw_eigenfunction as draw_eigenfunction
from .vtk import write_density as write_density
from .vtk import write_eigenfunctions as write_eigenfunctions
