"""Find the sizes that the benchmark uses: `python -m tests.benchmarks.tune [METHOD ...]`.

Each peer climbs its ladder in each case, all 33 p, until the error is small enough, or the curve takes more than
`SECONDS` or `MEGABYTES`. Then the best size within these limits counts. This time is part of no result.
"""

from __future__ import annotations

import sys
from typing import Any

from tests.benchmarks.measure import PEERS, Measurement, MethodFailed, measure, unavailable
from tests.benchmarks.problem import CASES

SECONDS, MEGABYTES = 120.0, 4000.0


def tune(method: str, case: str) -> tuple[Any, Measurement] | None:
    """The first size that meets the accuracy, or the best one within the limits; None if none gave a curve."""
    best = None
    for size in PEERS[method].sizes[case]:
        try:
            result = measure(method, case, size, timeout=3 * SECONDS)
        except MethodFailed as failure:
            print(f"{method:16} {case:7} {size!s:20} {failure}", flush=True)
            continue
        print(f"{method:16} {case:7} {size!s:20} {result}", flush=True)
        if result.seconds > SECONDS or result.peak_mb > MEGABYTES:
            break
        if best is None or result.error < best[1].error:
            best = size, result
        if result.error <= CASES[case].rtol:
            break
    return best


def main(methods: list[str]) -> None:
    """Print the tuned size of each method and case."""
    for method in methods or PEERS:
        if (reason := unavailable(method)) is not None:
            print(reason)
            continue
        for case in CASES:
            best = tune(method, case)
            reached = best is not None and best[1].error <= CASES[case].rtol
            print(f"==> {method} {case}: {best[0] if best else None}{'' if reached else ', not reached'}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
