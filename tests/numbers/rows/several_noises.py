"""Two independent noises at once, in the plane: equations of the moments."""

from functools import partial

import numpy as np

from fpsolve import OrnsteinUhlenbeck
from fpsolve.exponent import Budget
from fpsolve.model import Poisson, Telegraph, White
from tests.kit import matrices, rates
from tests.numbers.by_problem import by_moments, elements, even_rows
from tests.numbers.values import Row, closed, slope

BEAM = "x' = v; v' = -x - 0.1*v - xi1*x - xi2*v"
GAUSSIAN = OrnsteinUhlenbeck(alpha=1.0, sigma=0.3)
IMPULSES = Poisson(rate=1.3, sizes=(0.5, -0.8), weights=(2.0, 1.0))
ITO = White(s=0.4, interpretation="ito")
PAIRS = {
    "coloured and chain": (GAUSSIAN, Telegraph(a=0.2, k=0.7)),
    "coloured and white": (GAUSSIAN, White(s=0.2)),
    "coloured and Itô": (GAUSSIAN, ITO),
    "two coloured": (OrnsteinUhlenbeck(alpha=0.7, sigma=0.15), OrnsteinUhlenbeck(alpha=2.0, sigma=0.2)),
    "two chains": (Telegraph(a=0.3, k=1.0), Telegraph(a=0.2, k=2.0)),
    "impulses and white": (IMPULSES, White(s=0.4)),
    "impulses and Itô": (IMPULSES, ITO),
    "two white": (White(s=0.3), ITO),
}


def random_system(seed: int, noises):
    """One that turns, with both noises in all entries."""
    rng = np.random.default_rng([7, seed])
    return matrices([[0.0, 1.0], [-1.0, -rng.uniform(0.0, 0.4)]], rng.uniform(-1, 1, (2, 2, 2)), noises)


FAR = rates(
    "x' = v + xi1*(0.710605029864118*x + 0.6220467975686843*v) + xi2*(0.8208143561316756*v - 0.9947384927474006*x);"
    "v' = -x - 0.3459190348066346*v - xi1*(0.4771072771670468*x + 0.8456010845631572*v)"
    " + xi2*(0.9696069504751108*x - 0.42740679166765916*v)",
    [
        OrnsteinUhlenbeck(alpha=1.4097972148335, sigma=0.9398783738030198),
        OrnsteinUhlenbeck(alpha=0.5712624770199817, sigma=0.4902263906399517),
    ],
)
"""Fast and slow noise: some 24 x 8 x 30 functions do, where the axis that lacks functions is refined alone."""
NODE = rates(
    "x' = -1.3960696175910667*x + 3.189804505143595*v"
    " + xi1*(0.5518157121082798*v - 0.14477046177438552*x) - xi2*(0.36957090671197107*x + 0.9142242725579968*v);"
    "v' = 0.2382010570421062*x - 1.506962933737433*v"
    " + xi1*(0.7288815789732673*v - 0.378513641896167*x) + xi2*(0.040173133735203655*x - 0.16123722803306492*v)",
    [
        OrnsteinUhlenbeck(alpha=2.555306793986962, sigma=0.15016487721111638),
        OrnsteinUhlenbeck(alpha=3.3054676187684944, sigma=0.1315417262470089),
    ],
)
"""T of p = 4 takes few functions, T* many."""
CANCELLING = matrices(
    ((-0.16, -0.17), (-0.76, 1.38)),
    (((-1.49, -0.83), (-0.41, 1.0)), ((1.8, 0.68), (-0.64, 0.71))),
    [OrnsteinUhlenbeck(alpha=1.18, sigma=1.0), OrnsteinUhlenbeck(alpha=1.38, sigma=1.0)],
)
"""What the functions lack of the first noise lowers Λ(2) as much as what they lack of the second raises it."""
PLATEAU = matrices(
    ((-0.156, -0.174), (-0.758, 1.385)),
    (((-1.495, -0.827), (-0.414, 1.005)), ((1.857, 0.699), (-0.664, 0.731))),
    [OrnsteinUhlenbeck(alpha=1.18, sigma=1.0), OrnsteinUhlenbeck(alpha=1.383, sigma=1.0)],
)
"""With nine functions of the first noise and four of the second the next ones change Λ(2) by 1e-3, all by 0.03."""
ROWS = [
    *even_rows(CANCELLING, "opposite effects", 1e-3, (2,), 1e-6, 12, closed, tolerance=1e-2),
    Row(PLATEAU, closed(2, tolerance=1e-2), partial(by_moments, PLATEAU, 2, 20, 5.5), 1e-5, 2e-3, "a plateau"),
    *(
        row
        for name, noises in PAIRS.items()
        for problem in (rates(BEAM, noises), random_system(len(name), noises))
        for count in (7 if name == "two coloured" else 11,)
        for row in even_rows(problem, name, 2e-7, doubt=2e-9, count=count, quantity=elements)
    ),
    *even_rows(rates(BEAM, PAIRS["two chains"]), "two chains", 1e-9, quantity=closed),
    *even_rows(rates(BEAM, PAIRS["impulses and Itô"]), "impulses and Itô", 1e-9, quantity=closed),
    Row(
        FAR,
        elements(2, rtol=1e-6, budget=Budget(unknowns=8000)),
        lambda: by_moments(FAR, 2, 32, near=3.5),
        1e-10,
        1e-5,
        "fast and slow noise",
        slow=True,
    ),
    *even_rows(NODE, "node", 1e-6, (4,), 1e-10, 8, rtol=1e-7),
    Row(NODE, slope(4.0), -0.5761729688, 1e-10, 1.0, "five differences of the moment equations"),
]
