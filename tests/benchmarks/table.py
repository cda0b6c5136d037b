"""Speed and memory of fpsolve and of four peers: `python -m tests.benchmarks.table`.

The ratios are those of one run on one machine; the times themselves depend on the machine and on what else it does.
"""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from tests.benchmarks.measure import METHODS, PEERS, Measurement, MethodFailed, baseline, measure, unavailable
from tests.benchmarks.problem import CASES

TIMEOUT = 1800.0
_COLUMNS = ("case", "method", "size", "error", "time / s", "time / fpsolve's", "unknowns", "peak / MB")


def rows(case: str) -> list[tuple[str, ...]]:
    """The lines of one case, fpsolve first."""
    lines, seconds = [], None
    for method in METHODS:
        name = PEERS[method].name if method in PEERS else "fpsolve"
        size = str(PEERS[method].tuned[case]) if method in PEERS else "adaptive"
        reason = unavailable(method)
        try:
            result = None if reason else measure(method, case, timeout=TIMEOUT)
        except MethodFailed as failure:
            result, reason = None, str(failure)
        if result is None:
            lines.append((case, name, size, str(reason), *[""] * 4))
            continue
        if method == "fpsolve":
            seconds = result.seconds
        lines.append((case, name, size, *_numbers(result, CASES[case].rtol, seconds)))
    return lines


def _numbers(result: Measurement, rtol: float, seconds: float | None) -> tuple[str, ...]:
    error = f"{result.error:.1e}" + ("" if result.error <= rtol else ", not reached")
    ratio = "" if seconds is None else f"{result.seconds / seconds:.3g}"
    return error, f"{result.seconds:.3g}", ratio, str(result.unknowns), f"{result.peak_mb:.0f}"


def main() -> None:
    """Measure everything and print the table."""
    table = Table(*_COLUMNS, caption=f"An interpreter with NumPy and SciPy alone has {baseline():.0f} MB.")
    for name, case in CASES.items():
        table.add_section()
        for line in rows(name):
            table.add_row(*line)
        table.add_row("", f"demanded: error ≤ {case.rtol:g} · max(|Λ|, scale), {case.p.size} p", *[""] * 6, style="dim")
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
