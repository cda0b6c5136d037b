"""How functions are compiled and where what is compiled is kept."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from numba import config, njit

from fpsolve.errors import FpsolveError
from fpsolve.model import noises

if config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise FpsolveError("paths are not simulated where NUMBA_DISABLE_JIT is set; unset it, as they need compiled code")

_FILES = [path for room in (noises.__file__, __file__) for path in sorted(Path(room).parent.glob("*.py"))]
_SOURCES = hashlib.sha256(b"".join(path.read_bytes() for path in _FILES)).hexdigest()[:16]
_without_cache: Any = njit(nogil=True, error_model="numpy")
_with_cache: Any = njit(nogil=True, error_model="numpy", cache=True)
inlined: Any = njit(nogil=True, error_model="numpy", inline="always")


def compiled(function: Any) -> Any:
    """A compiled function, kept in numba's cache unless no folder for that can be written to.

    The cache sees when the file of the function changes, but not when others do that it calls, which therefore are part
    of the name.
    """
    function.__qualname__ += f"_{_SOURCES}"
    try:
        return _with_cache(function)
    except RuntimeError:
        return _without_cache(function)
