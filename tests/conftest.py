"""What the tests share: the parameter sets of Fig. 1 and of the strong-noise problems."""

from __future__ import annotations

import functools
import gc
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

if "PYTEST_XDIST_WORKER" in os.environ:  # one worker for each processor: more threads would only wait for each other
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

from fpsolve.model.noises.non_gaussian import NonGaussianNoise
from fpsolve.model.noises.ornstein_uhlenbeck import OrnsteinUhlenbeck
from fpsolve.model.systems.vibro_impact import VibroImpactOscillator

FIG1 = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
FIG1_NOISE = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95)
UNIT_NOISE = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)


@functools.cache
def painting():
    """What lays figures out and paints them: the owner, the name, and the function as it is."""
    from matplotlib.figure import Figure  # here, as processes of tests import this file, too
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    methods = (Figure, "savefig"), (Figure, "draw_without_rendering"), (ConstrainedLayoutEngine, "execute")
    return [(owner, name, getattr(owner, name)) for owner, name in methods]


@pytest.fixture(scope="session", autouse=True)
def outlines():
    """Figures are made, but neither laid out nor painted, which takes most of the time of a run; files stay empty."""
    from matplotlib.mathtext import MathTextParser

    (_, _, save), *_ = methods = painting()

    def touch(figure, target, **options):
        return target.touch() if isinstance(target, Path) else save(figure, target, **options)

    parse: Any = MathTextParser._parse_cached  # which forgets all but 50 formulas
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MathTextParser, "_parse_cached", functools.lru_cache(maxsize=None)(parse.__wrapped__))
        for (owner, name, _), instead in zip(methods, [touch, *[lambda *_: None] * 2], strict=True):
            patch.setattr(owner, name, instead)
        yield


@contextmanager
def painted():
    """Figures as everywhere else, with their files."""
    with pytest.MonkeyPatch.context() as patch:
        for owner, name, real in painting():
            patch.setattr(owner, name, real)
        yield


@pytest.fixture
def pictures():
    """For tests that look at what is painted, or at where it is."""
    with painted():
        yield


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)


def keeping(first, second, sizes=(0.7, -0.6)):
    """The matrix of a noise that moves the phase over neither of two rays: they are those of its eigenvectors."""
    rays = np.array([[np.cos(first), np.cos(second)], [-np.sin(first), -np.sin(second)]])
    return rays @ np.diag(sizes) @ np.linalg.inv(rays)


gc.disable()  # what is collected stays, so that looking through it again finds nothing


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(20_000)  # objects more than before, not 700: looking for cycles takes a third of the time
    gc.enable()


def sampled(*cases: object, keep: int = 1) -> list[object]:
    """Values of a parameter, or tuples of several: the first are a sample that runs always, the others are slow."""
    rest = [case if isinstance(case, tuple) else (case,) for case in cases[keep:]]
    return [*cases[:keep], *(pytest.param(*case, marks=pytest.mark.slow) for case in rest)]


def heed_signals() -> None:
    """For a process that is being started: nohup and a shell's & leave signals ignored, which it would inherit."""
    for name in ("SIGHUP", "SIGINT", "SIGTERM"):
        signal.signal(getattr(signal, name), signal.SIG_DFL)


def started(code: str, *words: str, before: Callable[[], object] = heed_signals, **more: Any) -> subprocess.Popen[str]:
    """A process of its own that runs code with these words; it heeds signals, whatever the parent does."""
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **more}
    return subprocess.Popen([sys.executable, "-c", code, *words], **pipes, text=True, preexec_fn=before)
