"""Keys that case files had once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

_SETS = 'write sets of values into a file, and [vary] with file = "sets.csv"'
REMOVED: Mapping[tuple[str, ...], str] = {
    ("design",): 'write `fpsolve design CASE --for "moment(2) = 0" --by noise.sigma --from 0.01 --to 2`',
    ("uncertain", "sample"): _SETS,
    ("uncertain", "seed"): _SETS,
    ("budget", "memory"): "write unknowns = 80000, which bounds the memory",
    ("chart", "zero"): 'write lines = ["lyapunov_exponent = 0", "moment(2) = 0", "stability_index = -1"]',
    ("vary", "reduced"): "each set is solved by itself: list fewer where that takes long",
}
"""What to write instead of each of them."""


def take_removed(data: dict[str, object]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Take these keys out of a case; what each is told."""
    for path, instead in REMOVED.items():
        *above, key = path
        table = data.get(above[0]) if above else data
        if isinstance(table, dict) and key in table:
            del table[key]
            yield path, f"is gone; {instead}, and remove it here"
