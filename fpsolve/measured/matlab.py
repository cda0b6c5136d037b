"""Arrays of real numbers from MATLAB files of level 4 and 5, read by `scipy.io` in a process of its own.

Some files that are broken end the process that reads them, or let it take all memory.
"""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

MOST_SECONDS = 60
MOST_BYTES = 2**30
"""Memory that the process may take."""
KINDS = frozenset(("double", "single", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))))
"""Of arrays of numbers, as `scipy.io.whosmat` calls them."""


class MatError(ValueError):
    """What is wrong with a file."""


def read_mat(path: Path, most: int) -> dict[str, object]:
    """The arrays of real numbers at the top level of a file, by their names; others are left out.

    Args:
        path: of the file.
        most: numbers that it has at most in all.

    Raises:
        MatError: the file is none of these levels, or is broken.
    """
    import numpy as np

    with TemporaryDirectory() as folder:
        target = Path(folder) / "arrays.npz"
        command = [sys.executable, "-P", "-m", "fpsolve.measured.matlab", str(path.resolve()), str(target), str(most)]
        try:
            ended = subprocess.run(command, capture_output=True, text=True, timeout=MOST_SECONDS, check=False)
        except subprocess.TimeoutExpired:
            raise MatError("to read it takes too long") from None
        if ended.returncode:
            said = ended.stderr.strip().splitlines()
            raise MatError(said[-1] if said and ended.returncode > 0 else "it is broken")
        with np.load(target, allow_pickle=False) as arrays:
            return dict(arrays)


def _read(source: str, target: str, most: str) -> None:
    """In the process: write the arrays of a file into another one."""
    import numpy as np
    from scipy.io import loadmat, whosmat

    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    about = [(name, math.prod(shape)) for name, shape, kind in whosmat(source) if kind in KINDS]
    names = [name for name, _ in about]
    if (total := sum(count for _, count in about)) > int(most):
        raise ValueError(f"it has {total} numbers, and at most {most} are read")
    arrays = loadmat(source, variable_names=names) if names else {}
    np.savez(target, **{name: arrays[name] for name in names if np.isrealobj(arrays[name])})


if __name__ == "__main__":
    try:
        _read(*sys.argv[1:])
    except Exception as error:  # scipy raises many kinds for what is no such file
        raise SystemExit(f"{type(error).__name__}: {error}") from None
