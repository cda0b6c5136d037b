"""LU factors of sparse matrices by SuperLU, made where a signal can leave them."""

from __future__ import annotations

from functools import partial
from typing import Any

from scipy.sparse.linalg import splu

from fpsolve.errors import SingularMatrix
from fpsolve.signals import end_away, is_away, left_at_signals

MANY_ENTRIES = 1e6
"""Of a matrix, from which on its factors are made where a signal can leave them."""


class SparseLU:
    """SuperLU's factors; they end in the thread that made them, as scipy frees their memory in no other."""

    def __init__(self, matrix: Any, **options: Any) -> None:
        self._lu, self._is_away = splu(matrix, **options), is_away()
        self.solve = self._lu.solve

    def __del__(self) -> None:
        if getattr(self, "_is_away", False):
            del self.solve
            end_away(self.__dict__.pop("_lu"))


def sparse_lu(
    matrix: Any, *, permc_spec: str = "MMD_AT_PLUS_A", many: float = MANY_ENTRIES, **options: Any
) -> SparseLU:
    """SuperLU's factors, ordered for a symmetric pattern if nothing else is named. Raises `SingularMatrix`."""
    factorise = partial(SparseLU, matrix, permc_spec=permc_spec, **options)
    try:
        return left_at_signals(factorise) if matrix.nnz > many else factorise()
    except RuntimeError as failure:
        raise SingularMatrix(*failure.args) from failure
