"""Copy a case that comes with fpsolve."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

from fpsolve.case.matrices import KEYS
from fpsolve.case.schema import SCHEMA, schema_text
from fpsolve.errors import FpsolveError
from fpsolve.files import write_text
from fpsolve.messages import escaped
from fpsolve.model.faults import nearest, shown

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


def copy_case(name: str, target: Path | None) -> Path:
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
        guess = nearest(name, known)
        raise FpsolveError(f"got {shown(name)}; must be the name of a case;{guess} `fpsolve new` lists all of them")
    path = Path(source.name) if target is None else target / source.name if target.is_dir() else target
    text = f"#:schema {SCHEMA}\n{_NAMED.sub('', source.read_text(encoding='utf-8'))}"
    copies = {path: text}
    tables = tomllib.loads(text)
    stated = [tables.get("mesh", {}).get("file"), *map(tables.get("system", {}).get, KEYS)]
    for file in (each for each in stated if isinstance(each, str)):
        beside = path.parent / Path(file).name
        copies[beside] = (source.parent / file).read_text(encoding="utf-8")
        copies[path] = copies[path].replace(file, beside.name)
    for each in copies:
        if each.exists() or each.is_symlink():
            raise FpsolveError(f"{each} is there already; write `fpsolve new {source.stem} FILE` with another FILE")
    schema = path.parent / SCHEMA
    if not schema.exists():
        copies[schema] = schema_text()
    for each, content in copies.items():
        write_text(each, content)
    return path


def new(
    name: str = "",
    file: Path | None = None,
) -> int:
    """Copy a case that comes with fpsolve, or list these cases with their titles.

    Beside the new case is fpsolve.schema.json, with which editors complete and check it.

    Example: fpsolve new fig1 my_case.toml

    Args:
        name: A case that comes with fpsolve; if omitted, all are listed.
        file: The new file, or its folder; if omitted, NAME.toml here.
    """
    if name:
        print(f"written: {escaped(str(copy_case(name, file)))}")
        return 0
    described = described_cases()
    for each, title in described.items():
        print(f"{each:{max(map(len, described))}}  {title}")
    return 0
