"""What is said of results, as codes with data, from which words are made."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from enum import Enum, StrEnum, unique
from functools import partial
from string import Formatter
from types import MappingProxyType
from typing import Any
from unicodedata import category

LONGEST = 1200
"""Letters of a line of a message."""
ALMOST_EVERY = "growth rate of almost every path (Furstenberg-Khasminskii)"


class Severity(StrEnum):
    """How much a message means: something failed, its number is limited, or a theory beside it is not valid."""

    FAILURE = "failure"
    WARNING = "warning"
    NOTE = "note"


class Remedy(StrEnum):
    """What to do: keys are those of a case file, and the arguments of Python with the same names."""

    MESH = "use more cells ([mesh] phi_cells, xi_cells), a wider noise interval (xi_min, xi_max) or no [mesh]"
    CELLS = "use more cells in [mesh], or a smaller rtol where there is none"
    REACH = "use a [mesh] that reaches there, or no [mesh]"
    BUDGET = "a larger rtol takes less"
    MANY = (
        "a larger rtol takes less. Λ(2) takes little and bounds the others: Λ(p) <= p Λ(2)/2 for 0 < p < 2, λ <= "
        "Λ(2)/2. `fpsolve simulate` estimates them"
    )
    BESIDE = (
        "ask for p = -0.99 and p = -1.01 instead, as two eigenvalues may meet at p = -1. As Λ(p) is convex, Λ(-1) is "
        "at most the mean of both"
    )
    SMALLER_RTOL = "use a smaller rtol"
    ROUNDING = "accept this accuracy, which rounding limits"
    BOTH_AXES = "use more cells, in the phase and in the noise"
    PHASE = "use more cells in the phase"
    DEGREES = "use more or higher-degree cells"
    MESH_FILE = "make one with `fpsolve mesh`"
    REDUCTION = 'or treatment = "ou-reduction"'
    NO_REDUCTION = 'treatment = "exact" keeps Eq. (7)'
    SIMULATION = "or simulate it, see [monte_carlo] and `fpsolve simulate`"
    FOLDER = "choose another --out"
    MEMORY = "use a smaller [budget], or fewer --jobs"


@unique
class Code(Enum):
    """What is said: a name, with its severity and the template of its words.

    A template is that of `str.format`. A value that is None is shown as nothing, one of several as a list; after "?" a
    field has the words for a value that is there and, after "¦", for None or False; "more2" is a limit that allows for
    twice a value. A `remedy` that the template does not name ends the message. The datum `size` tells how bad it is.
    """

    def __init__(self, text: str) -> None:
        severity, _, self.template = text.partition(": ")
        self.severity = Severity(severity)

    TEXT = "failure: {text}"
    PLACED = "failure: {place}: {reason}"
    SEVERAL = "failure: {reasons}"

    TAILS = (
        "failure: {what} is not computed: for r0 > 1 the noise has algebraic tails. Λ(p) is infinite for p > 0 and p < "
        "-1; between, paths far out carry it, beyond any truncated domain. Take λ, or choose r0 <= 1, {remedy}"
    )
    EVEN_ONLY = (
        "failure: {what} is not computed: of {count} variables{is_struck:? under impulses¦} fpsolve finds Λ(p) for "
        "even p > 0 alone, by closed moment equations. As Λ(p) is convex, λ <= Λ(2)/2 and Λ(p) <= (p/2) Λ(2) for 0 < p "
        "< 2. Take even p, {remedy}"
    )
    DELAY_ONLY = (
        "failure: {what} is not computed: with a delay fpsolve finds Λ(2) alone. As Λ(p) is convex, λ <= Λ(2)/2 and "
        "Λ(p) <= (p/2) Λ(2) for 0 < p < 2. Take p = 2, {remedy}"
    )
    WALL_SIMULATED = (
        "failure: {what} is not computed: at a wall of more than two variables the moment equations do not close. "
        "There are finite elements for four variables alone, without impulses. Leave out the wall, {remedy}"
    )
    CONVEX_BOUNDS = (
        "note: Λ(p) is convex, and Λ(0) = 0. Hence λ <= Λ({p:g})/{p:g} <= {bound:.6g}. Also Λ(q) <= (q/{p:g}) Λ({p:g}) "
        "for 0 < q < {p:g}{root:?; δ_p is ¦}{root}"
    )
    INVARIANT_RAY = (
        "failure: Λ({p:g}) is not known: the phase never leaves the ray at phi = {phase:.6g}, whatever the noise does. "
        "The start decides how often the phase passes a jump; remove the jumps"
    )
    NEGATIVE_OF_SEVERAL = (
        "failure: Λ(p) for p < 0 is not computed: the parts of the motion {parts} do not all drive each other. Then "
        "Λ(p) depends on how the parts grow together; choose p >= 0, or solve each part by itself"
    )
    NO_EIGENFUNCTION = (
        "failure: there is no positive eigenfunction at p = {p:g}: the phase never leaves the ray at phi = "
        "{phase:.6g}, whatever the noise does. For p > 0 Λ(p) is the larger growth rate, on the ray or across it"
    )
    NO_EIGENFUNCTION_OF_BLOCKS = (
        "failure: there is no positive eigenfunction at p = {p:g}: the blocks of variables {blocks} do not all drive "
        "each other. For p > 0 Λ(p) is the largest Λ(p) of a block"
    )
    NO_COMMON_RATE = (
        "failure: Λ″(0) does not exist: two parts of the motion do not mix, and both have λ = {value:.6g}. Λ″(p) jumps "
        "at p = 0"
    )
    KINK = (
        "failure: {p:?Λ({p:g})¦λ} has no derivatives: two parts of the motion do not mix and share this value within "
        "the errors. For other parameters either part may have the larger one"
    )
    CLOSES_BLOCKS = (
        "note: no sensitivities to {key} at {value:g}: fpsolve solves blocks of variables one by one there. For any "
        "other value the blocks drive each other; choose a value close by"
    )
    START_MATTERS = (
        "note: Λ(p) for p < -1, and δ_p < -1, hold for starts near the slower mode: the noise never moves the phase "
        "there. For other starts, such as all variables > 0, both are lower"
    )
    INVARIANT_CLASSES = (
        "note: the phase never leaves the ray at phi = {phase:.6g}: λ is {along:.6g} on the ray and {across:.6g} "
        "across it. Λ(p) holds for starts outside such rays"
    )
    BLOCKS = (
        "note: fpsolve solves the blocks of variables {blocks} one by one{is_hidden:?, in coordinates y in which all "
        "matrices have blocks}. No block drives an earlier one; in this order their λ are {rates:.6g}. Λ(p) holds for "
        "starts that lie in no single block"
    )
    INFINITE_VARIANCE = (
        "failure: the noise has infinite variance, and its standard deviation is the unit of the mesh; choose r0 < 5/3"
    )
    NO_BOUND = (
        "failure: got {key} = {value}; for r0 > 1 the noise of Eq. (7) has algebraic tails. Λ(p) is infinite for p > 0 "
        "and p < -1; between, and for λ, no trial function is known to prove a bound. Choose r0 <= 1, {remedy}"
    )

    UNDERFLOW = "failure: P_s underflows in a cell of the noise; use a narrower interval"
    DEPENDENT = (
        "failure: elements of degree {degree} are linearly dependent up to rounding, as P_s falls too far within a "
        "cell of the noise. Use more cells, cells of a lower degree, or a narrower interval"
    )
    NO_IMPACT_LINE = (
        "failure: {wanted} impact line(s) expected at phi = {place} + k pi, {found} found; put a line of the mesh at "
        "each impact"
    )

    NOT_CONVERGED = "failure: Λ({p:g}) did not converge: {reason}"
    NOT_SOLVED = "failure: Λ({p:g}) cannot be solved ({reason})"
    OUT_OF_RANGE = "failure: Λ({p:g}) is beyond floating-point numbers ({reason})"
    NEAR_ZERO = "failure: Λ(p) near p = 0 follows from Λ({p:g}), and {reason}"
    NOT_FINER = "failure: Λ({p:g}) was not found on a finer mesh: {reason}"
    NO_EIGENVALUE = (
        "failure: the principal eigenvalue at p = {p:g} was not found on this mesh: its backward error is "
        "{residual:.1e} (at most {limit:g}). Of T or T*, whichever is more positive, {size:.1e} has the wrong sign (at "
        "most {most:g})"
    )
    LARGER_EIGENVALUE = (
        "failure: at p = {p:g} the eigenvalue {rightmost:.6g} lies to the right of {value:.6g}, although the "
        "eigenfunctions of {value:.6g} have one sign"
    )
    NO_ARNOLDI = "failure: the Arnoldi iteration for p = {p:g} did not converge"
    UNKNOWNS_SPENT = (
        "failure: it needs {unknowns:,} unknowns; the limit is {most:,} (try --set budget.unknowns={unknowns:more1.1})"
    )
    SECONDS_SPENT = (
        "failure: this parameter set needs some {seconds:.3g} s of processor time; the limit is {most:g} s (try --set "
        "budget.seconds={seconds:more2})"
    )
    NO_PAIR = "failure: there is no eigenfunction at p = {p:g} of this kind of problem"
    MESHES_SPENT = "failure: none of {count} meshes resolved it"
    ROUNDED = "failure: rounding alone may change it by {size:.1e}; use a larger rtol"
    NOTHING_RESOLVED = (
        "failure: Λ({p:g}) was not found: {reason}{is_thin:?. The layers of slow, strong noise are too thin for all "
        "meshes}{last:? ({last})}"
    )
    BUDGET_SPENT = (
        "failure: Λ({p:g}) was not found: {reason}. The best value {value:.6g} has an estimated error of {error:.1e}, "
        "{size:.2g} times the tolerance"
    )
    MEANINGLESS = (
        "failure: {p:?Λ({p:g})¦{symbol}} = {value:.6g} has an estimated error of {size:.1g}, too much to mean anything"
    )
    NO_FUNCTION = (
        "failure: there is no function Λ(p) from p = {low:g} to p = {high:g}; ask for single p. No space serves all p, "
        "several places or blocks carry moments, two eigenvalues cross, or there are more than two variables"
    )
    NOT_CONVEX = (
        "failure: the computed Λ(p) is not convex between p = {p:g} and p = {other:g}, while the exponent is: a wrong "
        "eigenvalue was found"
    )
    NOT_PRINCIPAL = (
        "failure: the eigenvalue {value:.10g} at p = {p:g} is not the principal one. Λ is convex, and the moment "
        "equations give Λ({other:g}) = {expected:.10g}"
    )
    NOT_INCREASING = "failure: Λ(p)/p does not increase at p = {p:g}, while it must, as Λ is convex"
    NEGATIVE_DENSITY = "failure: the {name} at p = {p:g} is not resolved: {size:.0%} of it is negative"
    SIMULATION_OVERFLOWED = "failure: the simulation overflowed: some ξ is too large for this step; use a smaller step"

    RTOL_MISSED = (
        "warning: rtol = {rtol:g} is not met at {count} of {of} moments. The worst, p = {p:g}, has an estimated "
        "relative error of {size:.1e}; {remedy}, or accept it by rtol = {size:more1.1}"
    )
    NUMBER_RTOL_MISSED = (
        "warning: rtol = {rtol:g} is not met by {symbol}: {value:.6g} has an estimated error of {error:.1e}. Accept it "
        "by rtol = {size:more1.1}, or {remedy:?{remedy}¦use a smaller rtol for a finer mesh}"
    )
    CARRIED_ELSEWHERE = (
        "warning: Λ({p:g}) may be larger: slow noise may carry the moment near {z:.3g} standard deviations"
    )
    UNREADABLE = (
        "warning: {name} at p = {p:g} is not resolved: {size:.0%} of it has the wrong sign. This hardly affects Λ, but "
        "do not rely on a picture of it"
    )
    ROUGH_DENSITY = (
        "warning: the densities of directions at p = {p:g} are rough: {size:?finer functions move {size:.0%} of "
        "them¦fpsolve compared no finer functions}. This hardly affects Λ, but do not rely on their details"
    )
    FINE_DENSITY = (
        "warning: the densities of directions at p = {p:g} are finer than the nodes of their pictures, which miss "
        "{size:.1%} of them. This hardly affects Λ, but do not rely on their heights"
    )
    NOTHING_DRAWN = (
        "warning: fpsolve draws neither the stationary density nor eigenfunctions (λ and Λ(p) keep their stated "
        "errors): {reason}"
    )

    NUMBER_FAILED = "failure: fpsolve found no {symbols}: {reason}"
    NUMBER_MISSING = "warning: fpsolve found no {symbols}: {reason}"
    NUMBER_ABSENT = "note: there is no {symbols}: {reason}"
    NO_MOMENT = "failure: fpsolve found no Λ({p:g})"
    NOT_DRIVEN = "note: no noise moves the state, so that Λ(p) is λ p and has no other root"
    NO_ROOT = (
        "note: Λ(p) has no root p ≠ 0 in [{low:g}, {high:g}]{is_bounded:?. It may have none at all: with bounded noise "
        "P(sup ‖x‖ > A) may fall faster than any power of A}"
    )
    UNFINISHED = "failure: not everything is solved yet; run the same command again to go on"
    LINEAR = "note: there is no δ_p, as Λ(p) is {value:.6g} p for all p, to its error"
    NO_ROOT_REACHED = "note: no δ_p was found in [{low:g}, {high:g}]; beyond, {reason}"
    EXCURSION_OPEN = (
        "note: λ = {value:.3g} cannot be distinguished from 0 within its error, {error:.1g}, so that nothing is known "
        "of P(sup ‖x‖ ≥ A)"
    )
    EXCURSION_BEYOND = (
        "note: no δ_p was found up to p = {high:g}: E‖x‖^p decays for all of these p. P(sup ‖x‖ ≥ A) falls faster than "
        "A^-{high:g}"
    )
    EXCURSION_NO_INDEX = "note: there is no δ_p, and so no bound of P(sup ‖x‖ ≥ A): {reason}"
    EXCURSION_PLANE = (
        "note: P(sup ‖x‖ ≥ A) has bounds for two variables only, and here are {count}; δ_p is its exponent"
    )
    EXCURSION_RAY = (
        "note: P(sup ‖x‖ ≥ A) has no bounds, as no eigenfunction is positive everywhere. The phase never leaves the "
        "ray at phi = {phase:.6g}; δ_p is the exponent for starts outside such rays"
    )
    EXCURSION_UNBOUNDED = (
        "note: as the noise is unbounded, no bounds of P(sup ‖x‖ ≥ A) hold for every A. Its exponent is δ_p, and the "
        "mean number of upcrossings bounds it for large A"
    )
    EXCURSION_NO_UPPER = (
        "note: P(sup ‖x‖ ≥ A) has no upper bound: the least T is {value:.2g} ± {error:.1g} and may be 0; use a smaller "
        "rtol"
    )
    EXCURSION_UNRESOLVED = "failure: T at p = δ_p is not resolved, as no finer discretisation could be made"
    NOT_ONE_RAY = "note: the motion has impacts on {count:?{count}¦no} rays, and it is computed for one ray only"
    RARE_IMPACTS = (
        "note: N < {most:.1g} cannot be distinguished from 0, as if the motion did not turn; so R does not change λ"
    )
    LOG_OUT_OF_RANGE = "note: its logarithm is {value:.3g}, beyond ±{most:g}"
    NO_RESTITUTION = "note: the motion has no coefficient of restitution"
    ALWAYS_STABLE = "note: almost surely stable for every {symbol} in (0, 1], as λ without loss is {value:.3g}"
    ALWAYS_UNSTABLE = "note: unstable for every {symbol} in (0, 1]: λ = 0 would need {symbol} = {value:.3g}"

    NOISE_MISFIT = (
        "warning: near {name} the given density is {relative:+.1%} off the best fit. So fpsolve fits it there, and "
        "less well elsewhere; take another kind of noise, or more terms"
    )
    AS_READ = "note: {text}"
    FIT_STOPPED = (
        "warning: the search for the parameters was stopped after {steps} steps, so that another noise may fit better; "
        "use fewer terms, or another kind"
    )
    NO_SPECTRUM_ERROR = (
        "note: the errors of the measured values are not known. The scatter of neighbouring values gives them; state "
        "how many averages they are of"
    )
    UNTOLD_PARAMETERS = (
        "warning: the values do not determine all parameters of the fit. The errors of the parameters are unknown, "
        "that of the density is known; use fewer terms, or another kind"
    )
    SHORT_RECORD = (
        "warning: the record is {times:.3g} correlation times long, too few for its standard errors; use a record of "
        "at least {least:g}"
    )
    FAR_FROM_GAUSSIAN = (
        "note: the Ornstein-Uhlenbeck reduction is meant for r0 near 1, but |r0 - 1| = {departure:.3g} > {most:g}. Its "
        "variance is {reduced:.4g}, and Eq. (10) gives {variance:.4g} for the noise itself"
    )
    IMPOSSIBLE_BOUNCE = (
        "note: 1 - epsilon^2 (1 - r) = {left:.3g} <= 0: no bounce of Eq. (3) loses so much. R = {factor:.3g} follows "
        "from the delta law only"
    )
    STRONG_NOISE = (
        "note: perturbation theory, Eq. (37), is for weak noise{is_reduced:?, and here for the reduced noise}. Do not "
        "rely on it from |p| = {first:.3g} on, where Λ(p) differs from it by more than {most:.0%} of its terms. The "
        "largest difference is {rest:.3g}, {size:.0%} of them, at p = {p:.3g}"
    )
    LOAD_LEFT_OUT = (
        "note: no perturbation theory, Eq. (37), beside these numbers: it leaves out a harmonic load, as {keys} is"
    )
    NO_SENSITIVITIES = "note: no sensitivities of {p:?Λ({p:g})¦{symbol}}: {reason}"
    UNUSED = "note: {keys}: no rate and no restitution has it, so that no result depends on it"
    NO_DERIVATIVE = "note: no sensitivities to {key}: the derivative of the system by it is not finite at {value:g}"
    ONE_SIDED = (
        "note: the sensitivities to {key} = {value:g} are derivatives from below: above this value the noise has "
        "algebraic tails"
    )

    NO_PROBLEM = "failure: no such problem: {reason}"
    NOWHERE = "note: {symbol} exists nowhere in the frame"
    UNSOLVED = "failure: fpsolve found {symbol} at no point of the frame: {reason}"
    NO_LINE = "note: no line {line} was found, though {symbol} changes its sign in the frame"
    ONE_SIGN = "note: {side} {is_whole:?everywhere¦wherever it exists} in the frame"
    LINE_ENDS = "note: the line {line} ends inside of the frame: {reason}"
    HOLES = "note: {symbol} is missing in part of the frame: {reason}"
    NEWTON_UNSETTLED = "failure: Newton's method for the line does not converge"
    TOO_SHARP = "failure: the line turns too sharply, as it does where it meets another branch"
    TOO_LONG = "failure: the line has more than {count} points"
    ROW_SPENT = "failure: a row of the grid has used up its {most:.3g} s of processor time; use a larger {key}"
    LINE_SPENT = "failure: the line has used up budget.line_seconds = {most:g} of processor time; use a larger one"
    DEAR_CHART = (
        "note: fpsolve solves {lines} at {nodes} points of a grid, and at {few} to {many} along each branch, for "
        "seconds each. It keeps all that is solved. A smaller chart.nodes or a larger chart.step asks for less"
    )
    LINE_STOPPED = "note: the line {line} is not traced to its end, and may have more branches: {reason}"

    UNREACHED = (
        "warning: {target} cannot be reached with {frame}: {side:?{side} everywhere¦{symbol} is from {least:.6g} to "
        "{most:.6g}} there. It comes nearest at {place}; use a wider range, or other parameters"
    )
    DESIGN_GAPS = (
        "failure: {target} was not found{count:?, and Λ could not be solved at {count} of the values tried}: {reason}"
    )

    FEW_PATHS = (
        "warning: no estimate of Λ(p) at p = {p:g}: too few effective {is_direct:?windows¦paths} carry the mean. There "
        'are {low:.0f}{high:? to {high:.0f}}, and {needed} are needed; use {is_direct:?estimator = "population", or '
        "more paths¦more paths}"
    )
    TWO_PLACES = (
        "warning: Λ({p:g}): populations that start in two places of the noise differ by {gap:.3g}, which is {size:.0f} "
        "standard errors. The noise is too slow to pass between the places; the larger value is given"
    )
    DRIFTING = (
        "warning: Λ({p:g}) still drifts: over the simulation it changes by {size:.1f} standard errors, and {most:g} "
        "are usual. Its standard error does not include this; use {is_direct:?a longer window¦more time}"
    )
    STOPPED = "warning: stopped early, after {share:.0%} of the time"
    AT_REST = (
        "warning: no stationary response: λ = {value:.3g} ± {error:.1e} {most:?is not {most:g} standard errors above "
        "0¦is not positive}. If λ < 0, almost every path comes to rest"
    )
    RESPONSE_LINEAR = (
        "note: no stationary response: in this linear system nothing limits the amplitude. A response needs an "
        "oscillator with c2 or c3 > 0, terms of degree 3, or a noise alone, as in + xi"
    )
    RESPONSE_GROWS = (
        "note: no stationary response is computed: without noise the terms of degree 3 hardly limit large amplitudes, "
        "if at all. Add damping of degree 3, or change its sign"
    )
    RESPONSE_RAYS = (
        "note: no stationary density by finite elements: the phase never leaves φ = {phase:.6g}, whatever the noise "
        "does; simulate the response instead"
    )
    RESPONSE_WALLS = (
        "note: no stationary response is computed for these walls. There may be one wall, where a variable is 0 whose "
        "rate is c times the other one, c > 0; leave out the others"
    )
    RESPONSE_NOISE = (
        "note: no stationary response is computed for this noise. It must be one noise with a density: no white noise, "
        "impulses or chains. For white noise take coloured noise with a short memory"
    )
    RESPONSE_TAILS = (
        "note: no stationary density by finite elements: for r0 > 1 the noise has algebraic tails. Then δ_p, which "
        "gives the density near rest, is not computed; use r0 <= 1, or simulate the response"
    )
    RESPONSE_DIES = (
        "note: no stationary response: λ = {value:.6g} ± {error:.1g} is not positive, so that almost every path comes "
        "to rest"
    )
    RESPONSE_UNSTABLE = (
        "note: no stationary response: Λ(2) = {value:.6g} ± {error:.1g} is not negative, so that mean squares do not "
        "settle"
    )
    RESPONSE_NO_INDEX = (
        "note: no stationary density by finite elements: there is no δ_p: {reason}; simulate the response instead"
    )
    RESPONSE_OPEN = (
        "failure: the stationary response did not converge: its means still change by {size:.1e} of them{unknowns:?. "
        "The next discretisation needs {unknowns:,} unknowns; the limit is {most:,}}. Try --set "
        "response.rtol={size:more1.1}"
    )
    RESPONSE_STOPPED = "warning: the simulation of the response was stopped early, after the time {time:.3g}"
    RESPONSE_NOT_REACHED = "warning: no stationary response: stopped before it was reached"

    NO_REPORT = "warning: no {file}: {kind}: {text} (a fault of fpsolve; all other files are written)"
    NO_PICTURE = "note: this picture could not be drawn: {reason}"

    NO_MEMORY = "failure: not enough memory"
    FAULT = "failure: {kind}: {text} (a fault of fpsolve, in {file}:{line})"
    BEING_WRITTEN = "failure: {place} is being written by another run; wait for it, or {remedy}"


class Message(str):
    """Something that is said: a text in the words of Python that knows its code and its data; it pickles.

    Attributes:
        code: what is said.
        data: numbers, texts, further messages (such as a `reason`), tuples of them, and a `remedy` where there is one.
    """

    code: Code
    data: Mapping[str, Any]

    def __new__(cls, code: Code, **data: Any) -> Message:
        """A message of a code; numpy's numbers and arrays become Python's numbers and tuples."""
        known = {key: _python(value) for key, value in data.items()}
        made = super().__new__(cls, _words(code, known))
        made.__dict__.update(code=code, data=MappingProxyType(known))
        return made

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a message is not changed: {name}")

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Message, self.code, **self.data), ()

    @property
    def severity(self) -> Severity:
        """How much it means."""
        return self.code.severity

    @property
    def kind(self) -> tuple[Any, ...]:
        """What it has in common with messages that differ in numbers only."""
        return self.code, *((key, _without_numbers(value)) for key, value in self.data.items())

    @property
    def size(self) -> float | None:
        """How bad it is, or else the first of its reasons that tells; None where nothing does."""
        own: float | None = self.data.get("size")
        return own if own is not None else next((each.size for each in self.reasons() if each.size is not None), None)

    def reasons(self) -> Iterator[Message]:
        """The messages among its data."""
        return (value for value in self.data.values() if type(value) is Message)

    def tells_of(self, code: Code) -> bool:
        """Whether it, or a reason of it, has a code."""
        return self.code is code or any(each.tells_of(code) for each in self.reasons())

    def advising(self, remedy: str | None) -> Message:
        """The message with another remedy, or without one."""
        others = {key: value for key, value in self.data.items() if key != "remedy"}
        return Message(self.code, **others, **({"remedy": remedy} if remedy else {}))

    @classmethod
    def __get_pydantic_core_schema__(cls, *_: Any) -> Any:
        """What pydantic writes of a message, and makes it of again."""
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(
            Message.from_data, serialization=core_schema.plain_serializer_function_ser_schema(Message.to_data)
        )

    def to_data(self) -> dict[str, Any]:
        """What Python's JSON can hold, from which `from_data` makes it again."""
        return {"code": self.code.name, "data": {key: _plain(value) for key, value in self.data.items()}}

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Message:
        """The inverse of `to_data`. Raises `ValueError` where it is none."""
        try:
            return cls(Code[data["code"]], **{key: _made(value) for key, value in data["data"].items()})
        except (KeyError, TypeError, AttributeError) as failure:
            raise ValueError(f"this is no message: {failure!r}") from failure


def message_of(text: str) -> Message:
    """A text as a message, without the middle of long lines; a message as it is."""
    return text if type(text) is Message else Message(Code.TEXT, text="\n".join(map(short, text.split("\n"))))


def short(line: str) -> str:
    """A line of a message without its middle where it repeats something long."""
    return line if len(line) <= LONGEST else f"{line[: LONGEST // 2]} ... {line[-LONGEST // 2 :]}"


def is_control(letter: str) -> bool:
    """Whether a letter is none to be printed: a control character, one that turns or hides text, half a letter."""
    return category(letter)[0] == "C" or letter in "\u2028\u2029"


def escaped(text: str) -> str:
    """A text in which control characters, but for line ends, are shown as in Python, ESC as \\x1b."""
    return "".join(
        each.encode("unicode_escape").decode() if is_control(each) and each != "\n" else each for each in text
    )


def _words(code: Code, data: Mapping[str, Any]) -> str:
    ending = "; {remedy}" if data.get("remedy") is not None and "{remedy" not in code.template else ""
    return _Writer().vformat(code.template + ending, (), data)


class _Writer(Formatter):
    """Fills templates."""

    def get_value(self, key: int | str, args: Any, kwargs: Mapping[str, Any]) -> Any:
        return kwargs.get(str(key))

    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec.startswith("?"):
            present, _, absent = format_spec[1:].partition("¦")
            return absent if value is None or value is False else present
        if format_spec.startswith("more"):
            return _more(value, float(format_spec[4:]))
        if type(value) is tuple:
            separator = "\n" if Message in map(type, value) else ", "
            return separator.join(self.format_field(each, format_spec) for each in value)
        return str(value) if type(value) is Message else "" if value is None else format(value, format_spec)


def _more(value: float | None, factor: float) -> str:
    """A number with two digits, larger by a factor or more: "120000" for 100548 and 1.1; "..." where there is none."""
    if not value or not math.isfinite(value):
        return "..."
    step = 10.0 ** (math.floor(math.log10(factor * value)) - 1)
    found = math.ceil(factor * value / step) * step
    return f"{found:.0f}" if step >= 1 else f"{found:.2g}"


def _python(value: Any) -> Any:
    value = value.tolist() if hasattr(value, "tolist") else value
    return tuple(map(_python, value)) if isinstance(value, list | tuple) else value


def _without_numbers(value: Any) -> Any:
    """A datum of which numbers do not count, nor how many like ones there are."""
    if type(value) is Message:
        return value.kind
    if type(value) is tuple:
        return tuple(dict.fromkeys(map(_without_numbers, value)))
    return "#" if type(value) in (int, float) else value


def _plain(value: Any) -> Any:
    """A datum as JSON can hold it."""
    if type(value) is Message:
        return value.to_data()
    return [*map(_plain, value)] if type(value) is tuple else value


def _made(value: Any) -> Any:
    """The datum of what `_plain` gave; the text of a remedy is one."""
    if type(value) is dict:
        return Message.from_data(value)
    if type(value) is list:
        return tuple(map(_made, value))
    return Remedy(value) if value in _REMEDIES else value


_REMEDIES = {*Remedy}
