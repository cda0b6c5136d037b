from .curves import curve_grid as curve_grid
