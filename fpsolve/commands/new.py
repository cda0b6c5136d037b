"""`fpsolve new`: cases to start from, those that come with fpsolve and made ones."""

from __future__ import annotations

import math
import re
import shlex
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fpsolve.case.matrices import KEYS
from fpsolve.case.new import Modes, case_text
from fpsolve.case.schema import SCHEMA, schema_text
from fpsolve.commands.options import ModeRows, ModesFile
from fpsolve.errors import FpsolveError
from fpsolve.explain import nearest, shown
from fpsolve.files import write_text
from fpsolve.messages import escaped

_NAMED = re.compile(r"\A#:schema .*\n")
"""The line by which a case names its schema."""


@cache
def shipped_cases() -> Mapping[str, Path]:
    """The cases by their names, those of the paper's oscillator first."""
    package = Path(str(files("fpsolve")))
    folder = next(place for place in (package / "cases", package.parent / "cases") if place.is_dir())
    return {path.stem: path for path in (*sorted(folder.glob("*.toml")), *sorted(folder.glob("systems/*.toml")))}


def described_cases() -> dict[str, str]:
    """The title of each case by its name."""
    texts = ((name, path.read_text(encoding="utf-8")) for name, path in shipped_cases().items())
    return {name: str(tomllib.loads(text)["title"]) for name, text in texts}


def copy_case(name: str, target: Path | None = None) -> Path:
    """Copy a case, with the files that it names, and beside it the schema by which editors complete and check it.

    Args:
        name: of the case; its folder and its ending may stand there, too.
        target: the new file, or a folder for it; a file of its name in the working folder if None.

    Returns:
        The new file.

    Raises:
        FpsolveError: there is no such case, or a file stands where one would be written; nothing is written.
    """
    known = shipped_cases()
    source = known.get(name.removesuffix(".toml").rpartition("/")[2])
    if source is None:
        text = f"got {shown(name)}; must be the name of a case;{nearest(name, known)} `fpsolve new` lists all of them"
        more = (
            f"; for one of your own write `fpsolve new {shlex.quote(name)} --kind system`"
            if name.endswith(".toml")
            else ""
        )
        raise FpsolveError(text + more)
    path = Path(source.name) if target is None else target / source.name if target.is_dir() else target
    text = f"#:schema {SCHEMA}\n{_NAMED.sub('', source.read_text(encoding='utf-8'))}"
    copies = {path: text}
    tables = tomllib.loads(text)
    stated = [tables.get("mesh", {}).get("file"), *map(tables.get("system", {}).get, KEYS)]
    for file in (each for each in stated if isinstance(each, str)):
        beside = path.parent / Path(file).name
        copies[beside] = (source.parent / file).read_text(encoding="utf-8")
        copies[path] = copies[path].replace(file, beside.name)
    _write_new(copies, path, f"write `fpsolve new {source.stem} FILE` with another FILE")
    return path


def write_case(kind: str, modes: Modes, target: Path | None = None) -> Path:
    """Write a commented case of a kind of system, and beside it the schema.

    Args:
        kind: one of `TEMPLATES`.
        modes: its frequencies, damping and wall.
        target: the new file, or a folder for it; a file called as the kind in the working folder if None.

    Returns:
        The new file.

    Raises:
        FpsolveError: there is no such kind, or a file stands there; nothing is written.
    """
    text = f"#:schema {SCHEMA}\n{case_text(kind, modes)}"
    name = f"{kind}.toml"
    path = Path(name) if target is None else target / name if target.is_dir() else target
    if path.suffix != ".toml":
        raise FpsolveError(f"got {path} as the new file; must end in .toml; write, for example, {path}.toml")
    _write_new({path: text}, path, "name another file")
    return path


def _write_new(contents: dict[Path, str], case: Path, remedy: str) -> None:
    """Write files that are not there yet, and the schema beside a case. Raises `FpsolveError` where one is there."""
    for each in contents:
        if each.exists() or each.is_symlink():
            raise FpsolveError(f"{each} is there already; {remedy}")
    schema = case.parent / SCHEMA
    if not schema.exists():
        contents = {**contents, schema: schema_text()}
    for each, content in contents.items():
        write_text(each, content)


def new(
    name: Annotated[
        str,
        Parameter(
            help="A case that comes with fpsolve; if omitted, all are listed. With options the new file; if omitted, "
            "KIND.toml here."
        ),
    ] = "",
    file: Annotated[Path | None, Parameter(help="The new file, or its folder; if omitted, NAME.toml here.")] = None,
    *,
    kind: Annotated[
        str | None,
        Parameter(
            help="Write a case of this kind with comments: oscillator, which is meant if only other options are given, "
            "system for an equation of your own, parametric for noise in the stiffness, modes or plane."
        ),
    ] = None,
    frequency: Annotated[
        list[float] | None, Parameter(help="Its natural frequency in Hz; of two modes twice.", negative="")
    ] = None,
    damping_ratio: Annotated[
        list[float] | None,
        Parameter(help="Its damping as a share of critical damping; 0.01 if omitted.", negative=""),
    ] = None,
    modes: ModesFile = None,
    mode: ModeRows = None,
    restitution: Annotated[
        float | None, Parameter(help="Speed after a bounce off its wall over that before; no wall if omitted.")
    ] = None,
) -> int:
    """Copy a case that comes with fpsolve, list these cases with their titles, or write a commented one of a kind.

    Beside the new case is fpsolve.schema.json, with which editors complete and check it.

    Example: fpsolve new fig1 my_case.toml

    Example: fpsolve new my.toml --frequency 2 --damping-ratio 0.01 --restitution 0.9
    """
    from fpsolve.case.new import modes_of
    from fpsolve.commands.noise import modes_from

    if any(each is not None for each in (kind, frequency, damping_ratio, restitution, modes, mode)):
        if file is not None:
            raise FpsolveError(f"got {name} and {file}; with --kind and other options name the new file only")
        if modes is not None and (frequency or damping_ratio):
            raise FpsolveError("--modes states frequencies and damping; leave out --frequency and --damping-ratio")
        if modes is None and mode is not None:
            raise FpsolveError("--mode is for the table that --modes names; name one, or leave it out")
        if modes is not None:
            table = modes_from(modes, mode or (), restitution)
            frequency = [each / (2 * math.pi) for each in table.omega]
            damping_ratio = [each for each in table.zeta if not math.isnan(each)]
        made = modes_of(frequency or [], damping_ratio or [], restitution)
        print(f"written: {escaped(str(write_case(kind or 'oscillator', made, Path(name) if name else None)))}")
        return 0
    if name:
        print(f"written: {escaped(str(copy_case(name, file)))}")
        return 0
    described = described_cases()
    for each, title in described.items():
        print(f"{each:{max(map(len, described))}}  {title}")
    return 0
