"""Solving the curves of a case, alone or in batches, and comparing them with what the case expects.

Batches are of neighbours, but each set begins anew, so that its numbers follow from its parameters alone. (To start
from a neighbour's mesh saves half of the time of one p in strong noise, and nothing of several p, or in weak noise.)
"""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from time import monotonic, process_time
from typing import Any, TypeVar

import numpy as np

from fpsolve.analysis.density import negative_share, stationary_density
from fpsolve.analysis.directions import SettledDirections, negative_part, settled_directions
from fpsolve.analysis.excursions import SYMBOL, Start, StartOfNoise, solve_excursion
from fpsolve.analysis.sensitivity import DIFFERENTIATED, Sensitivities, solve_sensitivities
from fpsolve.arrays import FloatArray
from fpsolve.budget import counted
from fpsolve.case.case import MOST_DRAWN, Case, Curve
from fpsolve.case.refusals import obstacle
from fpsolve.case.sections import EXCURSIONS, RESPONSE, SENSITIVITIES, Varied
from fpsolve.errors import FpsolveError, NoSuchExponent, NotConverged
from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import Absent, Estimate, Failure, Moment
from fpsolve.exponent.fields import MOST_NEGATIVE, UNRESOLVED
from fpsolve.exponent.function import solve_moments
from fpsolve.exponent.quantities import BY_JUMP, INDICES, MOMENT, STABILITY_INDEX
from fpsolve.exponent.solver import ExponentSolver, InvariantClass, MomentLyapunov
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, Remedy, Severity, message_of
from fpsolve.model.problem import Problem, refuse_infinite
from fpsolve.signals import is_interrupt
from fpsolve.study.response import Grid, solve_response
from fpsolve.study.results import Comparison, CurveResult, MomentColumns, Solved
from fpsolve.theory.perturbation import perturbed_moments, weak_noise_note

Kept = TypeVar("Kept")
Found = TypeVar("Found")
PARTS = ("excursion", "response", "sensitivities")
"""Attributes of a result that an interrupted run keeps, beside Λ(p) and the indices."""
SOON = 1.0
"""Seconds after which what is known of a curve is kept."""
BATCHES, MOST_SETS = 256, 64
"""About so many batches has a case, unless these are larger than that."""


ROUGH = 0.05
"""Total variation by which finer functions may move a density that a picture shows."""


@dataclass(frozen=True, eq=False)
class Wanted:
    """What is asked of a curve.

    Attributes:
        p: the moments, shape (n,).
        indices: names of `INDICES`.
        shown: the p whose eigenfunctions are kept.
        density: whether the stationary density is.
        differentiated: the p at which Λ is differentiated by the parameters; None where no sensitivities are wanted.
        start: φ₀ and ξ₀ of excursions; None where these are not wanted.
        response: rtol of the stationary response; None where that is not wanted.
        grid: of its density; None where numbers are enough.
        slopes: whether Λ′(p) has an error, which may cost more than Λ(p).
        is_stated: whether a case names what it wants, so that what there is not is told of.
    """

    p: FloatArray
    indices: tuple[str, ...]
    shown: tuple[float, ...] = ()
    density: bool = False
    differentiated: tuple[float, ...] | None = None
    start: tuple[Start, StartOfNoise] | None = None
    response: float | None = None
    grid: Grid | None = None
    slopes: bool = True
    is_stated: bool = True

    @property
    def draws(self) -> bool:
        return self.density or bool(self.shown)


@dataclass(frozen=True, eq=False)
class Numerics:
    """How all curves of a case are solved.

    Attributes:
        rtol, mesh, budget: as for `moment_lyapunov`.
    """

    rtol: float
    budget: Budget
    mesh: CylinderMesh | None

    @classmethod
    def of(cls, case: Case) -> Numerics:
        return cls(case.rtol, case.budget, case.cylinder_mesh())

    def solver(self, curve: Curve) -> ExponentSolver:
        return ExponentSolver(curve.problem, self.mesh, rtol=self.rtol, budget=self.budget)


def everything(case: Case, number: int = 1) -> Wanted:
    """What a case asks for, of the curve with a number; the density goes with what is drawn of it, if that is named."""
    names = set(case.asked)
    has_moments, is_named = MOMENT.name in names, case.output.asks_for_eigenfunctions
    draws = is_named and not case.problem.no_picture
    slopes = tuple(case.differentiated) if has_moments else ()
    grid = case.response.grid
    return Wanted(
        case.p if has_moments else np.zeros(0),
        tuple(name for name in INDICES if name in names),
        shown=tuple(case.shown) if is_named or number == 1 else (),
        density=draws and (number == 1 or case.shown.size > 0),
        differentiated=slopes if SENSITIVITIES in names or case.uncertain else None,
        start=(case.excursions.phi, case.excursions.xi) if EXCURSIONS in names else None,
        response=case.response.rtol if case.has_response else None,
        grid=(grid.amplitude, grid.phi, grid.xi) if case.has_response and case.planned <= MOST_DRAWN else None,
        is_stated=case.output.lists_quantities,
    )


def expected(case: Case, varied: Varied) -> Wanted:
    """What the expectations of a case compare, of the curve with these values."""
    chosen = [each for each in case.expect if each.selects(varied)]
    p = np.unique([each.p for each in chosen if each.p is not None])
    return Wanted(
        p,
        tuple(name for name in INDICES if any(each.quantity == name for each in chosen)),
        response=case.response.rtol if any(each.of_response for each in chosen) else None,
        slopes=False,
    )


def compare(case: Case, results: Sequence[CurveResult]) -> list[Comparison]:
    """Every expectation of a case against every curve that it selects."""
    found = []
    for wanted, result in ((each, result) for each in case.expect for result in results):
        if not wanted.selects(result.curve.varied):
            continue
        if wanted.p is not None:
            at = np.flatnonzero(np.isclose(result.moments.p, wanted.p, rtol=0, atol=1e-12))
            value = float(result.moments.value[at[0]]) if at.size else None
        else:
            numbers = result.response.numbers if result.response else {}
            estimate = numbers.get(wanted.of_response) if wanted.of_response else result.estimates[wanted.quantity]
            value = None if estimate is None else estimate.value
        tolerance = max(wanted.atol or 0.0, (wanted.rtol or 0.0) * abs(wanted.value))
        met = value is not None and abs(value - wanted.value) <= tolerance
        found.append(Comparison(wanted, dict(result.curve.varied), value, tolerance, met))
    return found


class Draft:
    """What is known of a curve while others of its quantities are solved; it is kept as it grows.

    Args:
        curve: the parameter set.
        earlier: what an interrupted run knew of it.
        keep: takes what is known, now and then.

    Attributes:
        known: Λ(p), by p.
        columns: of all moments, once they are solved.
        estimates: the indices that were found, by name.
        parts: other attributes of a result.
    """

    def __init__(self, curve: Curve, earlier: CurveResult | None, keep: Callable[[CurveResult], None]) -> None:
        self.curve, self._keep, self._kept_at = curve, keep, monotonic()
        self.known, self.estimates = dict[float, Moment](), dict[str, Estimate | None]()
        self.parts: dict[str, Any] = {}
        self.columns: MomentColumns | None = None
        self.seconds, self._started = 0.0, process_time()
        if earlier is not None:
            names = ("value", "derivative", "derivative_error", "error_estimate", "residual")
            rows = zip(*(getattr(earlier.moments, name).tolist() for name in names), strict=True)
            self.known = {p: Moment(*row) for p, row in zip(earlier.moments.p.tolist(), rows, strict=True)}
            self.estimates = {name: each for name, each in earlier.estimates.items() if each}
            self.parts = {name: found for name in PARTS if (found := getattr(earlier, name)) is not None}
            self.seconds = earlier.seconds

    def spent(self) -> float:
        """Seconds of the processor, with those of earlier runs."""
        return self.seconds + process_time() - self._started

    def index(self, name: str, solve: Callable[[], Estimate | Absent]) -> Estimate | Absent:
        """An index, solved where it is not known yet."""
        if known := self.estimates.get(name):
            return known
        found = solve()
        if found:
            self.estimates[name] = found
            self.grow()
        return found

    def part(self, name: str, solve: Callable[[], Found]) -> tuple[Found | None, Message | None]:
        """Another attribute of a result, solved where it is not known yet; or why it is missing, without it."""
        if name in self.parts:
            return self.parts[name], None
        found, reason = _tried(solve)
        if found is not None:
            self.parts[name] = found
            self.grow()
        return found, reason

    def grow(self) -> None:
        """Keep what is known, if that was not done just now."""
        if monotonic() - self._kept_at >= SOON:
            self.keep()

    def keep(self) -> None:
        """Keep what is known."""
        columns = self.columns
        if columns is None:
            p = np.array(sorted(self.known))
            rows = np.array([self.known[each] for each in p.tolist()]).reshape(-1, len(Moment._fields))
            value, slope, slope_error, error, residual = np.where(np.isinf(rows), np.nan, rows).T
            theory = perturbed_moments(self.curve.problem, p)
            columns = MomentColumns(p, value, slope, error, slope_error, residual, theory)
        estimates = {name: self.estimates.get(name) for name in INDICES}
        failures = (Failure(None, Message(Code.UNFINISHED)),)
        self._keep(CurveResult(self.curve, columns, estimates, failures=failures, seconds=self.spent(), **self.parts))
        self._kept_at = monotonic()


def _tried(solve: Callable[[], Found]) -> tuple[Found | None, Message | None]:
    """What is solved, or why it is missing, which takes nothing else with it."""
    try:
        return solve(), None
    except FpsolveError as failure:
        return None, failure.message
    except MemoryError:
        return None, Message(Code.NO_MEMORY, remedy=Remedy.MEMORY)
    except OSError:
        raise
    except Exception as failure:
        return None, _fault(failure)


def solve_curve(
    curve: Curve,
    wanted: Wanted,
    numerics: Numerics,
    progress: Callable[[], None] = lambda: None,
    earlier: CurveResult | None = None,
    keep: Callable[[CurveResult], None] = lambda _: None,
) -> Solved:
    """Solve one parameter set: Λ(p) first, then λ, δ_p and the others; what did not converge is in its `failures`.

    Args:
        curve: the parameter set.
        wanted: what is asked of it.
        numerics: how it is solved.
        progress: called after each moment.
        earlier: what an interrupted run knew of it, which is not solved again.
        keep: takes what is known as it grows, every `SOON` seconds at most, and when the work is interrupted.
    """
    draft = Draft(curve, earlier, keep)
    try:
        return _solve(draft, wanted, numerics, progress)
    except KeyboardInterrupt:
        draft.keep()
        raise


def _solve(draft: Draft, wanted: Wanted, numerics: Numerics, progress: Callable[[], None]) -> Solved:
    """The same, into a draft."""
    curve, solver = draft.curve, numerics.solver(draft.curve)

    def advance() -> None:
        progress()
        draft.grow()

    refused = _refused(curve.problem, wanted.p)
    for _ in refused:
        advance()
    computed = [p for p in wanted.p.tolist() if p not in refused]
    found = solve_moments(solver, computed, progress=advance, known=draft.known if wanted.slopes else None)
    found = replace(found, failures=(*(Failure(p, reason) for p, reason in refused.items()), *found.failures))
    draft.columns = columns = MomentColumns(
        p=found.p,
        value=found.value,
        derivative=found.derivative,
        error_estimate=found.error_estimate,
        derivative_error=found.derivative_error if wanted.slopes else np.full(found.p.shape, np.nan),
        residual=found.residual,
        perturbation=perturbed_moments(curve.problem, found.p),  # Eq. (37)
    )
    draft.grow()
    tries = {
        name: (INDICES[name].symbol, partial(draft.index, name, partial(INDICES[name].solve, solver, found.root)))
        for name in wanted.indices
    }
    estimates, missing = _solve_indices(tries, found)
    jumps, more = _solve_jumps(solver, wanted.indices, found)
    classes = _tried(lambda: solver.by_class(found.p))[0] or ()
    missing = [each for each in missing if wanted.is_stated or not each.tells_of(Code.NOT_ONE_RAY)] + more
    index = estimates[STABILITY_INDEX.name]
    root = None if index is None else index.value
    rare, response, slopes, faulty = None, None, None, list[Message]()
    if wanted.start is not None:
        phi, xi = wanted.start
        rare, reason = draft.part("excursion", lambda: solve_excursion(solver, phi=phi, xi=xi, root=root))
        missing += _missing(SYMBOL, reason, found)
    if wanted.response is not None:
        rtol, grid = wanted.response, wanted.grid
        response, reason = draft.part("response", lambda: solve_response(curve.problem, rtol, grid, numerics.budget))
        missing += _missing(RESPONSE, reason, found)
    if wanted.differentiated is not None:
        p = np.array([p for p in wanted.differentiated if np.any(found.p == p)])
        names = [name for name in DIFFERENTIATED if estimates[name] is not None]

        def differentiate() -> Sensitivities:
            return solve_sensitivities(solver, p, curve.problem.derivatives(), indices=names, root=root)

        slopes, reason = draft.part("sensitivities", differentiate)
        is_faulty = reason is not None and reason.code is Code.NOISE_REFUSED
        faulty = [reason] if reason and is_faulty else []
        missing += [] if is_faulty else _missing(SENSITIVITIES, reason, found)
    of = {each: [message for message in missing if message.severity is each] for each in Severity}
    pairs, stationary, undrawn = _functions(solver, without_failed(wanted, found.failures))
    directions, unsettled = _directions(solver, without_failed(wanted, found.failures))
    undrawn += unsettled
    notes = (
        *found.notes,
        *curve.problem.remarks,
        _told_of(curve.problem, classes),
        weak_noise_note(curve.problem, found.p, found.value),
        *of[Severity.NOTE],
        *(slopes.notes if slopes else ()),
        *(rare.notes if rare else ()),
    )
    unresolved = [
        Message(Code.UNREADABLE, name=name, p=pair.p, size=defect)
        for pair in (() if undrawn else pairs)
        for name, defect, most in (
            ("T", pair.sign_defects[0], UNRESOLVED),
            ("T_adjoint", pair.sign_defects[1], UNRESOLVED),
            ("tilted_density", negative_share(pair), MOST_NEGATIVE),
        )
        if defect > most
    ]
    unresolved += [message for each in directions for message in _unclear(each)]
    imprecise = [
        Message(
            Code.INDEX_RTOL_MISSED,
            symbol=INDICES[name].symbol,
            value=estimate.value,
            error=estimate.error_estimate,
            size=estimate.relative_error,
            rtol=numerics.rtol,
            remedy=None if numerics.mesh is None else Remedy.MESH,
        )
        for name, estimate in estimates.items()
        if estimate and estimate.relative_error > numerics.rtol
    ]
    limits = (*of[Severity.WARNING], *imprecise, *undrawn, *unresolved, *faulty)
    result = CurveResult(
        curve=curve,
        moments=columns,
        estimates=estimates,
        discretisation=_discretisation(solver),
        jumps=jumps,
        classes=classes,
        warnings=(*found.warnings, *limits),
        sensitivities=slopes,
        excursion=rare,
        response=response,
        notes=tuple(note for note in notes if note is not None),
        failures=found.failures or tuple(Failure(None, message) for message in of[Severity.FAILURE]),
        seconds=draft.spent(),
    )
    told = (*(failure.reason for failure in result.failures), *result.warnings, *result.notes)
    is_passing = any(each.tells_of(code) for each in told for code in (Code.NO_MEMORY, Code.FAULT))
    return Solved(result, pairs, stationary, is_passing, directions)


def _refused(problem: Problem, p: FloatArray) -> dict[float, Message]:
    """The p of a set of a sweep of which there is no Λ(p), as for other sets, and why."""
    found = dict[float, Message]()
    for each in p.tolist():
        try:
            refuse_infinite(problem, each)
        except NoSuchExponent as failure:
            found[each] = failure.message
    return found


def without_failed(wanted: Wanted, failures: Sequence[Failure]) -> Wanted:
    """The same without the eigenfunctions at the p that failed."""
    failed = {failure.p for failure in failures}
    return replace(wanted, shown=tuple(p for p in wanted.shown if p not in failed))


def _functions(
    solver: ExponentSolver, wanted: Wanted
) -> tuple[tuple[PrincipalPair, ...], PrincipalPair | None, list[Message]]:
    """The eigenpairs to be drawn that converge, that at p = 0 if it is to be trusted, and else why it is not.

    Of more than two variables there are none, but `_directions`.
    """
    if solver.problem.dimension > 2:
        return (), None, []

    def pair(p: float) -> PrincipalPair | None:
        return _tried(lambda: solver.pair(p))[0]

    pairs, stationary = tuple(filter(None, map(pair, wanted.shown))), pair(0.0) if wanted.draws else None
    try:
        if stationary is not None:
            stationary_density(stationary)
    except NotConverged as failure:
        remedy = solver.refinement
        return pairs, None, [Message(Code.NOTHING_DRAWN, reason=failure.reason, remedy=remedy)]
    return pairs, stationary, []


def _directions(solver: ExponentSolver, wanted: Wanted) -> tuple[tuple[SettledDirections, ...], list[Message]]:
    """Of more than two variables what is wanted over directions, of the p that converge; what is beyond the budget."""
    found, missing = list[SettledDirections](), list[Message]()
    for p in sorted({*wanted.shown, 0.0} if wanted.density else wanted.shown) if solver.problem.dimension > 2 else ():
        pair, _ = _tried(partial(solver.pair, p))
        each, reason = (None, None) if pair is None else _tried(partial(_directions_at, solver, pair))
        found += [each] if each else []
        if reason:
            missing.append(Message(Code.INDEX_MISSING, symbols=["density of directions"], reason=reason))
    return tuple(found), missing


def _directions_at(solver: ExponentSolver, pair: PrincipalPair) -> SettledDirections:
    with counted(solver.budget.countdown(f"the density of directions at p = {pair.p:g}")):
        return settled_directions(pair)


def _unclear(found: SettledDirections) -> Iterator[Message]:
    """Which densities of directions mislead."""
    p, fields = found.pair.p, found.fields
    for name, values in {"T_adjoint": fields.adjoint, "tilted_density": fields.product}.items():
        if (defect := negative_part(fields.grid, values)) > MOST_NEGATIVE:
            yield Message(Code.UNREADABLE, name=name, p=p, size=defect)
    if not fields.is_resolved:
        yield Message(Code.FINE_DENSITY, p=p, size=abs(fields.total - 1))
    if not found.error <= ROUGH:
        yield Message(Code.ROUGH_DENSITY, p=p, size=None if math.isnan(found.error) else found.error)


def _solve_indices(
    tries: Mapping[str, tuple[str, Callable[[], Estimate | Absent]]], moments: MomentLyapunov
) -> tuple[dict[str, Estimate | None], list[Message]]:
    """Indices, None for those not asked for; why others did not converge, are infinite, or do not exist.

    Args:
        tries: by names of `INDICES` what messages call each, and what solves it.
        moments: what is known of Λ(p).
    """
    estimates: dict[str, Estimate | None] = dict.fromkeys(INDICES)
    unsolved = {each.reason: Message(Code.NO_MOMENT, p=each.p) for each in moments.failures if each.p is not None}
    missing: dict[tuple[Code, Message], list[str]] = {}
    for name, (symbol, solve) in tries.items():
        try:
            found = solve()
        except NotConverged as failure:
            code = Code.INDEX_MISSING if moments.failures else Code.INDEX_FAILED
            reason = unsolved.get(failure.message, failure.message)
        except NoSuchExponent as failure:
            code, reason = Code.INDEX_MISSING, failure.message
        except MemoryError:
            code, reason = Code.INDEX_FAILED, Message(Code.NO_MEMORY, remedy=Remedy.MEMORY)
        except OSError:
            raise
        except Exception as failure:  # the others are there already
            code, reason = Code.INDEX_FAILED, _fault(failure)
        else:
            if found:
                estimates[name] = found
                continue
            code, reason = Code.INDEX_ABSENT, found.reason
            if name == STABILITY_INDEX.name:
                code, symbol = Code.INDEX_MISSING, "stability index"
        missing.setdefault((code, reason), []).append(symbol)
    return estimates, [Message(code, symbols=symbols, reason=reason) for (code, reason), symbols in missing.items()]


def _missing(symbol: str, reason: Message | None, moments: MomentLyapunov) -> list[Message]:
    """What is said of a quantity that is missing, if it is."""
    if reason is None or reason.severity is Severity.NOTE:
        return [reason] if reason else []
    return [Message(Code.INDEX_MISSING if moments.failures else Code.INDEX_FAILED, symbols=[symbol], reason=reason)]


def _solve_jumps(
    solver: ExponentSolver, names: Sequence[str], moments: MomentLyapunov
) -> tuple[tuple[Mapping[str, Estimate | None], ...], list[Message]]:
    """Of a system with several jumps the indices of each, and why some are not there."""
    rays, told, messages = solver.problem.system.jumps, [], list[Message]()
    wanted = [name for name in BY_JUMP if name in names] if len(rays) > 1 else []
    for number, ray in enumerate(rays if wanted else ()):
        where = f"at φ = {ray.phase:.6g}"
        tries = {name: (f"{INDICES[name].symbol} {where}", partial(BY_JUMP[name], solver, number)) for name in wanted}
        found, missing = _solve_indices(tries, moments)
        told.append({name: found[name] for name in wanted})
        messages += missing
    return tuple(told), messages


def _told_of(problem: Problem, classes: Sequence[InvariantClass]) -> Message | None:
    """That there are such classes, and their λ."""
    if len(classes) < 2:
        return None
    values = [each.lyapunov_exponent.value for each in classes]
    if classes[0].phase is None:
        is_hidden = not set(classes[0].variables) <= set(problem.system.states)
        return Message(Code.BLOCKS, blocks=problem.block_names, is_hidden=is_hidden, rates=values)
    along, across = values
    return Message(Code.INVARIANT_CLASSES, phase=classes[0].phase, along=along, across=across)


def _discretisation(solver: ExponentSolver) -> dict[str, Any] | None:
    """That of the p of the largest size that was solved, z in noise units; None where none was."""
    known = solver.whole.known
    p = max(known, key=abs, default=None)
    if p is None:
        return None
    space = known[p].pair.space
    return {**space.phi.facts, **space.xi.facts, "unknowns": space.size}


@dataclass(frozen=True, eq=False)
class Order:
    """A parameter set to be solved; who solves it makes its curve, so that little is sent.

    Attributes:
        number, varied: of the curve.
        line: where it stands in a file of sets, for the message of one that cannot be solved.
        wanted: what of it.
        is_known: whether there is a record, so that only its eigenfunctions are to be drawn.
        earlier: what an interrupted run knew of it.
    """

    number: int
    varied: Varied
    wanted: Wanted
    line: str = ""
    is_known: bool = False
    earlier: CurveResult | None = None


def solve_batch(
    batch: Sequence[Order],
    problem: Problem,
    numerics: Numerics,
    keep: Callable[[Order, Curve, Solved], Kept],
    progress: Callable[[], None] = lambda: None,
    grow: Callable[[CurveResult], None] = lambda _: None,
) -> list[Kept]:
    """The task: solves some sets, and hands each to `keep` before the next is begun.

    Args:
        batch: the sets.
        problem: that of the case, without what is varied.
        numerics: how they are solved.
        keep: takes an order, its curve and what was found, and returns what the caller needs to know; it pickles.
        progress: called after each moment; only where the task stays in this process.
        grow: takes what is known of a set that is not finished.
    """
    kept = list[Kept]()
    for order in batch:
        curve = Curve(problem, order.varied, order.number)
        kept.append(keep(order, curve, solved(curve, order, numerics, progress, grow)))
    return kept


def batch_size(planned: int) -> int:
    """Sets of a batch, from the case alone."""
    return min(max(planned // BATCHES, 1), MOST_SETS)


def batches(case: Case, order: Callable[[int, Varied], Order | None]) -> Iterator[tuple[Order, ...]]:
    """All batches of a case, without the sets of which nothing is wanted; the first sets come one by one.

    So whoever begins sees soon how long they take.

    Args:
        case: whose sets these are.
        order: gives the order of a set from the number of its curve and what is varied.
    """
    size = batch_size(case.planned)
    starts = [*range(min(size, case.planned)), *range(size, case.planned, size), case.planned]
    for start, stop in pairwise(starts):
        if found := tuple(filter(None, map(order, range(start + 1, stop + 1), case.vary.sets(start, stop)))):
            yield found


def solved(
    curve: Curve,
    order: Order,
    numerics: Numerics,
    progress: Callable[[], None] = lambda: None,
    grow: Callable[[CurveResult], None] = lambda _: None,
) -> Solved:
    """What is wanted of a set; where that cannot be found, a result that says why, unless its numbers are known.

    That of a set which contradicts itself, or overflows, as those of a small case are refused for, is not kept.
    """
    wanted = order.wanted
    if reason := obstacle(curve.base, curve.varied, wanted.p, with_moments=False):
        return Solved(failed(curve, f"{order.line}{reason}"), (), None, True)
    if order.is_known:
        try:
            solver = numerics.solver(curve)
            pairs, stationary, _ = _functions(solver, wanted)
            return Solved(None, pairs, stationary, directions=_directions(solver, wanted)[0])
        except OSError:
            raise
        except Exception:  # its numbers stay as they are
            return Solved(None, (), None)
    try:
        return solve_curve(curve, wanted, numerics, progress, order.earlier, grow)
    except FpsolveError as failure:
        return Solved(failed(curve, failure.message), (), None)
    except MemoryError:
        return Solved(failed(curve, Message(Code.NO_MEMORY, remedy=Remedy.MEMORY)), (), None, True)
    except OSError:
        raise
    except Exception as failure:
        return Solved(failed(curve, _fault(failure)), (), None, True)


def _fault(failure: Exception) -> Message:
    """What is said of a fault of fpsolve. Raises `KeyboardInterrupt` where it is an interrupt in disguise."""
    if is_interrupt(failure):
        raise KeyboardInterrupt from failure
    last = traceback.extract_tb(failure.__traceback__)[-1]
    said = {"kind": type(failure).__name__, "text": str(failure)}
    return Message(Code.FAULT, **said, file=Path(last.filename).name, line=last.lineno)


def failed(curve: Curve, reason: str) -> CurveResult:
    nothing = np.zeros(0)
    failures = (Failure(None, message_of(reason)),)
    return CurveResult(curve, MomentColumns(*[nothing] * 7), dict.fromkeys(INDICES), failures=failures)


def result_alone(order: Order, curve: Curve, solved: Solved) -> CurveResult | None:
    """For a `solve_batch` that keeps nothing but the numbers."""
    return solved.result
