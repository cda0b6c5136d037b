"""How Λ(p) of one kind of problem is found: what each kind has, and how accurately and at what cost it is asked for."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, real_numbers
from fpsolve.budget import Meter, OverBudget, charge
from fpsolve.errors import FpsolveError, MeshError, NoHierarchy, NoSuchExponent, NotConverged, SingularMatrix
from fpsolve.exponent.changed import Changed
from fpsolve.exponent.eigen import PairDerivatives, PrincipalPair
from fpsolve.exponent.error import MEANINGLESS, Absent, Estimate, Moment
from fpsolve.fem.factors import one_thread
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.space import Space
from fpsolve.messages import ALMOST_EVERY, Code, Message, Remedy
from fpsolve.model.coordinates import infinite
from fpsolve.model.faults import strict_dataclass
from fpsolve.model.parameters import parameter
from fpsolve.model.problem import ParameterDerivative, Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT, VARIANCE_RATE
from fpsolve.theory.perturbation import Scale, scale_of

RTOL = 1e-8
"""Relative error that is wanted of two variables where a case names none."""
RTOL_OF_SEVERAL = 1e-6
"""Relative error that is wanted of two variables under two noises that are not white."""
RTOLS = {"gt": 1e-13, "lt": 1}
"""The range of rtol."""
RTOL_BEYOND_PLANE = 1e-5
"""Relative error that is wanted of three and four variables."""
SMALL_P = 1e-2
"""For smaller |p| the discretisation is chosen at this one, as Λ and its error go to zero together."""
TINY_P = 1e-3
"""Below it Λ(p)/p is a mean of Λ′, as rounding is not proportional to p."""
NEAR_ZERO = 1e-4
"""For smaller |p| ∂Λ/∂θ / p is taken from its derivatives at p = 0."""
TINIEST_P = 1e-9
"""For smaller |p| the error of Λ(p), which falls as p, has no scale, which may fall as p²: p counts as 0."""
NEGLIGIBLE_P = 1e-30
"""Pairs at smaller |p| are those at p = 0, from which they differ by less than by rounding."""
MAX_STAGES = 60
"""Number of stages of a search, of all its places."""
UNSOLVED = MeshError, NoHierarchy, NotConverged, SingularMatrix, np.linalg.LinAlgError
"""What is raised where functions do not have the principal pair, so that others are tried."""
Tolerance = Callable[[float, float], float]
"""The largest error allowed, from p and a value of Λ(p)."""
Along = Mapping[str, ParameterDerivative]
"""Directions in which a problem changes, by name."""


@strict_dataclass
class Budget:
    """The limits of cost of the numbers of a parameter set, and of a line of a chart.

    No number depends on the seconds. With few unknowns a number may be less accurate than with more, within its error.

    Args:
        unknowns: of the largest system; None for as many as 1.5 GB hold, see `Space.most_unknowns`.
        seconds: of a processor for all numbers of a parameter set together, asked before each factorisation. The nodes
            of a row of a scan share it; each may take half of the rest.
        line_seconds: of a processor for a line of a chart, its scan, which may take half of them, and its branches;
            None for any time.

    Raises:
        ParameterError: a number is out of its range.
    """

    unknowns: Annotated[
        int | None,
        parameter("number of unknowns of the largest system; if omitted, what 1.5 GB hold", "unknowns = 80000", ge=100),
    ] = None
    seconds: Annotated[
        float, parameter("seconds of processor time for all numbers of a parameter set", "seconds = 120.0", gt=0)
    ] = 120.0
    line_seconds: Annotated[
        float | None, parameter("seconds of processor time for a line of a chart", "line_seconds = 600.0", gt=0)
    ] = None

    def most(self, stage: Stage | Space) -> int:
        """Number of unknowns that a space, or a stage, may have."""
        return self.unknowns or stage.most_unknowns

    def meter(self) -> Meter:
        """For the numbers of a parameter set."""
        return Meter(self.seconds)


BUDGET: Budget = Budget()
"""The usual one."""


@dataclass(frozen=True, eq=False)
class Settings:
    """How accurately Λ(p) is found, and at what cost.

    Attributes:
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel).
        of_value: |error| ≤ of_value·|Λ| is enough, too, as for a sign.
        mesh: for all p; None chooses a discretisation for each p.
        budget: what it may cost.
        meter: of all numbers of the problem.
    """

    rtol: float = RTOL
    of_value: float = 0.0
    mesh: CylinderMesh | None = None
    budget: Budget = BUDGET
    meter: Meter = field(default_factory=lambda: Meter(math.inf))


class Pictures(NamedTuple):
    """What is drawn of T, T* and T T*.

    Attributes:
        part: the part of a case that draws it.
        most: of so many p where a case names none.
        is_seen: whether they are over phase and noise, in cells whose extremes can be told; one is drawn unasked.
    """

    part: str
    most: int
    is_seen: bool


PHASE_AND_NOISE: Pictures = Pictures("eigenfunctions", 9, is_seen=True)
DIRECTIONS: Pictures = Pictures("directions", 3, is_seen=False)  # which take seconds each


class Method:
    """The method for Λ(p) of one kind of problem.

    A kind of one's own is a class with `takes`, `solution` and, for charts and designs, `gradient`. It stands before
    the others in `kinds.METHODS`.

    Args:
        problem: of this kind.
        settings: how accurately, and at what cost.
        choose: gives the method of another problem, such as a part of this one.

    Attributes:
        name: what the numbers come from, as tables say it.
        usual_rtol: the error that is wanted where none is named.
        pictures: what is drawn of its functions.
        no_picture: why they cannot be drawn; empty where they can.
        adapts: whether a discretisation is chosen for each p.
        is_function: whether Λ may be interpolated over p.
        turns_back: whether noise turns the phase back, so that Λ has branch points beside real p, and it is quick.
        is_quick: whether Λ(p) at many p takes less than a second.
        by_moments: whether Λ(p) of even p is that of the equations of the moments.
        ray: φ of a ray that the phase never leaves; None where there is none.
        is_computed: whether there is any Λ(p).
        spaces: solutions on elements, by p.
        remedy: what to do where it is not resolved, or a budget does not suffice.
    """

    name = "finite elements"
    usual_rtol = RTOL
    pictures = DIRECTIONS
    no_picture = ""
    adapts = True
    is_function = turns_back = False
    is_quick = False
    by_moments = False
    ray: float | None = None
    is_computed = True
    spaces: Mapping[float, Any] = MappingProxyType({})
    remedy: Remedy | None = None

    def __init__(self, problem: Problem, settings: Settings, choose: Callable[[Problem, Settings], Method]) -> None:
        self.problem, self.settings, self.choose = problem, settings, choose

    @classmethod
    def takes(cls, problem: Problem) -> bool:
        """Whether a problem is of this kind."""
        raise NotImplementedError

    def has(self, p: float) -> bool:
        """Whether Λ(p) of problems of this kind is computed, at p = 0 λ and other numbers of eigenfunctions."""
        return True

    def reason(self, p: float, symbol: str = "") -> Message | None:
        """Why there is no Λ(p), at p = 0 no λ, nor another number of eigenfunctions; None where it is computed.

        Args:
            p: the moment.
            symbol: what the number is called; that of Λ(p) or λ if none is given.
        """
        return infinite(self.problem, p, symbol)

    @property
    def has_pairs(self) -> bool:
        """Whether there is λ."""
        return self.reason(0.0) is None

    @property
    def lacks_moments(self) -> bool:
        """Whether there is no Λ(p) of some p, as of p > 0 for algebraic tails, and of all but even p by equations."""
        return bool(self.reason(1.0))

    @property
    def interval(self) -> tuple[float, float]:
        """The interval of p in which every Λ(p) is computed; 0 alone where only some are."""
        return (0.0, 0.0) if self.lacks_moments else (-math.inf, math.inf)

    @property
    def goes_on(self) -> bool:
        """Whether numbers of an earlier run do in place of solutions, which others need for their messages."""
        return not self.lacks_moments

    def is_dear(self, p: float) -> bool:
        """Whether Λ(p) takes elements of three axes or more, and so seconds."""
        return False

    def line_rtol(self, p: float) -> float:
        """The error of Λ(p) on a line of a chart, over its scale."""
        return 1e-3 if self.is_dear(p) else 1e-10

    @cached_property
    def scales(self) -> Scale:
        """What errors are measured by, see `scale_of`: in weak noise the sizes of the terms of Eq. (37)."""
        return scale_of(self.problem)

    def scale(self, p: float) -> float:
        """What the error of Λ(p) is measured by: in weak noise the sum of the sizes of the terms of Eq. (37)."""
        return float(self.scales.moment(p))

    def tolerance(self, p: float, value: float) -> float:
        """The largest error allowed of Λ(p), a share of it or of the terms of Eq. (37) before they cancel."""
        rtol, of_value = self.settings.rtol, self.settings.of_value
        return max(rtol * self.scale(p), max(rtol, of_value) * abs(value))

    def check(self, p: float, value: float, error: float) -> None:
        """Refuse a value of Λ(p) of which its error leaves nothing. Raises `NotConverged`."""
        self.checked(Estimate(value, error, self.scale(p)), p)

    def checked(self, estimate: Estimate, p: float | None = None) -> Estimate:
        """An estimate, such as that of Λ(p), whose error leaves it a meaning. Raises `NotConverged`."""
        if not estimate.relative_error <= MEANINGLESS:
            symbol, size = estimate.quantity.symbol if p is None else "Λ(p)", estimate.error_estimate
            told = Message(Code.MEANINGLESS, p=p, symbol=symbol, value=estimate.value, size=size)
            raise NotConverged(told, estimate, self.refinement)
        return estimate

    @property
    def refinement(self) -> Remedy:
        """The remedy for a poor resolution."""
        return Remedy.SMALLER_RTOL if self.adapts else Remedy.MESH

    @contextmanager
    def solving(self, p: float) -> Iterator[None]:
        """In the body one thread runs, whose seconds count.

        Raises:
            NotConverged: the functions cannot be made, numbers are too large, or there is not enough memory.
        """
        try:
            with one_thread(), self.settings.meter.running():
                yield
        except (MeshError, NoHierarchy) as failure:
            told = Message(Code.NOT_CONVERGED, p=p, reason=failure.message)
            raise NotConverged(told, remedy=self.remedy) from failure
        except (SingularMatrix, np.linalg.LinAlgError) as failure:
            raise NotConverged(Message(Code.NOT_SOLVED, p=p, reason=str(failure)), remedy=self.remedy) from failure
        except ArithmeticError as failure:
            raise NotConverged(Message(Code.OUT_OF_RANGE, p=p, reason=str(failure))) from failure
        except MemoryError as failure:
            raise NotConverged(Message(Code.NO_MEMORY), remedy=Remedy.MEMORY) from failure

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Any:
        """What is solved at p, within a tolerance, that of rtol if none is given.

        It has `value`, `error` and `derivative`.

        Raises:
            NotConverged: it is not resolved, or the budget does not suffice.
        """
        raise NotImplementedError

    def row(self, p: float) -> Moment:
        """Λ(p), its slope and error. Raises `NotConverged`."""
        return Moment.of(self.preferred_even(p) or self.solution(p))

    def pair(self, p: float) -> PrincipalPair:
        """The principal eigenpair at p. Raises `NotConverged`, `NoSuchExponent`."""
        refuse(self.reason(0.0, "an eigenfunction"))
        raise NoSuchExponent(Message(Code.NO_PAIR, p=p))

    def even(self, p: float) -> Any:
        """Λ(p) of an even p by equations without directions, as a witness; None where there is none."""
        return None

    def preferred_even(self, p: float) -> Any:
        """What `even` gives, where this method prefers it to any other Λ(p); else None."""
        return None

    def ratio_alone(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float]:
        """Λ(p)/p, at p = 0 λ, and its error."""
        found = self.preferred_even(p) or self.solution(p, tolerance)
        return (found.value / p, found.error / abs(p)) if p else (found.derivative, found.error)

    def ratio(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float, float]:
        """Λ(p)/p, its derivative in p, and the error of the first."""
        refuse(self.reason(0.0, "λ, or another number that follows from eigenfunctions,"))
        value, error = self.ratio_alone(p, tolerance)
        return value, (self.solution(p, tolerance).derivative - value) / p if p else math.nan, error

    def slope_error(self, p: float) -> float:
        """Estimate of |error of Λ′(p)|; NaN where none is known. Raises `NotConverged`."""
        return math.nan

    def lyapunov_exponent(self) -> Estimate:
        """λ, Eq. (2), the growth rate of almost every path: Λ′(0) but for algebraic tails. Raises `NotConverged`."""
        value, error = self.ratio_alone(0.0)
        meaning = ALMOST_EVERY if self.lacks_moments else ""
        return self.checked(Estimate(value, error, self.scales.linear, meaning, LYAPUNOV_EXPONENT))

    def finer_pair(self, pair: PrincipalPair) -> PrincipalPair:
        """That at the same p on a finer discretisation, where there are pairs. Raises `NotConverged`."""
        raise NotImplementedError

    @cached_property
    def around_zero(self) -> PairDerivatives:
        """The pair at p = 0 and its derivatives. Raises `NotConverged`, `NoSuchExponent`."""
        return PairDerivatives(self.pair(0.0))

    @cached_property
    def finer_around_zero(self) -> PairDerivatives:
        """That of a finer discretisation, for algebraic tails of a wider one. Raises as `around_zero`."""
        return PairDerivatives(self.finer_pair(self.around_zero.pair))

    def around(self, p: float) -> PairDerivatives:
        """The pair at p and its derivatives; for a small p those at p = 0. Raises as `around_zero`."""
        return PairDerivatives(self.pair(p)) if abs(p) >= NEAR_ZERO else self.around_zero

    def variance_rate(self) -> Estimate:
        """Λ″(0), the asymptotic growth rate of the variance of ln ‖x‖.

        Its error is what a finer discretisation changes in it, and that of λ, as one change is small by chance. Raises
        `NotConverged`.
        """
        refuse(self.reason(1.0, VARIANCE_RATE.symbol))
        scale = 2 * self.scales.quadratic
        value, better = self.around_zero.second_derivative, self.finer_around_zero.second_derivative
        rounding = 10 * sys.float_info.epsilon * max(scale, abs(better))
        error = abs(better - value) + rounding + (self.ratio_alone(0.0)[1] if scale else 0.0)
        return self.checked(Estimate(better, error, scale, quantity=VARIANCE_RATE))

    def gradient(self, p: float, keys: Sequence[str]) -> FloatArray:
        """∂/∂θ of Λ(p)/p, at p = 0 of λ, by parameters. Raises `NotConverged`, `NoSuchExponent`."""
        part, along = self.held(p, {key: self.problem.derivative(key) for key in keys})
        slopes = dict.fromkeys(keys, 0.0)
        if known := part.preferred_even(p):
            slopes |= {key: known.slope(key)[0] / p for key in along}
        else:
            around = part.around(p)
            slopes |= {key: Changed(around, by).ratio(p).value for key, by in along.items()}
        return np.array([*slopes.values()])

    def held(self, p: float, along: Along) -> tuple[Method, Along]:
        """The part whose Λ(p), at p = 0 whose λ, is that of the problem, and those of some directions that change it.

        Raises:
            NoSuchExponent: Λ(p) is that of two parts, so that it has no derivatives by parameters.
            NotConverged: it is that of no part alone, or that of the part is not what a direction changes.
        """
        return self, along

    def closes(self, key: str) -> bool:
        """Whether another value of a parameter makes parts that are solved apart one."""
        return False

    def by_part(self, p: FloatArray) -> tuple[Any, ...]:
        """λ and Λ(p) of each part, where there are several."""
        return ()

    def index_of_parts(self, index: Callable[[Method], Estimate | Absent], nowhere: Absent) -> Estimate | Absent | None:
        """δ_p by those of parts, or that it is nowhere; None where there are no parts."""
        return None

    def bounds(self, p: FloatArray, value: FloatArray, error: FloatArray) -> tuple[Message, ...]:
        """What is known of other numbers."""
        return ()

    def unseen(self) -> Message | None:
        """Why nobody looks at the extremes of T, which bound excursions; None where they are looked at."""
        return None if self.pictures.is_seen else Message(Code.EXCURSION_PLANE, count=self.problem.dimension)

    def doubts(self, p: Sequence[float]) -> tuple[Message, ...]:
        """Warnings about what was solved at some p."""
        return ()


def refuse(reason: Message | None) -> None:
    """Raise `NoSuchExponent` for a reason."""
    if reason:
        raise NoSuchExponent(reason)


def checked_moments(p: ArrayLike, method: Method, *, may_be_empty: bool = False) -> FloatArray:
    """p as an array of shape (n,), each finite, with a Λ(p) that is computed. Raises `ValueError`, `NoSuchExponent`."""
    points = real_numbers(p, "p", may_be_empty=may_be_empty)
    for point in points.tolist():
        refuse(method.reason(point))
    return points


class Stage(Protocol):
    """The functions that Λ(p) is sought among at one place, and which come next. What is found has `value`, `error`."""

    @property
    def size(self) -> int:
        """Number of unknowns."""

    @property
    def most_unknowns(self) -> int:
        """How many are within reach."""

    def solved(self, p: float, near: Any) -> Any:
        """What is found among them, from what was found among others; one of `UNSOLVED` is raised where it is not."""

    def judged(self, found: Any, allowed: float) -> Any:
        """What is found with its error, of which no part much less than what is allowed need be known."""

    def is_enough(self, found: Any) -> bool:
        """Whether what is found within the tolerance needs no more, as for its slope."""
        return True

    def doubled(self, failure: Exception | None) -> Stage | None:
        """More functions, where nothing is found among these; None where that is no use."""
        return None

    def refined(self, found: Any, goal: float, most: int) -> Stage | None:
        """Functions that should have an error of about a goal, or less, with so many unknowns at most."""


@dataclass
class Search:
    """The search for Λ(p) at one p, at one place after the other, and what it has cost.

    Attributes:
        p: the moment.
        allowed: the largest error, of what is found.
        budget: of the number of unknowns.
        remedy: what to do where the budget does not suffice.
        stages: how many stages were solved.
        failure: why the last stage had no solution.
        judged: what the last stage has.
    """

    p: float
    allowed: Callable[[Any], float]
    budget: Budget
    remedy: Remedy
    stages: int = 0
    failure: Exception | None = None
    judged: Any = None

    def settle(self, stage: Stage | None, near: Any = None) -> Any:
        """What is found within the tolerance at one place: solve, judge, and stop or refine.

        Args:
            stage: the first one.
            near: what was found elsewhere, to begin with.

        Raises:
            NotConverged: the budget does not suffice, or rounding is larger than the tolerance; `partial` is what is
                nearest to the tolerance, or None.
        """
        best, share = None, math.inf  # what is nearest to the tolerance, and its error over what is allowed
        self.judged, self.failure = None, None
        try:
            while True:
                stage = self._begun(stage)
                try:
                    near = stage.solved(self.p, near)
                except OverBudget:
                    raise
                except UNSOLVED as failure:
                    self.failure = failure.with_traceback(None)  # which would keep this search, and all it has found
                    near, stage = None, stage.doubled(failure)
                    continue
                allowed = self.allowed(near)
                self.judged = found = stage.judged(near, allowed)
                if found.error <= allowed and stage.is_enough(found):
                    return found
                if found.error / allowed < share:
                    best, share = found, found.error / allowed
                if near.rounding > allowed:
                    raise NotConverged(Message(Code.ROUNDED, size=near.rounding))
                stage = stage.refined(found, allowed, self.budget.most(stage))
        except NotConverged as ended:  # no stage may follow
            if share <= 1 and not isinstance(ended, OverBudget):  # within the tolerance, but not its slope
                return best
            about = {"p": self.p, "reason": ended.reason}
            if best is not None:
                told = Message(Code.BUDGET_SPENT, value=best.value, error=best.error, size=share, **about)
            else:
                last, is_thin = self.failure, isinstance(self.failure, NotConverged)
                said = last.message.advising(None) if isinstance(last, FpsolveError) else last and str(last)
                told = Message(Code.NOTHING_RESOLVED, is_thin=is_thin, last=said, **about)
            remedy = None if ended.reason.code is Code.ROUNDED else self.remedy
            raise type(ended)(told, best, remedy) from None

    def _begun(self, stage: Stage | None) -> Stage:
        """A stage, which is counted. Raises `NotConverged`: it is beyond the budget, or there is none."""
        if stage is None or self.stages >= MAX_STAGES:
            raise NotConverged(Message(Code.MESHES_SPENT, count=self.stages))
        size, most = stage.size, self.budget.most(stage)
        if size > most:
            raise NotConverged(Message(Code.UNKNOWNS_SPENT, unknowns=size, most=most))
        charge(size)
        self.stages += 1
        return stage
