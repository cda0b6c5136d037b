from .frozen import FrozenNoise as FrozenNoise
from .frozen import frozen_noise as frozen_noise
from .perturbation import Scale as Scale
from .perturbation import SecondOrder as SecondOrder
from .perturbation import first_order_eigenfunction as first_order_eigenfunction
from .perturbation import scale_of as scale_of
from .perturbation import second_order as second_order
