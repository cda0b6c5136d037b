from .density import Density as Density
from .density import adjoint_density as adjoint_density
from .density import furstenberg_khasminskii as furstenberg_khasminskii
from .density import stationary_density as stationary_density
from .density import tilted_density as tilted_density
