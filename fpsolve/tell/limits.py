"""How much is shown of one, of several and of many curves, on the terminal and in the report.

Several curves have a row each in one table, up to `ROWS`; of more the extreme ones and some that failed have one. Up
to `EACH` curves are also described one by one, on a terminal where that is asked for: a table, sentences, and of the
first `PICTURES` pictures. Where the figure is over a parameter, curves have a row each from the first one on.
"""

from __future__ import annotations

EACH = 10
"""Curves that are described one by one."""
PICTURES = 3
"""Curves that have pictures of their own in a report."""
ROWS = 50
"""Curves, or values that are expected, that have a row each."""
EXTREMES = 2
"""Quantities whose extreme curves have a row."""
FAILURES = 20
"""Failed curves among many that have a row."""
MOMENTS = 3
"""The p whose Λ has a column beside that of other quantities."""
ROWS_OVER_P = 12
"""Λ(p) of a single curve that a terminal shows unasked."""
PROOFS = 4
"""Proven moments of which each is told."""
NAMED = 3
"""Curves that are named of those that share a note."""
NOTES = 20
"""Notes of each severity."""
