"""Λ at the p of each case, by the Fourier-Hermite code at sizes far above the tuned ones.

`python -m tests.benchmarks.references` prints them again, with what changes at a smaller size.
"""

from __future__ import annotations

import numpy as np

from tests.benchmarks.fourier_hermite import FourierHermite
from tests.benchmarks.problem import CASES, FloatArray

SIZES = {"weak": ((12, 30), (8, 20)), "strong": ((160, 60), (120, 50))}
"""(harmonics, hermite) of the references, and those that confirm them."""

REFERENCES = {
    "weak": np.array(
        [
            0.009811964433988012,
            0.00727436101998886,
            0.005111370368628457,
            0.003322984713123621,
            0.0019091982936323424,
            0.0008700073567938777,
            0.00020541015540639958,
            -8.459305175785863e-05,
            0.0,
            0.0004591935813956013,
            0.0012929939693888223,
            0.002501409447548845,
            0.004084450306556746,
            0.006042128844845764,
            0.008374459369379311,
            0.011081458196566883,
            0.014163143653318,
            0.01761953607823437,
            0.021450657822940453,
            0.02565653325355272,
            0.03023718875228771,
            0.0351926527192093,
            0.04052295557411542,
            0.046228129758564517,
            0.052308209738042115,
            0.058763232004267835,
            0.06559323507764334,
            0.07279825950984145,
            0.08037834788653704,
            0.08833354483028003,
            0.09666389700351108,
            0.10536945311172048,
            0.11445026390675055,
        ]
    ),
    "strong": np.array(
        [
            3.290837215088062,
            2.6505795616929158,
            2.096386728642707,
            1.6414294529211744,
            1.2840080616391312,
            1.0044534244484986,
            0.7808675853535733,
            0.5977875991614288,
            0.44577871638203387,
            0.31925648781178745,
            0.21492302857920972,
            0.1308695793293187,
            0.06608672338719317,
            0.020204777844937405,
            -0.006627842266496423,
            -0.013767201792826088,
            0.0,
            0.0366606278430984,
            0.09940083365537034,
            0.1934550983529113,
            0.32778301459354214,
            0.5181211877767041,
            0.7903671555655923,
            1.1744416493160112,
            1.6770011929930593,
            2.2744535495975615,
            2.9453356321493054,
            3.6817644843718127,
            4.4824519275347035,
            5.347823566916298,
            6.278483394679335,
            7.274906270289231,
            8.337430138597327,
        ]
    ),
}


def compute(case: str, size: tuple[int, int]) -> FloatArray:
    """Λ at the p of a case."""
    return FourierHermite(CASES[case].problem, size).moments(CASES[case].p)


def main() -> None:
    """Print the references, and the largest |change|/max(|Λ|, scale) from the confirming size."""
    for name, (size, smaller) in SIZES.items():
        value = compute(name, size)
        change = CASES[name].relative_error(compute(name, smaller), value)
        print(f"{name}: {size}, {change:.1e} from {smaller}\n{np.array2string(value, precision=16, separator=', ')}")


if __name__ == "__main__":
    main()
