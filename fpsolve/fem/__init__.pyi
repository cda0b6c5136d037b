from .generator import Generator as Generator
from .mesh import CylinderMesh as CylinderMesh
from .mesh import make_mesh as make_mesh
from .mesh_file import read_mesh as read_mesh
from .mesh_file import write_mesh as write_mesh
