"""All that commands print and write of all cases, to compare after a change of the shell.

`python -m tests.golden make FOLDER` runs them; `python -m tests.golden compare OLD NEW` prints what differs: texts by
lines without times, tables and JSON to the last digit, netCDF and VTK files by their arrays, pictures by their size.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import re
import sys
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from difflib import unified_diff
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
TIMES = re.compile(
    r"\b\d+(\.\d+)? ?(ms|s|min|h)\b|\d\d\d\d-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?\S*|\d+ % of the time"
    r'|"(wall_)?seconds": [\d.e-]+|(?<=converged,)[\d.e-]+$',
    re.MULTILINE,
)
DRAWN = re.compile(r"(base64,)[^\"')]*|<svg.*?</svg>", re.DOTALL)
"""Pictures in a page, whose identifiers are new each time."""
OF_A_RUN = "command", "started", "wall_seconds"
SIMULATION = ["--paths", "400", "--seed", "1"]


def commands() -> Iterator[tuple[str, list[str]]]:
    """By name."""
    for path in sorted((ROOT / "cases").glob("**/*.toml")):
        case = str(path.relative_to(ROOT))
        yield f"run {path.stem}", ["run", case, "--report", "--jobs", "1"]
        yield f"check {path.stem}", ["check", case, "--jobs", "1"]
        yield f"simulate {path.stem}", ["simulate", case, *SIMULATION, "--jobs", "1"]
    yield "chart", ["chart", "cases/chart.toml", "--jobs", "1"]
    for name in ("theorem", "fig1"):
        yield f"prove {name}", ["prove", f"cases/{name}.toml"]
    yield "all theorem", ["run", "cases/theorem.toml", "--all", "--jobs", "1"]
    yield "all response", ["run", "cases/response.toml", "--all", "--jobs", "1"]
    yield "sample", ["run", "cases/theorem.toml", "--sample", "3", "--jobs", "1"]
    yield "json", ["run", "cases/fig1.toml", "--json", "--jobs", "1"]
    wanted = ["--for", "stability_index = 1", "--by", "oscillator.c1", "--from", "-1", "--to", "1"]
    yield "design", ["design", "cases/theorem.toml", *wanted]
    measured = ["--per", "Hz", "--sided", "one", "--frequency", "0.1", "--damping-ratio", "0.02", "--averages", "64"]
    yield "noise", ["noise", "cases/measured/buoy.csv", *measured]
    for each in ([], ["run"], ["noise"]):
        yield f"help {' '.join(each)}".strip(), [*each, "--help"]


def make(task: tuple[str, list[str], Path]) -> str:
    """Run one command in the root of the project, with a folder of its own for what it writes."""
    from fpsolve.cli import main

    name, words, folder = task
    place = folder / name
    place.mkdir(parents=True)
    has_folder = words[0] in ("run", "simulate", "chart", "prove", "design", "noise") and "--help" not in words
    with (
        chdir(ROOT),
        (place / "output.txt").open("w", encoding="utf-8") as out,
        redirect_stdout(out),
        redirect_stderr(out),
    ):
        code = main([*words, "--out", str(place / "results")] if has_folder else words)
        print(f"exit code {code}")
    return name


def arrays_of(path: Path) -> dict[str, Any]:
    """The numbers of a netCDF or VTK file."""
    if path.suffix == ".nc":
        import xarray

        with xarray.open_dataset(path) as content:
            about = {key: each for key, each in content.attrs.items() if key not in OF_A_RUN}
            return {"attributes": about} | {str(name): content[name].values for name in content.variables}
    import meshio

    mesh = meshio.vtu.read(path)
    cells = {f"cells {k}": block.data for k, block in enumerate(mesh.cells)}
    return {"points": mesh.points} | mesh.point_data | {**mesh.cell_data} | cells


def lines_of(path: Path, folder: Path) -> list[str]:
    """A text without times and its folder."""
    text = path.read_text(encoding="utf-8").replace(str(folder), "FOLDER")
    text = DRAWN.sub(r"\1", text)
    if path.suffix == ".json":
        text = json.dumps(json.loads(text), indent=1, ensure_ascii=False)
    return TIMES.sub("TIME", re.sub(r"\s*\n\s*", "\n", text)).splitlines()


def differences(old: Path, new: Path, folders: tuple[Path, Path]) -> Iterator[str]:
    """How a file differs, in words."""
    if old.suffix in (".nc", ".vtu"):
        before, after = arrays_of(old), arrays_of(new)
        yield from (f"{name} is in one of them" for name in sorted(before.keys() ^ after.keys()))
        for name in sorted((before.keys() & after.keys()) - {"seconds"}):
            if not _are_equal(before[name], after[name]):
                yield f"{name} differs"
    elif old.suffix == ".png":
        import matplotlib.image

        before, after = (matplotlib.image.imread(path).shape for path in (old, new))
        if before != after:
            yield f"{before} and {after} pixels"
    elif old.suffix in (".pdf", ".lock"):
        return
    else:
        lines = (lines_of(path, folder) for path, folder in zip((old, new), folders, strict=True))
        yield from [line for line in unified_diff(*lines, n=0, lineterm="") if line[:3] not in ("---", "+++")][:20]


def _are_equal(old: Any, new: Any) -> bool:
    if isinstance(old, dict):
        return str(old) == str(new)
    old, new = np.asarray(old), np.asarray(new)
    return old.shape == new.shape and np.array_equal(old, new, equal_nan=old.dtype.kind in "fc")


def compare(old: Path, new: Path) -> int:
    """Print what differs; 1 where anything does."""
    names = [
        {str(path.relative_to(each)) for path in each.rglob("*") if path.is_file() and "records" not in path.parts}
        for each in (old, new)
    ]
    for name in sorted(names[0] ^ names[1]):
        print(f"{name}: only {'before' if name in names[0] else 'now'}")
    count = 0
    for name in sorted(names[0] & names[1]):
        if said := list(differences(old / name, new / name, (old, new))):
            count += 1
            print(f"{name}:", *said, sep="\n    ")
    print(f"{len(names[0] & names[1])} files in both, {count} differ")
    return int(count > 0 or names[0] != names[1])


def main(word: str, first: str, second: str = "") -> int:
    if word == "compare":
        return compare(Path(first).resolve(), Path(second).resolve())
    os.environ["COLUMNS"] = "100"
    folder = Path(first).resolve()
    tasks = [(name, words, folder) for name, words in commands() if name.startswith(second)]
    with multiprocessing.get_context("spawn").Pool(2, maxtasksperchild=8) as pool:
        for name in pool.imap_unordered(make, tasks):
            print(name, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
