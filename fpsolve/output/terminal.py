"""Results on the terminal, as tables: up to ten curves have one each, more a row each, and of many the extreme ones.

What limits the numbers is told below: messages that differ in numbers only once, for all their curves.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.text import Text

from fpsolve.analysis.spreads import LEVEL, UNCERTAIN, Spread
from fpsolve.case.case import MOST_DRAWN, Case, Curve
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.case.sections import EXCURSIONS, RESPONSE
from fpsolve.case.vary import map_key, short_names
from fpsolve.data import Quantity, written
from fpsolve.exponent.error import Estimate, digits
from fpsolve.exponent.quantities import (
    BY_JUMP,
    CRITICAL_RESTITUTION,
    IMPACT_RATE,
    INDICES,
    LYAPUNOV_EXPONENT,
    MOMENT,
    STABILITY_INDEX,
    VARIANCE_RATE,
    Index,
)
from fpsolve.messages import Code, Message, Severity, message_of
from fpsolve.model.quantity import OSCILLATOR_RESPONSE, moment_at
from fpsolve.output.screen import Cell, Column, Grid, Screen
from fpsolve.output.sentences import bounds_text, excursions, sentence, shape_of_response
from fpsolve.output.tables import in_case_words
from fpsolve.parts.intervals import Sampled, Samples, Spreads, spreads_of
from fpsolve.study.chart import Chart, charted
from fpsolve.study.columns import asked
from fpsolve.study.results import Comparison, CurveResult, SimulatedCurve, Status

SUMMARY, MONTE_CARLO = "summary.json", "monte_carlo*.json"
STYLES = {
    Severity.FAILURE: ("not converged", "bold red"),
    Severity.WARNING: ("warning", "yellow"),
    Severity.NOTE: ("note", "cyan"),
}
"""How a remark begins, and its colour, in the order in which remarks are told."""
MOST_NAMED, MOST_KINDS = 3, 20
"""Curves that are named of those that share a message, and messages of each severity that are told."""
MOST_TABLES, MOST_ROWS = 10, 50
"""Curves that have a table each, and that have a row each."""
MOST_FAILED, MOST_MOMENTS, MOST_EXTREMES = 20, 3, 2
"""Failed curves that are named among more, p whose Λ has a column, and quantities whose extremes are shown."""
DIGITS = 7
MAIN = (LYAPUNOV_EXPONENT, STABILITY_INDEX)
THEORY = "Eqs. (38)-(39): perturbation theory"
INTERVAL = f"{LEVEL:.0%} interval"
STAR = "* for the noise reduced by Eqs. (12)-(14)"


@dataclass(frozen=True)
class _Shown(Column):
    """A column for a number of a curve.

    Attributes:
        value: gives the number, None where it is not there; None for perturbation theory, of which no extremes are
            sought.
        text: gives what is shown of it, also where it is not there.
    """

    value: Callable[[CurveResult], float | None] | None = None
    text: Callable[[CurveResult], str] = str


def curve_grid(case: Case, results: Sequence[CurveResult]) -> Grid:
    """A row for each curve: what varies, λ, δ_p, and what else is asked for, or over a parameter the closed forms.

    Of more than `MOST_ROWS` curves the extreme and the failed ones have one.
    """
    quantities = _quantities(case)
    theories = [each for each in quantities if each.value is None and any(map(each.text, results))]
    quantities = [each for each in quantities if each.value is not None or each in theories]
    is_digest = len(results) > MOST_ROWS
    chosen = _chosen(results, quantities) if is_digest else [("", result) for result in results]
    has_status = len(results) > MOST_TABLES or any(result.status for _, result in chosen)
    columns = [*varied_columns(case), *quantities]
    is_whole = all(result.status == Status.CONVERGED for _, result in chosen)
    columns += [Column("status", 1 if is_whole else 0)] * has_status + [Column("which", is_text=True)] * is_digest
    told = [THEORY] * bool(theories) + [STAR] * any("*" in each.heading for each in theories)
    has_moments = case.figure.x == "p" and MOMENT.name in case.asked
    units = units_in_words(case, [*_told(case), *[MOMENT] * has_moments])
    grid = Grid(case.headline, columns, remark="; ".join(filter(None, [*told, units])))
    for which, result in chosen:
        varied, numbers = map(written, result.curve.varied.values()), (each.text(result) for each in quantities)
        grid.rows.append([*varied, *numbers, *[result.status.word] * has_status, *[which] * is_digest])
    return grid


def units_in_words(case: Case, quantities: Iterable[Quantity]) -> str:
    """The unit of those that have one, where the case names its unit of time: "λ, N in 1/s"; else nothing."""
    unit = case.units.time
    timed = [each.symbol for each in quantities if each.unit != each.timed(unit).unit]
    return f"{', '.join(timed)} in 1/{unit}" if timed else ""


def varied_columns(case: Case) -> list[Column]:
    """A column for each varied key, without its section where that is not needed."""
    return [Column(name) for name in short_names(case.vary.keys)]


def _told(case: Case) -> list[Index]:
    """The indices that a case asks for, without those of impacts where it names none, and not one ray has them."""
    has_impacts = len(case.system.jumps) == 1 or case.output.lists_quantities
    return [index for index in asked(case) if has_impacts or index.name not in BY_JUMP]


def index_text(index: Index, result: CurveResult, most: int = 17) -> str:
    """An index of a curve with its digits, or that there is none, or that it was not found out."""
    estimate = result.estimates[index.name]
    if estimate is not None:
        return digits(estimate.value, estimate.error_estimate, most)
    told = map(message_of, (*(failure.reason for failure in result.failures), *result.warnings))
    unsolved = {Code.INDEX_FAILED, Code.INDEX_MISSING} if result.failures else {Code.INDEX_FAILED}
    if any(each.code in unsolved and index.symbol in each.data["symbols"] for each in told):
        return "not solved"
    if result.curve.problem.has_algebraic_tails and index in (STABILITY_INDEX, VARIANCE_RATE):
        return "not computed"
    return "none" if index == CRITICAL_RESTITUTION else "none found"


def _quantities(case: Case) -> list[_Shown]:
    """What has a column, the most important first: λ, δ_p, the other indices, then Λ at the p of a case if few."""
    ordered = sorted(_told(case), key=lambda index: index not in MAIN)
    rare = [_excursion(case)] * (EXCURSIONS in case.asked) + [_mean_square()] * case.has_response
    if case.figure.x != "p":
        main = [
            each
            for index in ordered
            if index in MAIN
            for each in (_index(index, 0), *_interval(case, index), _theory(case, index))
        ]
        return main + rare
    found = [
        column
        for rank, each in enumerate(ordered)
        for column in (_index(each, rank + 1 if rank > 1 else 0), *_interval(case, each))
    ]
    p = [float(each) for each in case.p if each] if MOMENT.name in case.asked else []
    if len(p) > MOST_MOMENTS:
        p = [] if found else [p[0], p[-1]]
    return found + rare + [_moment(each, 2 if found else 0) for each in p]


def _index(index: Index, rank: int) -> _Shown:
    def text(result: CurveResult) -> str:
        is_lost = result.estimates[index.name] is None and result.status.fails
        return "" if is_lost else index_text(index, result, DIGITS)

    def value(result: CurveResult) -> float | None:
        found = result.estimates[index.name]
        return None if found is None else found.value

    return _Shown(index.symbol, rank, value=value, text=text)


def _interval(case: Case, index: Index) -> list[_Shown]:
    """Its interval, if the parameters of the case are uncertain."""

    def text(result: CurveResult) -> str:
        spread = spreads_of(case, result).indices.get(index.name)
        return "" if spread is None else interval_text(spread)

    is_told = bool(case.uncertain) and index.name in UNCERTAIN
    return [_Shown(f"{LEVEL:.0%} of {index.symbol}", rank=1, text=text)] * is_told


def _theory(case: Case, index: Index) -> _Shown:
    """Its closed form; with a star where some solution is for another noise."""
    heading = f"Eq. {index.closed_form}{'*' if case.theory_reduces_noise else ''}"

    def text(result: CurveResult) -> str:
        value = index.theory(result.curve.problem)
        return "" if math.isnan(value) else f"{value:.6g}"

    return _Shown(heading, rank=1, text=text)


def _excursion(case: Case) -> _Shown:
    """The bounds of the probability of an excursion to one level."""
    level = case.excursions.sentence_level

    def text(result: CurveResult) -> str:
        return "" if result.excursion is None else bounds_text(result.excursion, level)

    return _Shown(f"P(sup ‖x‖ ≥ {level:g})", rank=1, text=text)


def _mean_square() -> _Shown:
    """⟨A²⟩ of the stationary response."""

    def text(result: CurveResult) -> str:
        found = result.response and result.response.means["amplitude_squared"]
        return digits(found.value, found.error_estimate, DIGITS) if found else ""

    return _Shown(OSCILLATOR_RESPONSE.means["amplitude_squared"].symbol, 1, text=text)


def _moment(p: float, rank: int) -> _Shown:
    def numbers(result: CurveResult) -> list[tuple[float, float]]:
        found = result.moments
        columns = (found.p.tolist(), found.value.tolist(), found.error_estimate.tolist())
        return [(value, error) for each, value, error in zip(*columns, strict=True) if each == p]

    return _Shown(
        moment_at(p).symbol,
        rank,
        value=lambda result: next((value for value, _ in numbers(result)), None),
        text=lambda result: next((digits(*pair, most=DIGITS) for pair in numbers(result)), ""),
    )


def _chosen(results: Sequence[CurveResult], quantities: Sequence[_Shown]) -> list[tuple[str, CurveResult]]:
    """The curves with the extreme values of the first quantities, and some that failed, each with the reason."""
    shown = [(each.heading, each.value) for each in quantities if each.value is not None]
    extremes: dict[tuple[str, str], tuple[float, CurveResult]] = {}
    failed: list[CurveResult] = []
    for result in results:
        if result.status.fails and len(failed) < MOST_FAILED:
            failed.append(result)
        for heading, value_of in shown[:MOST_EXTREMES]:
            if (value := value_of(result)) is None:
                continue
            for word, sign in (("least", 1), ("largest", -1)):
                known = extremes.get((word, heading))
                if known is None or sign * value < sign * known[0]:
                    extremes[word, heading] = value, result
    reasons: dict[int, list[str]] = {}
    curves = {result.curve.number: result for result in failed}
    for (word, heading), (_, result) in extremes.items():
        curves[result.curve.number] = result
        reasons.setdefault(result.curve.number, []).append(f"{word} {heading}")
    return [(", ".join(reasons.get(number, [])), curves[number]) for number in sorted(curves)]


def print_results(case: Case, results: Sequence[CurveResult]) -> None:
    """Print Λ(p), or λ and δ_p over a parameter, beside perturbation theory, and the remarks."""
    screen = Screen.of()
    if len(results) > MOST_TABLES or case.figure.x != "p":
        screen.show(curve_grid(case, results))
        if len(results) > MOST_TABLES:
            counts = Counter(result.status for result in results)
            states = ", ".join(
                f"{counts[each]} {each.word}" for each in sorted(counts, key=lambda each: (each.fails, each))
            )
            failed = sum(count for each, count in counts.items() if each.fails)
            is_short = len(results) > MOST_ROWS and failed > MOST_FAILED
            shown = f"; of those that are not converged the first {MOST_FAILED} are shown" if is_short else ""
            screen.say(f"{len(results)} curves: {states}{shown}; all numbers are in curves.csv and results.nc")
    else:
        for result in results:
            if result.moments.p.size:
                screen.show(moment_grid(case, result))
            groups: list[list[str]] = [[]]  # what concerns impacts apart from the others
            spreads = spreads_of(case, result)
            for index in _told(case) if any(result.estimates.values()) else ():
                estimate = result.estimates[index.name]
                error = f" ± {estimate.error_estimate:.0e}" if estimate else ""
                if index == IMPACT_RATE:
                    groups.append([])
                spread = spreads.indices.get(index.name)
                interval = f" ({LEVEL:.0%}: {interval_text(spread)})" if spread else ""
                groups[-1].append(f"{index.symbol} = {index_text(index, result)}{error}{interval}")
            for group in groups:
                screen.packed(group)
            for ray, found in zip(result.curve.problem.system.jumps, result.jumps, strict=False):
                numbers = [f"{INDICES[name].symbol} = {each}" for name, each in found.items() if each]
                screen.packed([f"φ = {ray.phase:.6g}:", *numbers])
            screen.packed(list(verdicts(spreads)))
            if result.response:
                stationary, about = result.response.numbers.items(), result.curve.problem.system.response
                screen.say("Stationary response:")
                screen.packed([f"{about.numbers[name].symbol} = {each}" for name, each in stationary], "  ")
                screen.say(shape_of_response(result.response, about))
            for text in filter(None, (excursions(case, result), sentence(case, result))):
                screen.say(text)
            screen.lines([""])
    print_remarks(case, results)


def verdicts(spreads: Spreads) -> Iterator[str]:
    """With which probability λ and Λ(2), or else the first Λ(p), have their sign, to first order."""
    exponent = spreads.indices.get(LYAPUNOV_EXPONENT.name)
    chosen = [(LYAPUNOV_EXPONENT.symbol, exponent)] if exponent else []
    p = 2.0 if 2.0 in spreads.moments else next(iter(spreads.moments), None)
    chosen += [(moment_at(p).symbol, spreads.moments[p])] if p is not None else []
    for symbol, spread in chosen:
        is_below = spread.below >= 0.5
        yield f"{symbol} {'<' if is_below else '>'} 0 with {percent(spread.below if is_below else 1 - spread.below)}"


def interval_text(spread: Spread | Sampled) -> str:
    """An interval with three digits of its width: "-0.0123 to 0.0045"."""
    width = spread.high - spread.low
    if not 0 < width < math.inf:
        return f"{spread.low:.6g} to {spread.high:.6g}"
    decimals = 2 - math.floor(math.log10(width))
    if 0 <= decimals <= 9:
        return f"{spread.low:.{decimals}f} to {spread.high:.{decimals}f}"
    return f"{spread.low:.4g} to {spread.high:.4g}"


def percent(share: float) -> str:
    """A probability that is not rounded to certainty: "97 %", "> 99.9 %"."""
    if share > 0.999:
        return "> 99.9 %"
    return "< 0.1 %" if share < 0.001 else f"{100 * share:.3g} %"


def sample_grid(case: Case, samples: Samples) -> Grid:
    """A row for each quantity: the interval of the samples, their median, and the interval to first order."""
    columns = [Column("quantity"), Column(f"samples, {LEVEL:.0%}"), Column("median", 1), Column("P(< 0)")]
    remark = f"{samples.planned} samples of a Latin hypercube, seed {samples.seed}"
    grid = Grid(case.headline, [*columns, Column(f"first order, {LEVEL:.0%}"), Column("apart", 2)], remark=remark)
    for each in samples.rows:
        is_there = each.count > 0
        numbers = [interval_text(each), f"{each.median:.6g}", percent(each.below)] if is_there else ["none", "", ""]
        apart = f"{each.apart:.0%}" if is_there else ""
        grid.rows.append([each.quantity.symbol, *numbers, interval_text(each.spread), apart])
    return grid


def print_samples(case: Case, samples: Samples) -> None:
    """Print the intervals of the samples beside those to first order, and where these do not serve."""
    Screen.of().show(sample_grid(case, samples))
    print_sample_remarks(case, samples)


def print_sample_remarks(case: Case, samples: Samples, severities: Iterable[Severity] = STYLES) -> None:
    """Print what is said of the samples."""
    wanted = set(severities)
    for message in samples.remarks:
        if message.severity in wanted:
            print_message(case, message)


def print_written(folder: Path, what: str, seconds: float, known: str = "") -> None:
    """The last line: where the results are, what they are, how long they took, and what an earlier run had done."""
    Screen.of().say(f"written: {folder} ({what}, {duration(seconds)}{f'; {known}' if known else ''})")


def done_of(case: Case, done: int, failed: int = 0, fault: str = "not converged") -> str:
    """How many curves of a case are done: "3 curves", "2 of 3 curves, 1 not converged"."""
    count = f"{done} of {case.planned}" if done < case.planned else f"{done}"
    return f"{count} {plural('curve', case.planned)}{f', {failed} {fault}' if failed else ''}"


def known_of(case: Case, known: int, outdated: int) -> str:
    """How many of its curves an earlier run had done, and how many records another version has written, if any."""
    parts = [f"{known} of {case.planned} known from an earlier run"] * bool(known)
    parts += [f"{outdated} {plural('record', outdated)} of another version not used"] * bool(outdated)
    return "; ".join(parts)


def traced(chart: Chart) -> str:
    """How many lines a chart has: "3 lines, 4 branches"."""
    branches = sum(len(line.branches) for line in chart.lines)
    return f"{len(chart.lines)} {plural('line', len(chart.lines))}, {branches} {plural('branch', branches)}"


def plural(word: str, count: int) -> str:
    return word if count == 1 else f"{word}{'es' if word.endswith('ch') else 's'}"


def duration(seconds: float) -> str:
    """A time for the eye: "4.2 s", "12 min 30 s", "2 h 5 min"."""
    if seconds < 99.95:
        return f"{seconds:.1f} s"
    minutes, hours = divmod(round(seconds), 60), divmod(round(seconds / 60), 60)
    return f"{minutes[0]} min {minutes[1]} s" if minutes[0] < 100 else f"{hours[0]} h {hours[1]} min"


def print_simulation(case: Case, simulated: Sequence[SimulatedCurve], results: Sequence[CurveResult] = ()) -> None:
    """Print Λ(p) and λ by simulation, beside the finite elements where these have solved them, and the remarks."""
    screen = Screen.of()
    is_short = len(simulated) <= MOST_TABLES
    solved = {result.curve.key: result for result in results}
    pairs = [(each, solved.get(each.curve.key)) for each in simulated]
    if is_short and case.figure.x == "p":
        for each, result in pairs:
            screen.show(simulation_grid(case, each, result))
            found = each.result
            value, error = found.lyapunov_exponent, found.lyapunov_exponent_error
            exponent = f"{LYAPUNOV_EXPONENT.symbol} = {_with_error(value, error)}"
            if result and result.lyapunov_exponent:
                exact = result.lyapunov_exponent.value
                exponent += f" (finite elements {exact:.6g}, {_deviation(value, error, exact)} s.e. away)"
            variance = f"{VARIANCE_RATE.symbol} = {_with_error(found.variance_rate, found.variance_rate_error)}"
            screen.packed([exponent, variance])
            screen.say(f"{found.paths} paths over a time of {found.time:.4g} in steps of {found.step:.4g}")
            screen.lines([""])
    else:
        screen.show(exponent_grid(case, pairs))
        if not is_short:
            screen.say(f"{len(simulated)} curves; all numbers are in {MONTE_CARLO}, one for each curve")
    for each, result in pairs if is_short else ():
        if each.response:
            solved_means = result.response.means if result and result.response else {}
            means, about = each.response.means.items(), each.response.about.means
            told = [simulated_mean(about[name], *mean, solved_means.get(name)) for name, mean in means]
            screen.say(f"{case.place(each.curve)}: stationary means")
            screen.packed(told, "  ")
            screen.lines([""])
    print_remarks(case, simulated, MONTE_CARLO)


def simulation_grid(case: Case, simulated: SimulatedCurve, result: CurveResult | None) -> Grid:
    """p, Λ(p) and its standard error; where it is known the value by finite elements, and how far away it is."""
    compared = [Column("finite elements", 2), Column("s.e. away", 1)] if result else []
    is_direct = any(each.estimator == "direct" for each in simulated.result.estimates)
    effective = "effective windows" if is_direct else "effective paths"  # a path has many windows
    columns = [Column("p"), Column(MOMENT.symbol), Column("± s.e."), *compared, Column(effective, 3)]
    grid = Grid(case.heading(simulated.curve), columns, remark=units_in_words(case, [MOMENT]))
    exact = dict(zip(result.moments.p.tolist(), result.moments.value.tolist(), strict=True)) if result else {}
    for estimate in simulated.result.estimates:
        known = exact.get(estimate.p) if estimate.p else 0.0
        cells = _sampled_cells(estimate.value, estimate.standard_error, known, is_compared=bool(result))
        grid.rows.append([f"{estimate.p:g}", *cells, f"{estimate.effective_paths:.0f}"])
    return grid


def exponent_grid(case: Case, pairs: Sequence[tuple[SimulatedCurve, CurveResult | None]]) -> Grid:
    """A row for each curve, or for more than `MOST_ROWS` those with the least and the largest λ: λ by both methods."""
    compared = [Column("finite elements", 2), Column("s.e. away", 1)] if any(result for _, result in pairs) else []
    is_digest, symbol = len(pairs) > MOST_ROWS, LYAPUNOV_EXPONENT.symbol
    which = [Column("which", is_text=True)] * is_digest
    columns = [*varied_columns(case), Column(symbol), Column("± s.e."), *compared, *which]
    grid = Grid(case.headline, columns, remark=units_in_words(case, [LYAPUNOV_EXPONENT]))
    if is_digest:
        ordered = sorted(pairs, key=lambda pair: pair[0].result.lyapunov_exponent)
        pairs = [ordered[0], ordered[-1]]
    words = [f"least {symbol}", f"largest {symbol}"] if is_digest else [""] * len(pairs)
    for (each, result), word in zip(pairs, words, strict=True):
        value, error = each.result.lyapunov_exponent, each.result.lyapunov_exponent_error
        known = result.lyapunov_exponent.value if result and result.lyapunov_exponent else None
        cells = _sampled_cells(value, error, known, is_compared=bool(compared))
        grid.rows.append([*map(written, each.curve.varied.values()), *cells, *[word] * is_digest])
    return grid


def _sampled_cells(value: float | None, error: float | None, known: float | None, *, is_compared: bool) -> list[str]:
    """A number with its standard error; where it is compared, what is known of it, and how far away that is."""
    row = ["none", ""] if value is None or error is None else [sampled(value, error), f"{error:.1e}"]
    if is_compared:
        row += ["" if known is None else f"{known:.6g}"]
        row += ["" if known is None or value is None or not error else _deviation(value, error, known)]
    return row


def _with_error(value: float, error: float) -> str:
    return f"{sampled(value, error)} ± {error:.1e}"


def sampled(value: float, error: float) -> str:
    """A number with as many decimals as two digits of its standard error have."""
    if error <= 0:
        return f"{value:g}"
    decimals = 1 - math.floor(math.log10(error))
    return f"{value:.{decimals}f}" if 0 <= decimals <= 9 else f"{value:.3g}"


def simulated_mean(mean: Quantity, value: float, error: float, exact: Estimate | None) -> str:
    """A mean of a simulated response, and how far that by finite elements is away, where there is one."""
    text = f"{mean.symbol} = {_with_error(value, error)}"
    if exact is None or not error:
        return text
    return f"{text} (finite elements {exact.value:.6g}, {_deviation(value, error, exact.value)} s.e. away)"


def _deviation(value: float, error: float, exact: float) -> str:
    return f"{(value - exact) / error:+.1f}"


def moment_grid(case: Case, result: CurveResult) -> Grid:
    is_reduced = result.curve.theory_reduces_noise
    theory = Column(f"perturbation, Eq. {MOMENT.closed_form}{'*' if is_reduced else ''}", 1)
    spreads = spreads_of(case, result).moments
    intervals = [Column(INTERVAL), Column("P(Λ < 0)")] * bool(spreads)
    columns = [Column("p"), Column(MOMENT.symbol), Column("± error"), theory, Column("difference", 2)]
    moments = result.moments
    has_theory = any(map(math.isfinite, moments.perturbation))
    remark = "; ".join(filter(None, [STAR * (is_reduced and has_theory), units_in_words(case, [MOMENT, *_told(case)])]))
    shown_columns = [*columns[:3], *intervals, *(columns[3:] if has_theory else [])]
    grid = Grid(case.heading(result.curve), shown_columns, remark=remark)
    for p, value, error, closed in zip(
        moments.p, moments.value, moments.error_estimate, moments.perturbation, strict=True
    ):
        shown = f"{error:.0e}" if error else "0"
        spread = spreads.get(float(p))
        interval = ["", ""] if spread is None else [interval_text(spread), percent(spread.below)]
        compared = [f"{closed + 0.0:.6g}", f"{value - closed + 0.0:.2e}"] if has_theory else []
        grid.rows.append([f"{p + 0.0:g}", digits(value, error), shown, *interval * bool(intervals), *compared])
    return grid


def chart_grid(case: Case, chart: Chart) -> Grid:
    """The branches of every line, and their special points."""
    keys = charted(case).x.key, charted(case).y.key
    names = short_names(keys)
    columns = [Column("line"), Column("branch", 1), Column("points", 2), *map(Column, names)]
    grid = Grid(case.headline, [*columns, Column("special point", is_text=True)])
    for line in chart.lines:
        for number, branch in enumerate(line.branches, start=1):
            special = [i for i, label in enumerate(branch.labels) if label]
            count = f"{branch.x.size}{', closed' if branch.closed else ''}"
            grid.rows.append([line.zero.equation, str(number), count, "", "", ""])
            for i in special:
                label = branch.labels[i]
                for key, name in zip(keys, names, strict=True):
                    label = label.replace(f"{key} ", f"{name} ")
                grid.rows.append(["", "", "", f"{branch.x[i]:.7g}", f"{branch.y[i]:.7g}", label])
            grid.ends.add(len(grid.rows) - 1)
    return grid


def print_chart(case: Case, chart: Chart) -> None:
    """The special points of every line, and what the regions are."""
    screen = Screen.of()
    screen.show(chart_grid(case, chart))
    for region in () if chart.regions is None else chart.regions.each:
        screen.say(f"{region.share:5.1%}  {region.name}")
    for text in in_case_words(chart.remarks):
        print_remark(f"{case.name}: {text}")


def print_comparisons(case: Case, comparisons: Sequence[Comparison]) -> None:
    """Print what a case expects beside what was computed; with more than `MOST_ROWS` values those that differ."""
    screen = Screen.of()
    if not comparisons:
        screen.say(f"{case.name}: nothing is expected; add [[expect]] to the case")
        return
    shown = comparisons if len(comparisons) <= MOST_ROWS else [each for each in comparisons if not each.met]
    if shown:
        screen.show(_comparison_grid(case, shown[:MOST_ROWS], is_short=len(comparisons) > MOST_TABLES))
    if len(shown) > MOST_ROWS:
        screen.say(f"{case.name}: {len(shown) - MOST_ROWS} more differ")
    screen.say(agreement(comparisons) if shown else f"{case.name}: {agreement(comparisons)}")


def agreement(comparisons: Sequence[Comparison]) -> str:
    return f"{sum(item.met for item in comparisons)} of {len(comparisons)} ok"


def _comparison_grid(case: Case, comparisons: Sequence[Comparison], *, is_short: bool) -> Grid:
    """A row for each value: with its source, or in one line, with two digits more than the tolerance has."""
    first = [Column("quantity"), *varied_columns(case)] if is_short else [Column("quantity", is_text=True)]
    tolerance = [Column("±", 2)] if is_short else []
    numbers = [Column("expected"), *tolerance, Column("computed"), Column("difference", 1), Column("")]
    grid = Grid(f"{case.name}: {case.headline}", [*first, *numbers])
    for item in comparisons:
        wanted, value = item.expectation, item.value
        quantity = wanted.quantity if wanted.p is None else f"{wanted.quantity}, p = {wanted.p:g}"
        error = f"{item.tolerance:.0e}"
        expected, computed = (
            "none" if each is None else digits(each, item.tolerance / 100, 12) if is_short else f"{each:.12g}"
            for each in (wanted.value, value)
        )
        row: list[Cell]
        if is_short:
            row = [quantity, *map(written, item.varied.values()), expected, error, computed]
        else:
            where = "".join(f"\n{key} = {written(each)}" for key, each in item.varied.items())
            row = [Text.assemble(f"{quantity}{where}\n", (wanted.source, "dim")), f"{expected}\n± {error}", computed]
            grid.ends.add(len(grid.rows))
        difference = "" if value is None else f"{value - wanted.value:.1e}"
        grid.rows.append([*row, difference, Text("ok", "green") if item.met else Text("differs", "bold red")])
    return grid


def print_remarks(
    case: Case,
    found: Sequence[CurveResult | SimulatedCurve],
    file: str = SUMMARY,
    severities: Iterable[Severity] = STYLES,
) -> None:
    """Print what is said of the curves of a case on the standard error: who, what, whose numbers, where the others are.

    Args:
        case: whose curves these are.
        found: what was found of them.
        file: that holds all messages; empty where nothing is written.
        severities: of the messages that are printed, in this order.
    """
    groups: dict[Severity, dict[Any, list[tuple[Message, Curve]]]] = {severity: {} for severity in severities}
    for each in found:
        for severity, kinds in groups.items():
            for message in map(message_of, each.remarks.get(severity, ())):
                is_on_theory = message.code in (Code.STRONG_NOISE, Code.LOAD_LEFT_OUT)
                if is_on_theory and not (file and shows_perturbed_moments(case, len(found))):
                    continue
                kinds.setdefault(message.kind, []).append((message, each.curve))
    for severity, kinds in groups.items():
        for group in list(kinds.values())[:MOST_KINDS]:
            worst, whose = max(group, key=lambda one: -math.inf if one[0].size is None else one[0].size)
            curves = {curve.number: curve for _, curve in group}
            who, rest = f"{case.name}: {len(curves)} of {len(found)} curves", ""
            if len(curves) <= MOST_NAMED:
                *others, last = [curve.label for curve in curves.values()]
                comma = "; " if any("," in label for label in (*others, last)) else ", "
                named = " and ".join(filter(None, (comma.join(others), last)))
                who = f"{case.name}, {named}" if named else case.name
            if any(message.data != worst.data for message, _ in group):
                words = "these numbers are of" if worst.size is None else "most for"
                rest = f"; {words} {whose.label}" if len(curves) > 1 else f"; and {len(group) - 1} more like this one"
                rest += f" (all in {file})" if file else ""
            print_remark(f"{who}: {worst.words(CASE_WORDS)}{rest}", severity)
        if (left := len(kinds) - MOST_KINDS) > 0:
            print_remark(f"{case.name}: {left} more of this kind{f' are in {file}' if file else ''}", severity)


def shows_perturbed_moments(case: Case, count: int) -> bool:
    """Whether the table of so many curves or the figure shows Eq. (37)."""
    over_p = case.figure.x == "p" and (count <= MOST_TABLES or case.output.figure)
    return over_p or (case.figure.moment is not None and case.output.figure and not map_key(case.figure, case.vary))


def print_remark(text: str, severity: Severity = Severity.NOTE) -> None:
    """A sentence on the standard error, in lines that fit, indented from the second on."""
    word, style = STYLES[severity]
    Screen.of(errors=True).say(f"{word}: {text}", style)


def print_message(case: Case, message: Message) -> None:
    """What is said of the files of a case."""
    print_remark(f"{case.name}: {message.words(CASE_WORDS)}", message.severity)


def note_missing(case: Case, *, monte_carlo: bool) -> None:
    """What a run leaves out: dots of a simulation that has none to give, pictures, and what nobody has named."""
    if monte_carlo and case.figure.y == STABILITY_INDEX.name:
        print_remark(f"{case.name}: a simulation gives no stability index, so that the figure has no dots")
    if case.output.asks_for_eigenfunctions and (why := case.problem.no_picture):
        print_remark(f"{case.name}: no eigenfunctions are written: {why}")
    if case.leaves_out_response:
        why = f"no stationary response is computed, as there are more than {MOST_DRAWN} curves"
        print_remark(f'{case.name}: {why}; name "{RESPONSE}" in [output] quantities to have its means')
    if case.unasked:
        print_remark(
            f"{case.name}: there are also {', '.join(case.unasked)}: name them in [output] quantities, or --all"
        )
