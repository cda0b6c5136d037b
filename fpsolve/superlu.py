"""LU factors of sparse matrices by SuperLU."""

from __future__ import annotations

from typing import Any

from scipy.sparse.linalg import splu

from fpsolve.errors import SingularMatrix


def sparse_lu(matrix: Any, *, permc_spec: str = "MMD_AT_PLUS_A", **options: Any) -> Any:
    """SuperLU's factors, ordered for a symmetric pattern if nothing else is named. Raises `SingularMatrix`."""
    try:
        return splu(matrix, permc_spec=permc_spec, **options)
    except RuntimeError as failure:
        raise SingularMatrix(*failure.args) from failure
