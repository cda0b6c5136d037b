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


@cache
def shipped_cases() -> Mapping[str, Path]:
    """The cases by their names, those of the paper's oscillator first."""
    package = Path(str(files("fpsolve")))
    folder = next(place for place in (package / "cases", package.parent / "cases") if place.is_dir())
    return {path.stem: path for path in (*sorted(folder.glob("*.toml")), *sorted(folder.glob("systems/*.toml")))}


def copy_case(name: str, target: Path) -> Path:
    """Copy a case, with the files that it names, and beside it the schema by which editors complete and check it.

    Args:
        name: of the case; its folder and its ending may stand there, too.
        target: the new file, or a folder for it.

    Returns:
        The new file.

    Raises:
        FpsolveError: there is no such case, or a file stands where one would be written; nothing is written.
    """
    source = shipped_cases().get(name.removesuffix(".toml").rpartition("/")[2])
    if source is None:
        guess = nearest(name, shipped_cases())
        raise FpsolveError(f"got {shown(name)}; must be the name of a case;{guess} `fpsolve new` lists all of them")
    path = target / source.name if target.is_dir() else target
    text = re.sub(r"\A#:schema .*", f"#:schema {SCHEMA}", source.read_text(encoding="utf-8"))
    tables, copies = tomllib.loads(text), dict[Path, str]()
    for file in (tables.get("mesh", {}).get("file"), *map(tables.get("system", {}).get, KEYS)):
        if isinstance(file, str):
            beside = path.parent / Path(file).name
            copies[beside] = (source.parent / file).read_text(encoding="utf-8")
            text = text.replace(file, beside.name)
    copies[path], schema = text, path.parent / SCHEMA
    for each in copies:
        if each.exists() or each.is_symlink():
            raise FpsolveError(f"{each} is there already; write `fpsolve new {source.stem} FILE` with another FILE")
    for each, content in (copies if schema.exists() else {schema: schema_text(), **copies}).items():
        write_text(each, content)
    return path


def new(
    name: str = "",
    file: Path = Path(),
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
    for each, path in shipped_cases().items():
        title = tomllib.loads(path.read_text(encoding="utf-8"))["title"]
        print(f"{each:{max(map(len, shipped_cases()))}}  {title}")
    return 0
