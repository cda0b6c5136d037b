"""Does a release install and run? `python -m tests.release [3.11 3.12 3.13]`; needs uv: `pip install '.[release]'`.

A wheel and a source distribution are built and must hold the same files. Then each Python gets two empty environments:
the wheel with the newest dependencies and nothing that is optional, and the source distribution with all that is
optional and the oldest dependencies that fpsolve allows and that have wheels for that Python. In each fpsolve starts,
solves, draws and reports a case, and meets a closed form. A Python that is not on the machine is passed over, unless
it was named.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from time import monotonic

ROOT = Path(__file__).parents[1]
PYTHONS = "3.11", "3.12", "3.13"
UV = [sys.executable, "-m", "uv"]
NEWEST, OLDEST = "highest", "lowest-direct"
CLOSED_FORM = """
from fpsolve import PlaneSystem, Problem, lyapunov_exponent, moment_lyapunov
from fpsolve.model import White

free = Problem(PlaneSystem.of_equations(("x", "v"), ("v", "-xi*x")), White(s=1.0))  # d(x², xv, v²) has det = λ³ − 2
found = moment_lyapunov(free, 2.0).value[0]
assert abs(found - 2 ** (1 / 3)) < 1e-9, found
assert abs(lyapunov_exponent(free).value - 0.289308259834239) < 1e-8  # Airy functions, Halperin 1965
"""
EXTRAS = [f"--extra={name}" for name in ("cluster", "proof")]
COMMANDS = [
    ["--version"],
    ["schema"],
    ["new", "fig1"],
    ["new", "minimal"],
    ["check", "minimal.toml"],
    ["run", "fig1.toml", "--report"],
    ["simulate", "minimal.toml", "--paths", "256", "--out", "simulated"],
]
OPTIONAL = [
    ["prove", "minimal.toml", "--width", "1e-4"],
]
WRITTEN = ["summary.json", "sets.csv", "results.nc", "figure.pdf", "sets.pvd", "report.html"]


class Failed(Exception):
    """A command failed; its text is what that printed."""


def ran(command: Sequence[str | Path], folder: Path, **environment: str) -> str:
    """What a command prints, without variables that could show it this repository."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}
    texts = [str(each) for each in command]
    found = subprocess.run(
        texts, cwd=folder, env=kept | environment, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
    )
    if found.returncode:
        raise Failed(f"{' '.join(texts)}: exit code {found.returncode}\n{found.stdout[-2000:]}{found.stderr[-4000:]}")
    return found.stdout


def interpreters(versions: Sequence[str]) -> dict[str, Path]:
    """The Pythons that are there, also those that pyenv keeps."""
    places = os.environ["PATH"].split(os.pathsep)
    kept = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found = {}
    for version in versions:
        names = [Path(place) / f"python{version}" for place in places] + sorted(kept.glob(f"{version}.*/bin/python"))
        for each in names:
            if each.is_file() and not subprocess.run([each, "-c", ""], capture_output=True, check=False).returncode:
                found[version] = each
                break
    return found


def built(folder: Path) -> tuple[Path, Path]:
    """A wheel and a source distribution, after a look at what they hold."""
    ran([*UV, "build", "--quiet", "--sdist", "--wheel", "--out-dir", folder, ROOT], folder)
    [wheel], [source] = folder.glob("*.whl"), folder.glob("*.tar.gz")
    (folder / "again").mkdir()
    ran([*UV, "build", "--quiet", "--wheel", "--out-dir", folder / "again", source], folder)
    [again] = (folder / "again").glob("*.whl")
    with zipfile.ZipFile(wheel) as first, zipfile.ZipFile(again) as second, tarfile.open(source) as archive:
        contents = [{each: file.read(each) for each in file.namelist()} for file in (first, second)]
        if contents[0] != contents[1]:
            differing = {key for key, _ in contents[0].items() ^ contents[1].items()}
            raise Failed(f"the wheel of the source distribution is another one: {sorted(differing)}")
        inside = {name.partition("/")[2] for name in archive.getnames()}
    for each in ("README.md", "CHANGELOG.md", "LICENSE", "docs/conf.py", "tests/release.py"):
        if each not in inside:
            raise Failed(f"{source.name} has no {each}")
    return wheel, source


def tried(python: Path, package: Path, resolution: str, folder: Path) -> str:
    """Install a package into an empty environment, use it, and tell which dependencies it took."""
    here = folder / "bin/python"
    install = [*UV, "pip", "install", "--quiet", "--python", here]
    ran([*UV, "venv", "--quiet", "--python", python, folder], ROOT)
    if resolution == OLDEST:
        chosen = ["--resolution", OLDEST, "--only-binary", ":all:", *EXTRAS, "--python", here]
        ran([*UV, "pip", "compile", "--quiet", *chosen, ROOT / "pyproject.toml", "-o", folder / "oldest.txt"], folder)
        ran([*install, "-r", folder / "oldest.txt"], folder)
        ran([*install, "--no-deps", package], folder)
    else:
        ran([*install, package], folder)
    work = folder / "work"
    work.mkdir()
    commands = [*COMMANDS, *OPTIONAL] if resolution == OLDEST else COMMANDS
    for each in commands:
        ran([folder / "bin/fpsolve", *each], work, MPLBACKEND="agg")
    missing = [name for name in WRITTEN if not (work / "results/fig1" / name).is_file()]
    if missing:
        raise Failed(f"run has not written {', '.join(missing)}")
    ran([here, "-W", "error", "-c", CLOSED_FORM], work)
    listed = ran([*UV, "pip", "freeze", "--python", here], folder).split()
    shown = ("numpy", "scipy", "numba", "pydantic", "pyvista", "matplotlib", "xarray", "h5py")
    return " ".join(each for each in listed if each.partition("==")[0] in shown)


def main(versions: Sequence[str]) -> int:
    """Print a line for each environment; 1 where one fails."""
    there = interpreters(versions or PYTHONS)
    failures = 0
    with tempfile.TemporaryDirectory(prefix="fpsolve-release-") as place:
        try:
            wheel, source = built(Path(place))
        except Failed as failure:
            print(f"not built: {failure}")
            return 1
        print(
            f"built: {wheel.name} ({wheel.stat().st_size >> 10} kB), {source.name} ({source.stat().st_size >> 10} kB)"
        )
        for version in versions or PYTHONS:
            if version not in there:
                print(f"{version}: not on this machine")
                failures += bool(versions)
                continue
            for words, package, resolution in (("wheel, newest", wheel, NEWEST), ("source, oldest", source, OLDEST)):
                start = monotonic()
                try:
                    told = tried(there[version], package, resolution, Path(place) / f"{version}-{resolution}")
                except Failed as failure:
                    failures += 1
                    told = f"FAILED: {failure}"
                print(f"{version}, {words}: {told} ({monotonic() - start:.0f} s)", flush=True)
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
