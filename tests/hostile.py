"""NetCDF files and records with random faults, and what fpsolve makes of them.

`python -m tests.hostile [netcdf|records ...] [--seed S] [--count N]` prints how each ended. Nothing may end in a
traceback or without an end, and nothing that was found may be lost; `tests/test_folders.py` has folders with faults.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import io
import json
import random
import shutil
import signal
import tempfile
import time
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

import fpsolve
from fpsolve.cli import main as command
from fpsolve.errors import FpsolveError
from tests.kit import case_text

COUNTS = {"netcdf": 300, "records": 500}
PATIENCE = 120
"""Seconds after which a command hangs."""
TEXT = case_text(
    '[moments]\np = [2.0, 0.0, -1.0]\n[monte_carlo]\npaths = 64\ntime = 40.0\n[vary]\n"noise.D0" = [0.1, 0.5]\n'
)
PLAIN = "[output]\nfigure = false\neigenfunctions = [2.0]\n"
LEAN = '[output]\nquantities = ["moment", "lyapunov_exponent"]\nfigure = false\n'
DATA = [
    *(None, True, False, 0, 1, -1, 7.0, 1e308, -1e-320, 10**400, 2**63, "", "x", "nan", "inf", "\ud800", "\x1b[31m"),
    *([], {}, [[]], [0.0], ["x"], {"": 0}, {"code": "TEXT"}),
    *({"shape": [2**40], "data": ""}, {"shape": [-1], "data": ""}),
    *("2.0", [1, 2, 3, 4], {"number": "x"}, {"remedy": "NONE"}, "[" * 10000),
]
"""What may stand where something else should."""


class Wrong(Exception):
    """What fpsolve must not do."""


@contextlib.contextmanager
def in_time() -> Iterator[None]:
    """Raise `Wrong` where the body does not end."""

    def stop(*_: Any) -> None:
        raise Wrong("it hangs")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def called(*words: str) -> tuple[int, str]:
    """The exit code of a command, and what it says. Raises `Wrong` where that is no sentence."""
    said = io.StringIO()
    with in_time(), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            code = command(list(words))
        except Exception:
            raise Wrong(traceback.format_exc()) from None
    text = said.getvalue()
    if code not in (0, 2, 3) or "Traceback" in text or "a fault of fpsolve" in text:
        raise Wrong(f"exit code {code}: {text}")
    return int(code), text


def changed_data(data: Any, rng: random.Random) -> Any:
    """JSON data with a fault at a random place."""
    data = copy.deepcopy(data)
    places: list[tuple[Any, Any]] = []

    def look(node: Any) -> None:
        for key in list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ():
            places.append((node, key))
            look(node[key])

    look(data)
    if not places or rng.random() < 0.02:
        return rng.choice(DATA)
    node, key = rng.choice(places)
    match rng.randrange(4):
        case 0:
            del node[key]
        case 1:
            other, there = rng.choice(places)
            node[key] = copy.deepcopy(other[there]) if there in other or isinstance(other, list) else None
        case _:
            node[key] = copy.deepcopy(rng.choice(DATA))
    return data


def changed_bytes(content: bytes, rng: random.Random) -> bytes:
    """Bytes with some others among them, cut, or twice."""
    if not content or rng.random() < 0.2:
        return content[: rng.randint(0, len(content))]
    data = bytearray(content)
    for _ in range(rng.choice([1, 1, 3, 20])):
        data[rng.randrange(len(data))] = rng.randrange(256)
    at = rng.randrange(len(data))
    return bytes(data[:at] + data[at + rng.choice([0, 0, 0, 1, 8, 100]) :])


def results_in(place: Path) -> Path:
    """A folder that a run and a simulation have written, beside its case file."""
    (place / "case.toml").write_text(TEXT + PLAIN, encoding="utf-8")
    called("run", str(place / "case.toml"), "--out", str(place / "out"), "--quiet", "--jobs", "1")
    called("simulate", str(place / "case.toml"), "--out", str(place / "out"), "--quiet", "--jobs", "1")
    folder = place / "out/case"
    for kind in ("solved", "simulated"):  # of a process that has ended
        [path] = (folder / "records" / kind).glob("*.jsonl")
        path.rename(path.with_name("earlier.jsonl"))
    return folder


# ── records ──────────────────────────────────────────────────────────────────────────────────────────────────────────


def records(rng: random.Random, count: int) -> Iterator[tuple[str, Callable[[], str]]]:
    """Runs and simulations that find records with right checksums and wrong content."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        good = results_in(place)
        shutil.move(good, place / "good")
        good, bad = place / "good", place / "out/case"
        (place / "case.toml").write_text(TEXT + PLAIN, encoding="utf-8")
        words = [str(place / "case.toml"), "--out", str(place / "out"), "--jobs", "1"]

        def run() -> str:
            kind = rng.choice(["solved", "solved", "simulated"])
            shutil.rmtree(place / "out", ignore_errors=True)
            shutil.copytree(good, bad)
            [path] = (bad / "records" / kind).glob("*.jsonl")
            lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
            told, written = [], b""
            for line in lines:
                record = line["record"]
                for _ in range(rng.choice([1, 1, 2])):
                    record = changed_data(record, rng)
                told.append(record)
                content = json.dumps(record).encode()
                head = f'{{"key": "{line["key"]}", "crc32": {zlib.crc32(content)}, "record": '
                written += head.encode() + content + b"}\n"
            path.write_bytes(written)
            verb = "run" if kind == "solved" else "simulate"
            try:
                code, said = called(verb, *words)
                if code == 2:
                    raise Wrong(f"refused: {said}")
                if verb == "run" and not (bad / "moments.csv").is_file():
                    raise Wrong("moments.csv is lost")
            except Wrong as wrong:
                raise Wrong(f"{verb} with {told!r:.2000}: {wrong}") from None
            solved = "all known" if "2 of 2 known" in said else "1 known" if "1 of 2 known" in said else "none known"
            return f"{verb}: {code}, {solved}"

        for number in range(count):
            yield f"record {number}", run


# ── netCDF ───────────────────────────────────────────────────────────────────────────────────────────────────────────

ATTRIBUTES = [
    np.arange(3), "abc", np.float64("nan"), np.array(["a", "b"], dtype="S1"), 1e308, b"\xff\xfe", np.int64(-1), "",
]  # fmt: skip
"""Values of attributes, right or wrong."""
NAMES = [
    "scale_factor", "add_offset", "_FillValue", "missing_value", "units", "calendar", "coordinates", "_Unsigned",
    "dtype",
]  # fmt: skip
"""Attributes that a reader of netCDF heeds."""
SPOILT = [
    "bytes", "bytes", "cut", "head", "variable", "gone", "size", "attribute", "own attribute", "twice", "p",
    "type", "link",
]  # fmt: skip
"""Faults of a file; bytes are changed twice as often."""


def spoil_netcdf(path: Path, rng: random.Random) -> str:
    """Change a file that a run wrote, and say how."""
    kind = rng.choice(SPOILT)
    if kind in ("bytes", "cut", "head"):
        content = path.read_bytes()
        if kind == "head":
            content = changed_bytes(content[:3000], rng) + content[3000:]
        path.write_bytes(content[: rng.randrange(len(content))] if kind == "cut" else changed_bytes(content, rng))
        return kind
    with h5py.File(path, "r+") as file:
        name = rng.choice(list(file))
        try:
            match kind:
                case "variable":
                    file["extra"] = np.zeros(rng.choice([(), (3,), (2, 3), (7, 1, 1), (0,)]))
                case "gone":
                    del file[name]
                case "size":
                    del file[name]
                    file.create_dataset(
                        name, (rng.choice([0, 1, 4, 3 * 10**9, 2**62]),), rng.choice(["f8", "i1", "f4"]), chunks=(1,)
                    )
                case "attribute":
                    file[name].attrs[rng.choice(NAMES)] = rng.choice(ATTRIBUTES)
                case "own attribute":
                    file.attrs[rng.choice(list(file.attrs))] = rng.choice(ATTRIBUTES)
                case "twice":
                    file[name][...] = file[name][()].flat[0]
                case "p" if "p" in file:
                    file["p"][0] = rng.choice([np.nan, np.inf, 0.0, -1.0])
                case "type":
                    shape = file[name].shape
                    del file[name]
                    file[name] = rng.choice(
                        [np.zeros(shape, "c16"), np.full(shape, b"x", "S3"), np.zeros(shape, [("a", "f4")])]
                    )
                case "link":
                    del file[name]
                    link = rng.choice(
                        [h5py.SoftLink("/nothing"), h5py.ExternalLink("/dev/zero", "/x"), h5py.SoftLink(f"/{name}")]
                    )
                    file[name] = link
        except (KeyError, ValueError, TypeError, OSError, RuntimeError):  # as h5py refuses
            return f"{kind} (in part)"
    return kind


def netcdf(rng: random.Random, count: int) -> Iterator[tuple[str, Callable[[], str]]]:
    """Files of results with random faults, opened beside sound ones."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        runs = {
            "sets": TEXT,
            "one": TEXT.replace('"noise.D0" = [0.1, 0.5]', ""),
            "zip": TEXT.replace("[vary]", '[vary]\nmode = "zip"\n"oscillator.c1" = [0.1, 0.2]'),
        }
        for stem, text in runs.items():
            (place / f"{stem}.toml").write_text(text + LEAN, encoding="utf-8")
            called("run", str(place / f"{stem}.toml"), "--out", str(place / "out"), "--quiet", "--jobs", "1")
        whole = fpsolve.open_results(place / "out/one")

        def run() -> str:
            bad = place / "bad/results.nc"
            bad.parent.mkdir(exist_ok=True)
            shutil.copy(place / "out" / rng.choice(list(runs)) / "results.nc", bad)
            kind = spoil_netcdf(bad, rng)
            state = "read"
            try:
                with in_time():
                    try:
                        fpsolve.open_results(place / "out/one", bad).to_dataframe()
                    except FpsolveError as refusal:
                        state = "refused"
                        if str(bad) not in str(refusal) or "\n" in str(refusal):
                            raise Wrong(f"no sentence: {refusal}") from None
                    with warnings.catch_warnings(record=True) as caught:
                        warnings.simplefilter("always")
                        left = fpsolve.open_results(bad, place / "out/one", errors="warn")
                if (state == "refused") != any(str(bad) in str(each.message) for each in caught):
                    raise Wrong(f"{state}, but {[str(each.message) for each in caught]}")
                for each in caught:
                    if str(bad) not in str(each.message):
                        raise Wrong(f"warns {each.message}")
                own = left.where(left.run == "one", drop=True)
                if not np.array_equal(own.moment.values, whole.moment.values):
                    raise Wrong("other numbers of the sound file")
            except Exception as wrong:
                text = str(wrong) if isinstance(wrong, Wrong) else traceback.format_exc()
                raise Wrong(f"{kind}: {text}") from None
            return f"{kind}: {state}"

        for number in range(count):
            yield f"file {number}", run


KINDS = {"netcdf": netcdf, "records": records}


def tried(
    kind: str, seed: int, count: int, say: Callable[[str], None] = lambda _: None
) -> tuple[Counter[str], list[str]]:
    """How many of a kind ended how, and what went wrong."""
    ended, wrong = Counter[str](), list[str]()
    for label, attempt in KINDS[kind](random.Random(seed), count):
        try:
            ended[attempt()] += 1
        except Wrong as failure:
            wrong.append(f"{label}, seed {seed}: {failure}")
            say(wrong[-1])
    return ended, wrong


def main() -> int:
    """Print how all ended."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default="all", choices=[*KINDS, "all"])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int)
    asked = parser.parse_args()
    failed = 0
    for kind in KINDS if "all" in asked.kinds else asked.kinds:
        start = time.monotonic()
        ended, wrong = tried(kind, asked.seed, asked.count or COUNTS[kind], print)
        failed += len(wrong)
        print(f"{kind}: {sum(ended.values())} as they must, {len(wrong)} wrong, {time.monotonic() - start:.0f} s")
        for how, number in sorted(ended.items()):
            print(f"  {number:5} {how}")
    return int(bool(failed))


if __name__ == "__main__":
    raise SystemExit(main())
