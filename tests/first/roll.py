"""The spectrum of a ship's metacentric height, one-sided, as a table of frequencies in Hz."""

import sys

import numpy as np

f = np.linspace(0.06, 0.4, 69)
density = 0.02 * (0.1 / f) ** 5 * np.exp(-1.25 * (0.1 / f) ** 4) * 0.8**2
np.savetxt(
    sys.argv[1], np.column_stack([f, density]), delimiter=",", header="f (Hz),GM (m^2/Hz)", comments="", fmt="%.6g"
)
