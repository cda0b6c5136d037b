from .frozen import frozen_rate as frozen_rate
from .second_order import Scale as Scale
from .second_order import SecondOrder as SecondOrder
from .second_order import first_order_eigenfunction as first_order_eigenfunction
from .second_order import scale_of as scale_of
from .second_order import second_order as second_order
