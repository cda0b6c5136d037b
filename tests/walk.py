"""What one Λ(2) of the paper's oscillator runs: files, functions, classes, and how deep calls go.

`python -m tests.walk` solves Λ(2) of cases/fig1.toml twice and counts frames in fpsolve/ of the second solve, by
`sys.setprofile`: distinct files, distinct code objects, distinct types of `self`, and the deepest nesting of frames.
With `--names` it prints each function, by files, in the order of the first call.
"""

import sys
from pathlib import Path
from types import FrameType
from typing import Any

import fpsolve
from fpsolve import load_case, moment_lyapunov

ROOT = Path(fpsolve.__file__).parent
CASE = Path(__file__).parents[1] / "cases/fig1.toml"


class Walk:
    """Frames of fpsolve while it is the profile function.

    Attributes:
        functions: file and name of each code object, in the order of first calls.
        classes: the types of `self`.
        deepest: the most frames of fpsolve that were open at once.
    """

    def __init__(self) -> None:
        self.functions, self.classes, self.deepest, self._depth = dict[Any, tuple[str, str]](), set[type](), 0, 0

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        path = Path(frame.f_code.co_filename)
        if event not in ("call", "return") or not path.is_relative_to(ROOT):
            return
        self._depth += 1 if event == "call" else -1
        self.deepest = max(self.deepest, self._depth)
        if event == "call":
            self.functions.setdefault(frame.f_code, (str(path.relative_to(ROOT)), frame.f_code.co_qualname))
            if "self" in frame.f_locals:
                self.classes.add(type(frame.f_locals["self"]))

    def __str__(self) -> str:
        files = {file for file, _ in self.functions.values()}
        return (
            f"{len(files)} files, {len(self.functions)} functions, {len(self.classes)} classes, {self.deepest} frames"
        )


def main(*words: str) -> int:
    """Print the counts."""
    problem = load_case(CASE).problem
    moment_lyapunov(problem, 2.0)
    walk = Walk()
    sys.setprofile(walk)
    try:
        moment_lyapunov(problem, 2.0)
    finally:
        sys.setprofile(None)
    for file, name in walk.functions.values() if "--names" in words else ():
        print(f"{file}: {name}")
    print(walk)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
