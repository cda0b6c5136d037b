"""What calls of the solvers refuse, and how they say it: an exception, or a number that is absent with a reason."""

import math
import re

import numpy as np
import pytest

import fpsolve
from fpsolve import (
    ExponentSolver,
    FpsolveError,
    NonGaussianNoise,
    NotConverged,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    make_mesh,
    moment_lyapunov,
)
from fpsolve.exponent import Budget
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, Poisson, Telegraph, White
from tests.kit import itself, rates
from tests.numbers.rows.blocks import TEXTS
from tests.numbers.rows.modes import two_modes
from tests.numbers.rows.oscillator import UNIT, WEAK, paper
from tests.numbers.rows.plane import kubo
from tests.numbers.rows.several_noises import BEAM, GAUSSIAN
from tests.numbers.rows.walls import walled

FIG1, TELEGRAPH = Problem(paper(), WEAK), Telegraph(a=0.5, k=1.0)
STRONG = ExponentSolver(Problem(paper(5.0), UNIT), make_mesh())
UNRESOLVED = ExponentSolver(Problem(paper(2.0), WEAK), budget=Budget(unknowns=100))
LARGE = Problem(paper(3.0), NonGaussianNoise(D0=2.0, tau0=5.0, r0=0.95).ou_reduction())
HEAVY = NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.1)
SPRING = "x' = v; v' = -x - 0.2*v - xi*x"
NEIGHBOURS = Problem(paper(), MarkovChain(np.linspace(-1, 1, 60), np.ones((60, 60)) - np.eye(60)))
CHAIN, STRUCK = rates(SPRING, TELEGRAPH), rates(SPRING, Poisson(1.0, (1.0,)))
STIFF = rates("x' = v; v' = -1e16*x - 0.1*v - xi*x", White(s=0.1))
DRIVEN = "q' = v; v' = -q - 0.1*v - xi*q + 0.3*y; y' = 0.5*q - y; z' = y - 2*z"
BOTH, PAIRS = rates(BEAM, [GAUSSIAN, TELEGRAPH]), rates(TEXTS["pairs"], White(s=1.0))
ALIKE = rates(SPRING + "; y' = w; w' = -y - 0.2*w - xi*y", White(s=0.6))
STILL, FOUR = CoefficientMatrix(0, [[0.0, 1.0], [-1.0, -0.2]]), CoefficientMatrix(0, np.eye(4).tolist())
RAYS = Problem(PlaneSystem([STILL], [Jump(0.0, -0.1), Jump(math.pi / 2, -0.1)]), WEAK)
SINKS = CoefficientMatrix(0, [[0.0, 1.0], [-2.0, -3.0]]), CoefficientMatrix(1, np.eye(2).tolist(), itself)
RESTING = Problem(PlaneSystem(SINKS, [Jump(math.pi / 2, 0.0)]), UNIT)
FAR = Problem(paper(0.1, 0.5, -1.0, 10.0), OrnsteinUhlenbeck(alpha=1.0, sigma=0.3))


def moment(problem=FIG1, p=2.0, **options):
    return moment_lyapunov(problem, p, **options)


REFUSED = {
    NotConverged: {
        "moment(p=1e300)": r"Λ\(1e\+300\) is beyond floating-point numbers",
        "moment(p=-1e6)": "beyond floating-point numbers",
        "moment(mesh=make_mesh(xi_min=-0.01))": "use more cells .* a wider noise interval",
        "STRONG.lyapunov_exponent()": "mesh",
        "STRONG.variance_rate()": "mesh",
        "moment(NEIGHBOURS, budget=Budget(seconds=0.05))": "needs some .* limit is 0.05 s .try --set budget.seconds=",
        "moment(STIFF)": "rounding alone may change it by ((?!budget).)*; use a larger rtol((?!budget).)*$",
        "moment(LARGE, -3.0, rtol=1e-4, budget=Budget(unknowns=200))": (
            "not found on this mesh: ((?!use more cells).)*; a larger rtol takes less$"
        ),
        "impact_rate(UNRESOLVED)": "budget",
        "critical_impact_factor(UNRESOLVED)": "budget",
        "critical_restitution(UNRESOLVED)": "budget",
        "ExponentSolver(PAIRS).pair(1.0)": "do not all drive each other",
    },
    FpsolveError: {
        "moment(Problem(paper(), NonGaussianNoise(D0=0.5, tau0=1.0, r0=2.0)), 0.0)": "infinite variance",
        "moment(CHAIN, mesh=make_mesh())": "noise with states, .* needs a mesh without z_lines",
        "moment(BOTH, mesh=make_mesh())": "a mesh is for one noise",
        "simulated_response(two_modes(), 0.1, 0.1, paths=32, time=1, step=0.1, seed=0)": "nothing limits the amplitude",
        "moment(two_modes(Poisson(1.0, (0.1,))), 1.0)": r"Λ\(1\) is not computed: of 4 variables under impulses",
        "ExponentSolver(ALIKE).variance_rate()": r"Λ″\(p\) jumps",
    },
    ValueError: {
        "MomentLyapunovFunction(FIG1, (2.0, 2.0))": "its ends must increase",
        "Budget(unknowns=5)": "unknowns",
        "Budget(unknowns=1e3)": "unknowns",
        "Budget(seconds=0.0)": "seconds",
        "Budget(seconds=math.inf)": "seconds",
        "Noises(dict.fromkeys('abc', UNIT))": "at most 2 noises may be other than white",
        "Noises({'a': HEAVY, 'b': UNIT})": "algebraic tails",
        "Problem(BOTH.system, {'xi1': UNIT, 'side': UNIT})": "the noises given are 'xi1', 'side'",
        "Problem(BOTH.system, UNIT)": "one without a name",
        "LinearSystem([FOUR], [Jump(0.0, -0.1)])": "jumps or cubic terms of a system of 4 variables",
        "LinearSystem([FOUR, STILL])": "must have as many in all terms",
        "CoefficientMatrix(0, np.eye(201).tolist())": "two rows",
        "two_modes(HEAVY)": "is for two variables only",
        "moment(two_modes(), 1.0, mesh=make_mesh())": "got a mesh",
        "Poisson(1.0, ())": "one size at least must differ from 0",
        "Poisson(1.0, (0.0,))": "one size at least must differ from 0",
        "Poisson(1.0, (1.0,), (1.0, 2.0))": "2 weights for 1 sizes",
        "Poisson(1.0, (1.0, 2.0), (1.0, -2.0))": "weights must be >= 0",
        "Poisson(1.0, (math.inf,))": "finite",
        "Poisson(0.0, (1.0,))": "rate: got 0",
        "rates(\"x' = v; v' = xi*v\", Poisson(1.0, (-1e3, 1e3)))": "use smaller sizes",
    },
    TypeError: {
        "ExponentSolver(FIG1, 'x')": "^got mesh = 'x'; must be a CylinderMesh, or None$",
        "ExponentSolver(FIG1, budget='x')": "^got budget = 'x'; must be a Budget$",
        "ExponentSolver(FIG1, rtol='x')": "^got rtol = 'x'; must be a number such as 1e-8$",
        "ExponentSolver(FIG1, rtol=None)": "^got rtol = None; must be a number such as 1e-8$",
        "Noises({'a': UNIT, 'b': 0.1})": "one noise with a name",
        "prove(BOTH, 2.0)": "got the noises xi1 and xi2 at once; proofs are for one noise",
        "prove(STRUCK, 2.0)": "got Poisson",
    },
}
"""Calls, and the words with which they are refused."""


PUBLIC = fpsolve, fpsolve.analysis, fpsolve.exponent, fpsolve.model, fpsolve.simulation
NAMES = {name: getattr(room, name) for room in PUBLIC for name in room.__all__} | globals()
NAMES |= {"two_modes": two_modes, "kubo": kubo, "walled": walled}


@pytest.mark.parametrize(
    ("kind", "call", "words"), [(kind, *row) for kind, rows in REFUSED.items() for row in rows.items()]
)
def test_call_is_refused(kind, call, words):
    with pytest.raises(kind, match=words):
        eval(call, NAMES)


@pytest.mark.parametrize(
    ("g", "matrix", "noise"),
    [
        (np.square, [[0.0, 0.3], [0.0, 0.0]], GAUSSIAN),
        (np.square, [[0.0, 1e-6], [0.0, 0.0]], GAUSSIAN),
        (np.cos, [[0.0, 0.3], [0.0, 0.0]], NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8)),
        (np.cos, [[0.0, 0.3], [0.0, 0.0]], MarkovChain((-1.0, 0.0, 1.0), ((0, 1, 0), (1, 0, 1), (0, 1, 0)))),
        (itself, [[0.0, 0.3], [0.0, 0.0]], White(s=0.5)),
        (itself, [[0.0, 0.3], [0.0, 0.0]], Poisson(rate=1.0, sizes=(0.5,))),
        (itself, [[0.0, 1.0], [-1.0, 0.0]], Telegraph(a=1.0, k=5.0)),
    ],
)
@pytest.mark.parametrize("log", [-0.2, 0.0])
def test_noise_that_turns_the_ray_of_a_wall_is_refused(g, matrix, noise, log):
    """x = 0 is passed with ẋ = (1 + 0.3 g(ξ))v, g the same at both ends of the noise: λ was -6.68 in place of -0.17."""
    wall, load = [Jump(math.pi / 2, log)], CoefficientMatrix(1, [[0.0, 0.0], [-0.1, 0.0]], itself, "sea")
    alone = PlaneSystem([STILL, CoefficientMatrix(1, matrix, g)], wall)
    with pytest.raises(ValueError, match=f"{noise.kind} noise moves the phase across the ray of a jump, phi = 1.5708"):
        Problem(alone, noise)
    terms = [STILL, CoefficientMatrix(1, matrix, g, "gust"), load]
    with pytest.raises(ValueError, match='the noise "gust" moves the phase across'):
        Problem(PlaneSystem(terms, wall), {"gust": noise, "sea": TELEGRAPH})


def test_negative_moments_of_blocks_are_refused_alone():
    """The other p stay, and each block by itself."""
    with pytest.raises(NotConverged, match=r"for p < 0 is not computed: .* choose p >= 0, or solve each") as failure:
        moment(PAIRS, [-1.0, -1e-6, 0.5, 2.0])
    assert failure.value.partial.p.tolist() == [0.5, 2.0]
    assert ExponentSolver(rates(DRIVEN, UNIT, [{"at": "q = 0", "restitution": 0.6}])).by_class([]) == ()  # has no wall
    found = ExponentSolver(PAIRS).by_class([-1.0, 2.0])
    assert [(each.name, each.value.size) for each in found] == [("x, v", 2), ("y, w", 2)]


ABSENT = {
    "impact_rate(ExponentSolver(CHAIN))": "no rays",
    "critical_impact_factor(ExponentSolver(RAYS))": "2 rays",
    "critical_restitution(ExponentSolver(walled(TELEGRAPH, 0.9)))": (
        r"almost surely stable for every R in \(0, 1\], as λ without loss is -0.033"
    ),
    "critical_restitution(ExponentSolver(RESTING))": "as if the motion did not turn",
    "stability_index(FAR)": r"^Λ\(p\) has no root p ≠ 0 in \[-20, 20\]",
    "stability_index(rates(TEXTS['pairs'], White(s=2.0)))": "for p < 0 is not computed",
    "stability_index(kubo(UNIT))": "0",
    "stability_index(kubo(White(s=0.5, interpretation='ito')))": r"0\.125",
}


@pytest.mark.parametrize("call", ABSENT)
def test_number_that_does_not_exist_is_absent_with_a_reason(call):
    assert not (found := eval(call, NAMES))
    assert re.search(ABSENT[call], found.reason), found
