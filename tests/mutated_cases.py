"""Case files with random faults, run by the command: refused, not converged, or solved, and nothing else.

`python -m tests.mutated_cases --count 3000 --seed 1` prints what else happens; it takes some minutes.
"""

from __future__ import annotations

import argparse
import io
import random
import re
import signal
import sys
import tempfile
import time
from collections import Counter
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path

from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT, NOT_CONVERGED
from tests.case.test_mutations import mutated
from tests.odd_calls import Hang, hang

LIMIT = 120
"""Seconds after which a run hangs."""
RUNNING = 0.1
"""The share of the cases that have another number only."""
NUMBERS = ["0.05", "0.3", "0.7", "1.0", "1.2", "3.0", "-0.5", "20.0", "1e3", "1e-3", "1e-8", "1e8", "1e15", "0", "-1.0"]
LIGHT = """title = "light"
[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1
impact = "delta"
[noise]
D0 = 0.1
tau0 = 0.5
r0 = 0.95
treatment = "ou-reduction"
[moments]
p = [2.0]
rtol = 1e-3
[vary]
"noise.D0" = [0.1, 0.5]
[figure]
x = "p"
y = "moment"
[output]
quantities = ["moment", "lyapunov_exponent"]
eigenfunctions = []
figure = false
[budget]
unknowns = 3000
seconds = 1.0
"""


def with_another_number(text: str, rng: random.Random) -> str:
    """The text with one of its numbers exchanged, so that most cases run."""
    at = rng.choice([*re.finditer(r"(?<![\w.-])[\d.]+(?:e-?\d+)?(?!\w)", text)])
    return text[: at.start()] + rng.choice(NUMBERS) + text[at.end() :]


def outcome(text: str) -> tuple[int, str]:
    """The exit code of a run in the working folder, and what is wrong with it, or nothing."""
    Path("case.toml").write_text(text, encoding="utf-8")
    out, err = io.StringIO(), io.StringIO()
    before = signal.signal(signal.SIGALRM, hang)
    signal.alarm(LIMIT)
    try:
        with redirect_stdout(out), redirect_stderr(err):
            code = main(["run", "case.toml", "--out", "out", "--jobs", "1", "--fresh"])
    except Hang:
        return -1, "hangs"
    except Exception as error:
        return -1, f"{type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    said = out.getvalue() + err.getvalue()
    names = {path.name for path in Path().iterdir()}
    if code not in (0, BAD_INPUT, NOT_CONVERGED):
        return code, f"exit code {code}: {said}"
    if code and not err.getvalue().strip():
        return code, "says nothing"
    if "Traceback" in said or "a fault of fpsolve" in said or not said.replace("\n", "").isprintable():
        return code, said
    if not names <= {"case.toml", "out"} or (code == BAD_INPUT and "out" in names):
        return code, f"writes {names}"
    return code, ""


def faults(seed: int, count: int) -> tuple[Counter[int], list[str]]:
    """How often each exit code came, and what went wrong, in so many runs."""
    rng, codes, found = random.Random(seed), Counter[int](), []
    for _ in range(count):
        text = with_another_number(LIGHT, rng) if rng.random() < RUNNING else mutated(LIGHT, rng)
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            code, said = outcome(text)
        codes[code] += 1
        if said:
            found.append(f"{said[:600]}\n---- of:\n{text}")
    return codes, found


def command() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=3000)
    options = parser.parse_args()
    started = time.monotonic()
    codes, found = faults(options.seed, options.count)
    print("\n====\n".join(found))
    print(f"{options.count} cases, exit codes {dict(codes)}, {len(found)} faults in {time.monotonic() - started:.0f} s")
    return bool(found)


if __name__ == "__main__":
    sys.exit(command())
