"""What constructors and functions refuse in Python: a call, and words of the one sentence that says why."""

import math
import re
import sys
from dataclasses import replace

import numpy as np
import pytest

import fpsolve
from fpsolve import (
    ExponentSolver,
    FpsolveError,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    make_mesh,
    moment_lyapunov,
    simulate,
)
from fpsolve.exponent import Budget, even_moment, impact_rate, stationary_moments
from fpsolve.model import (
    Bounded,
    CoefficientMatrix,
    CubicTerms,
    Filter,
    Jump,
    LinearSystem,
    MarkovChain,
    ModalSystem,
    ParametricOscillator,
    Telegraph,
    White,
    kind_of,
)
from tests.kit import equations, itself, matrices, rates
from tests.numbers.second import LOAD, spring

ROTATION = ((0.0, 1.3), (-1.3, 0.0))
FREE = CoefficientMatrix(0, ROTATION)
OU = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
ITO = White(s=1.0, interpretation="ito")
SYSTEM = PlaneSystem([FREE])
AXES = fpsolve.analysis.Axis("noise.alpha", 0.5, 2.0), fpsolve.analysis.Axis("noise.sigma", 0.5, 2.0)
SIZE = "must be a finite number >= 1e-15 and <= 1e15"
OWN = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.1}
MODES = "q' = v; v' = -q - 0.1*v - xi*q - 0.3*y; y' = w; w' = -2*y - 0.2*w - 0.3*q"
STOPPED = [{"at": "q = 0", "restitution": 0.6}]
MATHIEU = "x' = v; v' = -x - xi*x + {}"


def driven(g, *jumps, load=LOAD, noise=OU):
    return Problem(PlaneSystem([FREE, CoefficientMatrix(1, load, g)], jumps), noise)


def modal(at="q1 - c*q2 = 0", restitution=0.6, noise=((1, 0.2), (0.2, 0)), m=0.3, c=0.5):
    walls = [{"at": at, "restitution": restitution}]
    return ModalSystem.of(
        [[1, "m"], ["m", 2]], [[2, 0], [0, 3]], stiffness_noise=noise, parameters={"m": m, "c": c}, walls=walls
    )


def of(**changed):
    given = {"variables": ("x", "v"), "drift": ("v", "-x - xi*x"), **changed}
    return PlaneSystem.of_equations(given.pop("variables"), given.pop("drift"), **given)


def paper(**changed):
    return VibroImpactOscillator(**OWN | changed)


def noise(**changed):
    return NonGaussianNoise(**{"D0": 1.0, "tau0": 0.5, "r0": 0.95} | changed)


def beside(size):
    """A noise that moves the phase across a wall in its last state alone."""
    states = np.linspace(-1.0, 1.0, size)
    terms = [
        CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2))),
        CoefficientMatrix(1, ((0.0, 0.3), (0.0, 0.0)), lambda xi: np.maximum(xi - states[-2], 0.0), "a"),
        CoefficientMatrix(1, LOAD, itself, "b"),
    ]
    chain = MarkovChain(states, np.eye(size, k=1) + np.eye(size, k=-1))
    return Problem(PlaneSystem(terms, [Jump(math.pi / 2, -0.2)]), {"a": chain, "b": OrnsteinUhlenbeck(1.0, 0.5)})


def groups(back):
    """A chain of two groups, and one way there and back: the numbers of all ways are beyond floats."""
    ways = np.kron(np.eye(2), np.ones((120, 120)))
    ways[119, 120], ways[120, 119] = back, 1e-3
    np.fill_diagonal(ways, 0.0)
    return MarkovChain(states=np.linspace(-1, 1, 240), rates=ways)


def on_mesh():
    mesh = make_mesh(phi_cells=2, phi_degree=12, xi_degree=12)
    return ExponentSolver(matrices(spring(), LOAD, Filter(2.0, 0.3, 0.5, 1.0, 0.0)), mesh).solution(2.0)


def strong():
    problem = matrices(spring(), LOAD, Filter(2.0, 0.02, 2.4, 1.0, 0.0))
    return ExponentSolver(problem, rtol=1e-8, budget=Budget(unknowns=3000)).solution(4.0)


def lagging():
    return ExponentSolver(
        rates("q' = v; v' = -q - 0.1*v - xi*q - 0.3*y; y' = -y - 0.3*q", Telegraph(0.5, 0.7), STOPPED)
    )


WALLED = "at a wall of more than two variables"
NUMBERS = "both must be finite"
ROWS = "two rows of two finite numbers"


def spelled(value):
    """A value as messages write it."""
    return re.escape(repr(value).replace("'", '"').lower())


BAD = [
    # Noises
    *(
        (
            lambda each=each: noise(**dict([each])),
            f"^NonGaussianNoise: {each[0]}: got {spelled(each[1])}.*; must be a finite number >= .*",
        )
        for each in (
            ("D0", 0.0),
            ("D0", -1.0),
            ("tau0", math.inf),
            ("tau0", "1"),
            ("r0", 3.0),
            ("r0", math.nan),
            ("D0", True),
        )
    ),
    (
        lambda: NonGaussianNoise(D0=-1.0, tau0=math.nan, r0=0.9),
        rf"D0: got -1\.0; {SIZE} \(noise intensity, in 1/time\); write.*\n.*tau0: got nan; {SIZE} \(correlation time,",
    ),
    (
        lambda: NonGaussianNoise(tau0=1.0, r0=0.9, DO=1.0),
        rf"D0: missing; {SIZE} .*\n.*DO: unknown; the parameters are D0, tau0, r0$",
    ),
    (lambda: NonGaussianNoise(10**5000, 1.0, 0.9), "D0: got a value too long to show; must"),
    (lambda: NonGaussianNoise(1.0, [0.5] * 99, 0.9), r"tau0: got \[(0\.5, ){11}0\.\.\.; must"),
    (
        lambda: NonGaussianNoise(1.0, 1.0, 0.9, 2.0),
        "^NonGaussianNoise: argument 4: unknown; the parameters are D0, tau0, r0$",
    ),
    *(
        (lambda r0=r0: noise(r0=r0).ou_reduction(), r"r0 = .* choose r0 < 5/3")
        for r0 in (math.nextafter(5 / 3, 0), 5 / 3, 2.0)
    ),
    (lambda: kind_of("noise", "pink"), r'got kind = "pink"; must be one of non-gaussian, ou-reduction'),
    (lambda: White(1.0, "backwards"), "interpretation"),
    (lambda: Telegraph(a=1.0, k=-1.0), rf"k: got -1\.0; {SIZE}"),
    (lambda: Bounded(1.0, 0.0, 0.0), "ξ would be constant"),
    (lambda: matrices(spring(), LOAD, Bounded(0.4, 2.0, 0.0)), r"^only the start of this noise is random.*Floquet"),
    (lambda: MarkovChain((1.0,), ((0,),)), "n >= 2"),
    (lambda: MarkovChain((1.0, 2.0), ((0, 1),)), "n >= 2"),
    (lambda: MarkovChain((1.0, 1.0), ((0, 1), (1, 0))), "finite numbers that differ"),
    (lambda: MarkovChain((1.0, math.inf), ((0, 1), (1, 0))), "finite numbers that differ"),
    (lambda: MarkovChain((1.0, 2.0), ((0, -1), (1, 0))), "must be >= 0"),
    (lambda: MarkovChain((1.0, 2.0), ((-2, 1), (1, -1))), "minus the sum of its row"),
    (lambda: groups(0.0), "every state must be reachable"),
    (
        lambda: MarkovChain((-0.5, 0.5), ((0, 1e300), (1e300, 0))),
        r"^got rates of sizes up to 1e\+300; must be from 1e-15",
    ),
    # Systems
    *(
        (
            lambda each=each: paper(**dict([each])),
            f"^VibroImpactOscillator: {each[0]}: got {spelled(each[1])}.*; must be (a finite number|one of) .*",
        )
        for each in (
            ("omega", 0.0),
            ("epsilon", -0.1),
            ("restitution", 0.0),
            ("restitution", 1.1),
            ("c1", math.nan),
            ("c2", -1.0),
            ("c3", -1.0),
            ("impact", "elastic"),
            ("omega", True),
        )
    ),
    (
        lambda: VibroImpactOscillator(1.0, 0.5, 0.0, 1.5, impact="restitution"),
        r"1 - epsilon\^2 \(1 - restitution\) > 0, but it is -0\.125",
    ),
    (lambda: CoefficientMatrix(0, ((1, 2), (3,))), f"inhomogeneous|{ROWS}"),
    (lambda: CoefficientMatrix(0, ((1, 2), (3, math.nan))), ROWS),
    (lambda: CoefficientMatrix(0, [[True, 1.0], [0.0, 1.0]]), f"must be .* {ROWS}"),
    (lambda: CoefficientMatrix(0, [["0", "1"], ["1", "0"]]), f"must be .* {ROWS}"),
    (lambda: CoefficientMatrix(-1, ROTATION), "a whole number >= 0"),
    (lambda: CoefficientMatrix(0.5, ROTATION), "a whole number >= 0"),
    (lambda: CoefficientMatrix(True, ROTATION), "^got order = True and matrix = .*; must be a whole number >= 0"),
    (lambda: CoefficientMatrix(0, ROTATION, 3.0), r"^got g = 3\.0; must be a function of xi"),
    (lambda: CoefficientMatrix(0, ROTATION, np.zeros((2, 2))), r"^got g = array\(.*; must be a function of xi$"),
    (lambda: Jump(math.inf, 0.0), NUMBERS),
    (lambda: Jump(0.0, -math.inf), NUMBERS),
    (lambda: Jump(0.0, "x"), NUMBERS),
    (lambda: Jump(True, 0.0), f"got phase = True, log_factor = 0.0; {NUMBERS}"),
    (lambda: Jump(0.0, 0.0, math.nan), "and leading, here nan"),
    (lambda: PlaneSystem([]), "needs one at least"),
    (lambda: PlaneSystem([True]), r"^got terms = \[True\]; must be a list, each a CoefficientMatrix$"),
    (lambda: PlaneSystem([FREE], 3.0), "^got jumps = 3.0; must be a list, each a Jump$"),
    (lambda: PlaneSystem([FREE], epsilon=0.0), "a positive number"),
    (lambda: PlaneSystem([FREE], clock=1.0), "^got clock; LinearSystem has terms, jumps, epsilon, stop, cubic; leave"),
    (lambda: PlaneSystem([FREE], epsilon=True), "epsilon must be a finite number"),
    (lambda: PlaneSystem([FREE], [Jump(0.1, 1), Jump(0.1 + math.pi, 1)]), "differ modulo pi"),
    (lambda: SYSTEM.at({"mass": 1.0}), "got mass; the parameters are epsilon"),
    *((lambda m=m: CubicTerms(m), "must be") for m in (((1.0, 0.0),), "x", ((math.nan,) * 4,) * 2)),
    # Problems
    (lambda: driven(np.sin, noise=White(1.0)), r"g = sin\(ξ\) of it has no meaning"),
    (lambda: driven(itself, Jump(0.0, -0.1), noise=White(1.0)), "moves the phase across the ray of a jump"),
    *((lambda n=n: beside(n), 'the noise "a" moves the phase across the ray of a jump') for n in (20, 42, 100)),
    *(
        (lambda g=g: moment_lyapunov(driven(g), 2.0), r"^g returned .* for an array of shape \(\d+,\); must be [^\n]*$")
        for g in (
            lambda x: np.zeros(3),
            lambda x: np.zeros((2, *np.shape(x))),
            lambda x: [[1.0], [2.0, 3.0]],
            lambda x: None,
            lambda x: "x",
            lambda x: x + 1j,
        )
    ),
    *(
        (lambda each=each: Problem(*each), rf"^got .* as a {kind}; must be a system and a noise: ")
        for wrong in ("x", None, 2.0, VibroImpactOscillator, OrnsteinUhlenbeck)
        for each, kind in (((wrong, OU), "motion"), ((SYSTEM, wrong), "noise"))
    ),
    (lambda: Problem(paper(), OU).at({"noise.x": 1.0}), "got x; the parameters are alpha, sigma"),
    (lambda: Problem(paper(), OU).at({"mass.m": 1.0}), r"got mass\.m; the parameters are oscillator\.omega"),
    (
        lambda: Problem(paper(), OU).derivative("oscillator.c2"),
        r"got oscillator\.c2; the parameters to differentiate by are",
    ),
    (
        lambda: equations("x' = v; v' = -x - sqrt(c)*v - xi*x", c=0.0).derivative("c"),
        "the derivative of the system by c is not finite",
    ),
    (lambda: fpsolve.lyapunov_exponent(Problem(SYSTEM, OU), rtol=True), r"^got rtol = True; must be a number"),
    (
        lambda: impact_rate(ExponentSolver(Problem(paper(), OU)), 2),
        "got jump = 2; must be 0|got jump = 2; must be a whole number",
    ),
    (on_mesh, "of a filter needs a mesh without z_lines"),
    (strong, r"the limit is 3,000 .try --set budget.unknowns=5900"),
    # Equations
    (lambda: of(variables=()), r"^variables: got "),
    (lambda: of(variables=("x", 3)), "^variables: got "),
    (lambda: of(drift="v, -x"), "^drift: got "),
    (lambda: of(drift=("v", "-x*x - xi*x")), r"^drift\[1\]: the term -x\*x of v's rate is of degree 2 in x, v"),
    (lambda: of(parameters={"a": True}), r"^parameters\.a: got True; must be a finite number"),
    (lambda: of(parameters={3: 1.0}), r"^parameters\.3: got the name 3; it must be a text"),
    (lambda: of(parameters={"a": math.inf}), r"^parameters\.a: got inf; must be a finite number"),
    (lambda: of(parameters=[1.0]), r"^parameters: got \[1\.0\]; must be a mapping from names"),
    (lambda: of(parameters={"a": 1.0}).at({"mass": 1.0}), "got mass; the parameters are a"),
    (lambda: of(noises={"xi": 3}), r"^noises\.xi: got 3; must be the name of a section"),
    (lambda: of(walls=[{"at": None, "restitution": 1.0}]), r"^walls\[0\]\.at: got None; must be "),
    (
        lambda: of(walls=[{"at": "x = 0", "restitution": None}]),
        r"^walls\[0\]\.restitution: got None; must be a number > 0",
    ),
    (
        lambda: of(walls=[{"at": "x = 0"}]),
        r"^walls\[0\]: got \{'at': 'x = 0'\}; must have the keys at and restitution alone",
    ),
    (lambda: of(walls="x = 0"), r"^walls\[0\]: got 'x = 0'; must have the keys"),
    *(
        (lambda r=r: equations("x' = -x + xi*x(t - 1)" if not r else f"x' = {r}"), told)
        for r, told in (
            ("-x + xi*x(t - x)", "may not depend on the state"),
            ("-x + xi*x(t - xi)", "may not depend on the state"),
            ("-x + xi*x(2*t)", "may not depend on the state"),
            ("-x + xi*x(t + 1)", "the delay is -1; must be > 0"),
            ("-x + xi*y(t - 1)", "y is none of the variables x"),
            ("-x**3 + xi*x(t - 1)", "must be of degree 1"),
            ("-x + x(t - 1) + 0.3 + xi", "only noise may be alone"),
        )
    ),
    (lambda: equations("x' = v; v' = -x + xi*x(t - 1)", [{"at": "x = 0", "restitution": 0.8}]), "none with a delay"),
    *(
        (lambda term=term: equations(MATHIEU.format(term)), re.escape(told))
        for term, told in (
            ("cos(t)*x + cos(2**0.5*t)*x", "the frequencies 1, 1.414213562; must be multiples of one number"),
            ("cos(t)*xi*x", "not affine in"),
            ("cos(0*t)*x", "nu not 0"),
            ("sin(t*t)*x", "write sin"),
            ("cos(xi*t)*x", "write cos"),
        )
    ),
    # Walls of several variables
    (lambda: equations(MODES, [{"at": "v = 0", "restitution": 0.6}]), r"there v's rate must be c\*v"),
    (lambda: equations(MODES, [{"at": "q + y = 0", "restitution": 0.6}]), 'is for kind = "modes"'),
    (lambda: equations(MODES, [{"at": "q = 0", "restitution": 1.01}]), "must be <= 1"),
    (lambda: equations(MODES, [{"at": "q = 0", "restitution": -0.5}]), "must be > 0"),
    (lambda: modal("q1 = 1"), "the modes are q1, q2"),
    (lambda: modal("q1_dot = 0"), "unknown name q1_dot"),
    (lambda: modal(m=1.5, c=1.0), "> 0, as of a positive definite matrix"),
    (lambda: Problem(modal(restitution=0.163), White(s=0.1)), r"0\.163034.*Bertoin"),  # E. Jacob, arXiv:1004.1953
    *(
        (lambda ask=ask: ask(lagging()), WALLED)
        for ask in (ExponentSolver.lyapunov_exponent, lambda s: s.pair(2.0), lambda s: s.pair(1.0))
    ),
    # Moments that do not close
    *(
        (lambda system=system, noise=noise, p=p: even_moment(Problem(system, noise), p), told)
        for system, noise, p, told in (
            (ParametricOscillator(1.0, 0.1), White(0.5), 3.0, "even p > 0 only"),
            (ParametricOscillator(1.0, 0.1), White(0.5), 0.0, "even p > 0 only"),
            (ParametricOscillator(1.0, 0.1, 0.9), White(0.5), 2.0, "where a wall changes the state"),
            (ParametricOscillator(1.0, 0.1), NonGaussianNoise(1.0, 1.0, 1.2), 2.0, "algebraic tails; take r0 <= 1"),
            (ParametricOscillator(1.0, 0.1), Telegraph(0.5, 1.0), 1e6, "1000001 moments are more than 1000"),
        )
    ),
    (lambda: even_moment(matrices(spring(), LOAD, White(0.5)), 2).slope("noise.none"), "noise.none"),
    (lambda: moment_lyapunov(rates("x' = -x + xi*x(t - 1)", ITO), 4.0), r"with a delay fpsolve finds Λ\(2\) alone"),
    (lambda: even_moment(rates("x' = -x + xi*x(t - 1) + x(t - pi)", ITO), 2), "must be multiples of one number"),
    (lambda: stationary_moments(rates("x' = x - 0.1*x(t - 1) + xi", ITO)), r"Λ\(2\) = 1\.\d+ .* is not negative"),
    (lambda: stationary_moments(rates("x' = -x + xi*x(t - 1)", ITO)), "nothing limits the amplitude"),
    (
        lambda: simulate(rates("x' = -2*x + 0.5*xi*x(t - 1)", ITO), 2.0, step=0.0101),
        r"a third, a sixth, … of the delay, such as 0\.0098",
    ),
]


@pytest.mark.parametrize(("call", "words"), BAD, ids=lambda each: each[:60] if isinstance(each, str) else "")
def test_call_is_refused_in_words(call, words):
    with pytest.raises((FpsolveError, ValueError, TypeError, KeyError), match=words) as refused:
        call()
    assert refused.value.__context__ is None or not isinstance(refused.value.__context__, AttributeError)


@pytest.mark.slow
def test_noise_so_strong_or_slow_that_moments_have_too_many_functions_is_refused():
    with pytest.raises(FpsolveError, match="noise so strong or slow"):
        even_moment(Problem(ParametricOscillator(1.0, 0.1), OrnsteinUhlenbeck(1e-3, 1.0)), 4.0)


ARGUMENTS = {
    "pair": fpsolve.tilted_density,
    "case": fpsolve.run,
    "out": lambda x: fpsolve.run("x", x),
    "progress": lambda x: fpsolve.run("x", progress=x),
    "overrides": lambda x: fpsolve.load_case("x", x),
    "interval": lambda x: fpsolve.MomentLyapunovFunction(driven(itself), x),
    "by": lambda x: fpsolve.design(driven(itself), "moment(2) = 0", x),
}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_an_argument_of_another_type_is_named_in_one_sentence(name):
    with pytest.raises(TypeError, match=rf"^got {name} = 3; must be .*\Z"):
        ARGUMENTS[name](3)


CALLS = [
    lambda of: fpsolve.moment_lyapunov(of, 2.0),
    lambda of: fpsolve.lyapunov_exponent(of),
    lambda of: fpsolve.stability_index(of),
    lambda of: fpsolve.ExponentSolver(of),
    lambda of: fpsolve.MomentLyapunovFunction(of, (1.0, 2.0)),
    lambda of: fpsolve.boundary(of, "lyapunov_exponent = 0", *AXES),
    lambda of: fpsolve.sensitivities(of, 2.0),
    lambda of: fpsolve.simulate(of, 2.0),
    lambda of: fpsolve.prove(of, 2.0),
    lambda of: fpsolve.design(of, "lyapunov_exponent = 0", "noise.sigma"),
    lambda of: fpsolve.analysis.excursion(of),
    lambda of: fpsolve.analysis.uncertainty(of, {"noise.sigma": 0.1}),
    lambda of: fpsolve.stationary_response(of),
    lambda of: fpsolve.simulation.simulated_response(of, 0.1, 0.1, paths=32, time=1.0, step=0.1, seed=1),
    lambda of: fpsolve.measured.verdict(of, None),
]


@pytest.mark.parametrize("call", CALLS)
def test_system_alone_is_no_problem(call):
    for wrong in (SYSTEM, "x"):
        with pytest.raises(TypeError, match=r"^got problem = .*; must be a Problem, .*: Problem\(system, noise\)$"):
            call(wrong)


def test_systems_at_the_ends_of_what_is_refused_are_made():
    assert groups(1e-3).probabilities.size == 240
    Problem(modal(restitution=0.1631), White(s=0.1))
    Problem(modal(restitution=0.1), Telegraph(0.5, 0.7))
    Problem(modal("q1 = 0", 0.1, ((1, 0), (0, 0)), m=0.0), White(s=0.1))  # which is 0 there
    assert replace(SYSTEM, epsilon=0.5).epsilon == 0.5
    assert LinearSystem([FREE]).dimension == 2


def test_expressions_of_equations_run_nothing():
    events, is_on = [], True
    sys.addaudithook(lambda event, _: events.append(event) if is_on else None)
    for text in ("a**2", "__import__(a)", "a.__class__", "exp(a)"):
        try:
            equations(f"x' = v; v' = -x - xi*{text}*v", a=1.0)
        except ValueError:
            continue
    is_on = False
    assert not {"exec", "import", "open"} & set(events)
