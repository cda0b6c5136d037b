"""Results as tables on the terminal; what limits them goes to the standard error."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from textwrap import wrap

from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table
from rich.text import Text

from fpsolve.case.case import Case
from fpsolve.case.curves import Curve
from fpsolve.case.vary import WORDS, written
from fpsolve.exponent.quantities import (
    CRITICAL_RESTITUTION,
    IMPACT_RATE,
    INDICES,
    LYAPUNOV_EXPONENT,
    MOMENT,
    STABILITY_INDEX,
    VARIANCE_RATE,
    Quantity,
)
from fpsolve.output.tables import asked
from fpsolve.study.chart import Chart, charted
from fpsolve.study.results import Comparison, CurveResult, SimulatedCurve
from fpsolve.theory.far import grows_far_out

MOST_TABLES, MOST_REMARKS = 50, 20
"""Curves whose tables are printed, and remarks on them."""


def print_results(case: Case, results: Sequence[CurveResult]) -> None:
    """Λ(p), or λ and δ_p over a parameter, beside perturbation theory."""
    console = Console()
    if len(results) > MOST_TABLES:
        _print_lines(console, [case.headline, _count(results), ""])
    elif case.figure.x == "p":
        for result in results:
            if result.moments.p.size:
                console.print(_moment_table(case, result))
            groups = _indices(case, result) if any(result.estimates.values()) else []
            _print_lines(console, [*(line for group in groups for line in _packed(group, console.width)), ""])
    else:
        console.print(_curve_table(case, results))
    print_warnings(case, results)


def print_warnings(case: Case, results: Sequence[CurveResult]) -> None:
    """Why some numbers of some curves are missing, then what limits the others, then which theory is not valid."""
    remarks = [
        *(("not converged", "bold red", each.curve, fault.reason) for each in results for fault in each.failures),
        *(("warning", "yellow", each.curve, text) for each in results for text in each.warnings),
        *(("note", "cyan", each.curve, text) for each in results for text in each.notes),
    ]
    for kind, style, curve, text in remarks[:MOST_REMARKS]:
        _remark(case, curve, kind, style, [text])
    untold = Counter(kind for kind, *_ in remarks[MOST_REMARKS:])
    if untold:
        plural = {"warning": "warnings", "note": "notes"}
        counts = ", ".join(f"{count} {plural.get(kind, kind)}" for kind, count in untold.items())
        print_remark(f"note: {case.name}: more remarks are in summary.json: {counts}", "cyan")


def _count(results: Sequence[CurveResult]) -> str:
    """How many curves have become what."""
    counts = Counter(result.status for result in results)
    states = ", ".join(f"{count} {status.name.lower()}" for status, count in sorted(counts.items()))
    return f"{len(results)} curves: {states}; their numbers are in curves.csv and results.nc"


def _remark(case: Case, curve: Curve, kind: str, style: str, texts: Sequence[str]) -> None:
    for text in texts:
        print_remark(f"{kind}: {case.place(curve)}: {text}", style)


def print_remark(text: str, style: str) -> None:
    """A sentence on the standard error, in lines that fit, indented from the second on."""
    console = Console(stderr=True)
    width = max(console.width - 1, 20)
    lines = wrap(text, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    _print_lines(console, lines, style)


def _print_lines(console: Console, lines: Sequence[str], style: str = "") -> None:
    """Lines as they are."""
    for line in lines:
        console.print(Text(line), style=style, soft_wrap=True)


def _packed(parts: Sequence[str], width: int) -> list[str]:
    """Texts in as few lines as hold them whole."""
    lines: list[str] = []
    for part in parts:
        if lines and len(lines[-1]) + 3 + len(part) < width:
            lines[-1] += f"   {part}"
        else:
            lines.append(part)
    return lines


def print_simulation(case: Case, simulated: Sequence[SimulatedCurve], results: Sequence[CurveResult] = ()) -> None:
    """Λ(p) and λ by simulation, with the finite elements beside them where these have been solved."""
    console = Console()
    solved = {result.curve.key: result for result in results}
    pairs = [(each, solved.get(each.curve.key)) for each in simulated]
    if case.figure.x == "p":
        for each, result in pairs:
            console.print(_simulation_table(case, each, result))
            found = each.result
            size = f"{found.paths} paths over a time of {found.time:.4g} in steps of {found.step:.4g}"
            _print_lines(console, [*_packed(_simulated_indices(each, result), console.width), size, ""])
    else:
        console.print(_exponent_table(case, pairs))
    for each in simulated:
        if each.response:
            means = [f"{name} = {_with_error(*mean)}" for name, mean in each.response.means.items()]
            lines = [f"  {line}" for line in _packed(means, console.width - 2)]
            _print_lines(console, [f"{case.place(each.curve)}: stationary means", *lines, ""])
        _remark(case, each.curve, "warning", "yellow", each.warnings)


def _simulated_indices(simulated: SimulatedCurve, result: CurveResult | None) -> list[str]:
    """λ, with the value by finite elements where it is known, and Λ″(0)."""
    found = simulated.result
    value, error = found.lyapunov_exponent, found.lyapunov_exponent_error
    text = f"{LYAPUNOV_EXPONENT.symbol} = {_with_error(value, error)}"
    if result and result.lyapunov_exponent:
        exact = result.lyapunov_exponent.value
        text += f" (finite elements {exact:.6g}, {_deviation(value, error, exact)} s.e. away)"
    return [text, f"{VARIANCE_RATE.symbol} = {_with_error(found.variance_rate, found.variance_rate_error)}"]


def _simulation_table(case: Case, simulated: SimulatedCurve, result: CurveResult | None) -> Table:
    """p, Λ(p) and its standard error; where it is known the value by finite elements, and how far away it is."""
    compared = ("finite elements", "s.e. away") if result else ()
    table = _table(case.heading(simulated.curve), "p", MOMENT.symbol, "± s.e.", *compared, "effective paths")
    exact = dict(zip(result.moments.p.tolist(), result.moments.value.tolist(), strict=True)) if result else {}
    for estimate in simulated.result.estimates:
        value, error = estimate.value, estimate.standard_error
        row = ["none", ""] if value is None or error is None else [sampled(value, error), f"{error:.1e}"]
        if result:
            known = exact.get(estimate.p) if estimate.p else 0.0
            row += ["" if known is None else f"{known:.6g}"]
            row += ["" if known is None or value is None or not error else _deviation(value, error, known)]
        table.add_row(f"{estimate.p:g}", *row, f"{estimate.effective_paths:.0f}")
    return table


def _exponent_table(case: Case, pairs: Sequence[tuple[SimulatedCurve, CurveResult | None]]) -> Table:
    """One row for each parameter set: λ by simulation and by finite elements."""
    table = _table(
        case.headline, *_varied_columns(case), LYAPUNOV_EXPONENT.symbol, "± s.e.", "finite elements", "s.e. away"
    )
    for each, result in pairs:
        value, error = each.result.lyapunov_exponent, each.result.lyapunov_exponent_error
        known = result.lyapunov_exponent.value if result and result.lyapunov_exponent else None
        exact = ("", "") if known is None else (f"{known:.6g}", _deviation(value, error, known))
        varied = map(written, each.curve.varied.values())
        table.add_row(*varied, sampled(value, error), f"{error:.1e}", *exact)
    return table


def _with_error(value: float, error: float) -> str:
    return f"{sampled(value, error)} ± {error:.1e}"


def sampled(value: float, error: float) -> str:
    """A number with as many decimals as two digits of its standard error have."""
    if error <= 0:
        return f"{value:g}"
    decimals = 1 - math.floor(math.log10(error))
    return f"{value:.{decimals}f}" if 0 <= decimals <= 9 else f"{value:.3g}"


def _deviation(value: float, error: float, exact: float) -> str:
    return f"{(value - exact) / error:+.1f}"


def _moment_table(case: Case, result: CurveResult) -> Table:
    """p, Λ(p), Eq. (37) and the difference."""
    is_exact = result.curve.is_exact
    table = _table(case.heading(result.curve), "p", MOMENT.symbol, "± error", _theory(MOMENT, is_exact), "difference")
    _explain_star(table, is_exact)
    moments = result.moments
    for p, value, error, theory in zip(
        moments.p, moments.value, moments.error_estimate, moments.perturbation, strict=True
    ):
        shown = f"{error:.0e}" if error else "0"
        table.add_row(f"{p + 0.0:g}", digits(value, error), shown, f"{theory + 0.0:.6g}", f"{value - theory + 0.0:.2e}")
    return table


def _indices(case: Case, result: CurveResult) -> list[list[str]]:
    """λ, δ_p and Λ″(0), each with its error, and apart from them what concerns impacts; what the case asks for."""
    groups: list[list[str]] = [[]]
    for name in asked(case):
        estimate = result.estimates[name]
        error = f" ± {estimate.error_estimate:.0e}" if estimate else ""
        if name == IMPACT_RATE.name:
            groups.append([])
        groups[-1].append(f"{INDICES[name].symbol} = {_digits_of(name, result, most=9)}{error}")
    return groups


def _curve_table(case: Case, results: Sequence[CurveResult]) -> Table:
    """One row for each parameter set: λ, Eq. (39), δ_p and Eq. (38)."""
    indices = [INDICES[name] for name in (LYAPUNOV_EXPONENT.name, STABILITY_INDEX.name) if name in asked(case)]
    is_exact = any(result.curve.is_exact for result in results)
    headings = (text for index in indices for text in (index.symbol, _theory(index, is_exact)))
    table = _table(case.headline, *_varied_columns(case), *headings)
    _explain_star(table, is_exact)
    for result in results:
        row = list(map(written, result.curve.varied.values()))
        for index in indices:
            row += [_digits_of(index.name, result, most=7), f"{index.theory(result.curve.problem):.6g}"]
        table.add_row(*row)
    return table


def _varied_columns(case: Case) -> list[str | Column]:
    """A column for each varied key; those of texts give way to numbers where the terminal is narrow."""
    names = {key: key.partition(".")[2] for key in case.vary.keys}
    return [Column(name, overflow="fold") if key in WORDS else name for key, name in names.items()]


def _theory(quantity: Quantity, is_exact: bool) -> str:
    """Heading of a column of perturbation theory, starred where it has another noise than some solution."""
    return f"Eq. {quantity.equation}{'*' if is_exact else ''}"


def print_chart(case: Case, chart: Chart) -> None:
    """The special points of every line, and what the regions are."""
    names = (axis.key.partition(".")[2] for axis in (charted(case).x, charted(case).y))
    table = _table(case.headline, Column("line"), "branch", "points", *names, Column("special point"))
    for line in chart.lines:
        for number, branch in enumerate(line.branches, start=1):
            special = [i for i, label in enumerate(branch.labels) if label]
            count = f"{branch.x.size}{', closed' if branch.closed else ''}"
            table.add_row(line.zero.equation, str(number), count, "", "", "", end_section=not special)
            for i in special:
                place = f"{branch.x[i]:.7g}", f"{branch.y[i]:.7g}"
                label = branch.labels[i].replace("oscillator.", "").replace("noise.", "")
                table.add_row("", "", "", *place, label, end_section=i == special[-1])
    console = Console()
    console.print(table)
    for region in () if chart.regions is None else chart.regions.each:
        console.print(f"{region.share:5.1%}  {region.name}", highlight=False)
    for text in chart.remarks:
        print_remark(f"note: {case.name}: {text}", "cyan")


def print_comparisons(case: Case, comparisons: Sequence[Comparison]) -> None:
    """What a case expects beside what was computed."""
    console = Console()
    if not comparisons:
        console.print(f"{case.name}: nothing is expected; add [[expect]] to the case", markup=False)
        return
    table = _table(
        f"{case.name}: {case.headline}", Column("quantity", overflow="fold"), "expected", "computed", "difference", ""
    )
    for item in comparisons:
        expectation = item.expectation
        name = expectation.quantity if expectation.p is None else f"{expectation.quantity}, p = {expectation.p:g}"
        where = "".join(f"\n{key} = {written(value)}" for key, value in item.varied.items())
        table.add_row(
            f"{name}{where}\n[dim]{escape(expectation.source)}[/dim]",
            f"{expectation.value:.12g}\n± {item.tolerance:.0e}",
            "none" if item.value is None else f"{item.value:.12g}",
            "" if item.value is None else f"{item.value - expectation.value:.1e}",
            "[green]ok[/green]" if item.met else "[bold red]differs[/bold red]",
        )
    console.print(table)
    console.print(f"{sum(item.met for item in comparisons)} of {len(comparisons)} ok")


def _table(title: str, *columns: str | Column) -> Table:
    """An empty table; of a column with its heading alone the entries stand on the right."""
    aligned = (Column(each, justify="right", no_wrap=True) if isinstance(each, str) else each for each in columns)
    return Table(*aligned, title=Text(title), title_justify="left")


def _explain_star(table: Table, is_exact: bool) -> None:
    if is_exact:
        table.caption, table.caption_justify = "* for the noise reduced by Eqs. (12)-(14)", "left"


def _digits_of(name: str, result: CurveResult, most: int) -> str:
    estimate = result.estimates[name]
    if estimate is None:
        is_told = name == CRITICAL_RESTITUTION.name or grows_far_out(result.curve.problem)
        return "none" if is_told else "none found"
    return digits(estimate.value, estimate.error_estimate, most)


def digits(value: float, error: float, most: int = 13) -> str:
    """A number with the digits that its error leaves, at most so many significant ones; 0 where it leaves none."""
    if abs(value) <= error:
        return "0"
    count = most if error <= 0 else math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    return f"{value:#.{min(max(count, 1), most)}g}".rstrip(".")
