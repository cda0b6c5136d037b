"""Where the compiled loops come from: compiled anew where nothing can be kept."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import fpsolve

DRAW = """
import numpy as np
from fpsolve.model.noises.ornstein_uhlenbeck import OrnsteinUhlenbeck
from fpsolve.simulation import motions
start, mean, end, push = np.full(4, 3.0), np.empty(4), np.empty(4), np.zeros(4)
step = OrnsteinUhlenbeck(alpha=1.0, sigma=1e-12).step(1.0)
motions.draw(step, start, mean, end, push, np.random.default_rng(0))
print(motions.__file__, end[0])
"""


@pytest.mark.slow
def test_without_a_place_for_a_cache_the_loops_are_compiled_all_the_same(tmp_path):
    """A package, a home and a cache that nobody can write to, as in a container; the noise falls from 3 to 3/e."""
    package, nowhere = tmp_path / "fpsolve", tmp_path / "file"
    shutil.copytree(Path(fpsolve.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for file in (nowhere, package / "simulation" / "__pycache__"):
        file.write_text("a file where a folder is sought", encoding="utf-8")
    folders = dict.fromkeys(["HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "LOCALAPPDATA"], str(nowhere / "below"))
    variables = os.environ | folders | {"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, "-c", DRAW], env=variables, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    file, value = done.stdout.split()
    assert Path(file).is_relative_to(package)
    assert abs(float(value) - 3 / 2.718281828459045) < 1e-9
