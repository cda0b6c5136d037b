"""The command line: fpsolve run | check | mesh."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, CycloptsError, Parameter, Token
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from fpsolve.errors import FpsolveError, NotConverged

if TYPE_CHECKING:
    from fpsolve.case import Case
    from fpsolve.curves import Comparison, CurveResult
    from fpsolve.estimate import Estimate

CHECK_FAILED, BAD_INPUT, NOT_CONVERGED, INTERRUPTED = 1, 2, 3, 130

app = App(
    name="fpsolve",
    help="""Moment Lyapunov exponents of a vibro-impact oscillator under coloured noise, by finite elements.

    Example: fpsolve run cases/fig1.toml""",
    version=lambda: f"fpsolve {version('fpsolve')}",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
Cases = Annotated[list[Path], Parameter(help="Case files.", consume_multiple=True, negative="")]
Overrides = Annotated[
    list[str] | None,
    Parameter(name="--set", help="Another value for a key of the case, e.g. oscillator.omega=2.0.", negative=""),
]


@app.command
def run(
    cases: Cases,
    *,
    out: Annotated[Path, Parameter(help="Folder for the results.")] = Path("results"),
    overrides: Overrides = None,
) -> int:
    """Solve case files; write tables, figures and ParaView files into OUT/<case>/.

    Example: fpsolve run cases/fig1.toml --out results --set oscillator.omega=2.0
    """
    from fpsolve import curves, report

    loaded = _load(cases, overrides)
    _refuse_namesakes(loaded)
    code = 0
    for case in loaded:
        try:
            with _progress(case.name, curves.work(case)) as advance:
                results = report.run(case, out, advance=advance)
        except NotConverged as failure:
            results, code = failure.partial, NOT_CONVERGED
        _print_results(case, results)
        print(f"written: {out / case.name}")
    return code


@app.command
def check(cases: Cases, *, overrides: Overrides = None) -> int:
    """Solve case files and compare with the values that they expect; write nothing.

    Example: fpsolve check cases/fig1.toml cases/minimal.toml
    """
    from fpsolve import curves

    code = 0
    for case in _load(cases, overrides):
        with _progress(case.name, curves.work(case)) as advance:
            results = [result.without_pairs() for result in curves.solve(case, advance=advance)]
        comparisons = curves.compare(case, results)
        _print_comparisons(case, comparisons)
        _print_warnings(case, results)
        if any(result.failures for result in results):
            code = NOT_CONVERGED
        elif not all(comparison.met for comparison in comparisons):
            code = max(code, CHECK_FAILED)
    return code


def _whole(_: type, tokens: Sequence[Token]) -> int:
    """A whole number; cyclopts alone would take 2.5 for 2."""
    return int(tokens[0].value)


Count = Annotated[int, Parameter(converter=_whole)]


@app.command
def mesh(
    output: Annotated[Path, Parameter(help="The file to write: .vtu for ParaView, .msh for Gmsh.")],
    *,
    phi_cells: Annotated[Count, Parameter(help="Cells in the phase from one impact to the next.")] = 2,
    phi_degree: Annotated[Count, Parameter(help="Degree of the elements in the phase.")] = 10,
    xi_cells: Annotated[Count, Parameter(help="Cells in the noise.")] = 4,
    xi_degree: Annotated[Count, Parameter(help="Degree of the elements in the noise.")] = 9,
    xi_min: Annotated[float, Parameter(help="Lower end of the noise, in standard deviations.")] = -8.0,
    xi_max: Annotated[float, Parameter(help="Upper end of the noise, in standard deviations.")] = 8.0,
    grading: Annotated[
        float, Parameter(help="Size of the outermost noise cells over the innermost; 1 is uniform.")
    ] = 1.0,
    full_circle: Annotated[bool, Parameter(help="Mesh the whole circle instead of one half.", negative="")] = False,
) -> int:
    """Write a mesh that a case can name as [mesh] file.

    Example: fpsolve mesh meshes/graded.vtu --phi-cells 3 --xi-cells 8 --grading 2
    """
    from fpsolve.mesh import make_mesh, write_mesh

    made = make_mesh(
        phi_cells=phi_cells,
        phi_degree=phi_degree,
        xi_cells=xi_cells,
        xi_degree=xi_degree,
        xi_min=xi_min,
        xi_max=xi_max,
        grading=grading,
        full_circle=full_circle,
    )
    write_mesh(made, output)
    cells = (made.phi_lines.size - 1) * (made.z_lines.size - 1)
    unknowns = (made.phi_lines.size - 1) * (phi_degree + 1) * ((made.z_lines.size - 1) * xi_degree + 1)
    print(f"written: {output} ({cells} cells, {unknowns} unknowns)")
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit code is 0 for success, 1 a failed check, 2 bad input, 3 not converged."""
    for stream in (sys.stdout, sys.stderr):  # a terminal that has no Greek shows "?" for it
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        code = app(argv, result_action="return_value", exit_on_error=False, error_console=_stderr())
    except CycloptsError:  # cyclopts has said what is wrong
        return BAD_INPUT
    except NotConverged as failure:
        _print_error(str(failure))
        return NOT_CONVERGED
    except FpsolveError as failure:
        _print_error(str(failure))
        return BAD_INPUT
    except KeyboardInterrupt:
        _print_error("interrupted")
        return INTERRUPTED
    return code if isinstance(code, int) else 0


def _stderr() -> Console:
    return Console(stderr=True)


def _print_error(text: str) -> None:
    _stderr().print(Text(text), style="bold red", soft_wrap=True)


def _load(paths: Sequence[Path], overrides: Sequence[str] | None) -> list[Case]:
    """All cases, or one error that lists the faults of all of them."""
    from fpsolve.case import load_case
    from fpsolve.errors import CaseError

    cases, errors = [], []
    for path in paths:
        try:
            cases.append(load_case(path, overrides or ()))
        except CaseError as error:
            errors.append(str(error))
    if errors:
        raise FpsolveError("\n".join(errors))
    return cases


def _refuse_namesakes(cases: Sequence[Case]) -> None:
    names = [case.name for case in cases]
    for name in names:
        if names.count(name) > 1:
            raise FpsolveError(f'several cases are called "{name}" and would overwrite each other; run them apart')


@contextmanager
def _progress(name: str, total: int) -> Iterator[Callable[[], None]]:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=_stderr(), transient=True) as progress:
        task = progress.add_task(name, total=total)
        yield lambda: progress.advance(task)


def _print_results(case: Case, results: Sequence[CurveResult]) -> None:
    console = Console()
    if case.figure.x == "p":
        for result in results:
            console.print(_moment_table(case, result))
            console.print(_indices(result), highlight=False)
    else:
        console.print(_curve_table(case, results))
    _print_warnings(case, results)


def _print_warnings(case: Case, results: Sequence[CurveResult]) -> None:
    """What limits the numbers of each curve, why some are missing, and which theory is not valid."""
    for result in results:
        failures = {line for failure in result.failures for line in failure.splitlines()}
        place = ", ".join([case.name, *(f"{key} = {value:g}" for key, value in result.curve.varied.items())])
        kinds = [
            ("not converged", "bold red") if text in failures else ("warning", "yellow") for text in result.warnings
        ]
        for (kind, style), text in zip(kinds, result.warnings, strict=True):
            _stderr().print(Text(f"{kind}: {place}: {text}"), style=style, soft_wrap=True)
        for text in result.notes:
            _stderr().print(Text(f"note: {place}: {text}"), style="cyan", soft_wrap=True)


def _moment_table(case: Case, result: CurveResult) -> Table:
    """p, Λ(p), Eq. (37) and the difference."""
    table = Table(
        "p",
        "Λ(p)",
        "± error",
        _theory(case, "(37)"),
        "difference",
        title=Text(_heading(case, result)),
        title_justify="left",
    )
    _align(table)
    _explain_star(table, case)
    moments = result.moments
    for p, value, error, theory in zip(
        moments.p, moments.value, moments.error_estimate, result.moments_perturbation, strict=True
    ):
        table.add_row(f"{p:g}", digits(value, error), f"{error:.0e}", f"{theory + 0.0:.6g}", f"{value - theory:.2e}")
    return table


def _indices(result: CurveResult) -> str:
    """λ, δ_p and Λ″(0) in a line."""
    parts = []
    for name, estimate in (
        ("λ", result.lyapunov_exponent),
        ("δ_p", result.stability_index),
        ("Λ″(0)", result.variance_rate),
    ):
        error = f" ± {estimate.error_estimate:.0e}" if estimate else ""
        parts.append(f"{name} = {_digits_of(estimate, most=9)}{error}")
    return "   ".join(parts) + "\n"


def _curve_table(case: Case, results: Sequence[CurveResult]) -> Table:
    """One row for each parameter set: λ, Eq. (39), δ_p and Eq. (38)."""
    from fpsolve import perturbation

    names = (key.partition(".")[2] for key in case.vary)
    table = Table(
        *names, "λ", _theory(case, "(39)"), "δ_p", _theory(case, "(38)"), title=Text(case.title), title_justify="left"
    )
    _align(table)
    _explain_star(table, case)
    for result in results:
        curve = result.curve
        table.add_row(
            *(f"{value:g}" for value in curve.varied.values()),
            _digits_of(result.lyapunov_exponent, most=7),
            f"{perturbation.lyapunov_exponent(curve.oscillator, curve.noise):.6g}",
            _digits_of(result.stability_index, most=7),
            f"{perturbation.stability_index(curve.oscillator, curve.noise):.6g}",
        )
    return table


def _theory(case: Case, equation: str) -> str:
    """Heading of a column of perturbation theory, starred where it has another noise than the solution."""
    return f"Eq. {equation}*" if case.is_exact else f"Eq. {equation}"


def _print_comparisons(case: Case, comparisons: Sequence[Comparison]) -> None:
    console = Console()
    if not comparisons:
        console.print(f"{case.name}: nothing is expected; add [[expect]] to the case", markup=False)
        return
    table = Table("quantity", "expected", "computed", "difference", "", title=Text(f"{case.name}: {case.title}"))
    table.title_justify = "left"
    _align(table)
    table.columns[0].justify, table.columns[0].no_wrap, table.columns[0].overflow = "left", False, "fold"
    for item in comparisons:
        expectation = item.expectation
        name = expectation.quantity if expectation.p is None else f"{expectation.quantity}, p = {expectation.p:g}"
        where = "".join(f"\n{key} = {value:g}" for key, value in item.varied.items())
        table.add_row(
            f"{name}{where}\n[dim]{escape(expectation.source)}[/dim]",
            f"{expectation.value:.12g}\n± {item.tolerance:.0e}",
            "none" if item.value is None else f"{item.value:.12g}",
            "" if item.value is None else f"{item.value - expectation.value:.1e}",
            "[green]ok[/green]" if item.met else "[bold red]differs[/bold red]",
        )
    console.print(table)
    console.print(f"{sum(item.met for item in comparisons)} of {len(comparisons)} ok")


def _heading(case: Case, result: CurveResult) -> str:
    varied = ", ".join(f"{key} = {value:g}" for key, value in result.curve.varied.items())
    return f"{case.title}: {varied}" if varied else case.title


def _align(table: Table) -> None:
    for column in table.columns:
        column.justify, column.no_wrap = "right", True


def _explain_star(table: Table, case: Case) -> None:
    if case.is_exact:
        table.caption, table.caption_justify = "* for the noise reduced by Eqs. (12)-(14)", "left"


def _digits_of(estimate: Estimate | None, most: int) -> str:
    return digits(estimate.value, estimate.error_estimate, most) if estimate else "none found"


def digits(value: float, error: float, most: int = 13) -> str:
    """A number with the digits that its error leaves, at most so many significant ones; 0 where it leaves none."""
    if abs(value) <= error:
        return "0"
    count = most if error <= 0 else math.floor(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    return f"{value:#.{min(max(count, 1), most)}g}".rstrip(".")


if __name__ == "__main__":
    sys.exit(main())
