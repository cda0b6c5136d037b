from .generator import Generator as Generator
from .mesh import CylinderMesh as CylinderMesh
from .mesh import make_mesh as make_mesh
from .mesh import read_mesh as read_mesh
from .mesh import write_mesh as write_mesh
