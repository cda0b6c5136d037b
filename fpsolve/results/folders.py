"""The folder of results: one run at a time writes there, and all that fpsolve wrote there is of one case.

A list in the folder says for which parameters it is, and which command wrote which file. No other file is removed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from hashlib import sha256
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.errors import OutputError, Remedy
from fpsolve.files import alone, announced, draft_of, writable, write_text

LIST = "records/files.txt"
"""The list: a digest of the parameters, then a line for each file, with the command that wrote it."""
_LINE = re.compile(r"^(\w+) ((?:\w[\w.+-]*/)?\w[\w.+-]*)\n", re.MULTILINE)
"""A whole line of a file in the folder, or in a folder there."""
_FOLDERS = r"records|eigenfunctions(-\d+)?"


@contextmanager
def own_folder(
    folder: Path, *commands: str, case: Case | None = None
) -> Iterator[Callable[[str], AbstractContextManager[None]]]:
    """A folder for one run alone, that keeps the list of what is written in the body.

    What the commands wrote the last time is removed first, and what is there of other parameters. A name is in the list
    before its file is there, so that the next run knows what a killed one has left. Files are of the first command, but
    in a body for which what is yielded names another one.

    Args:
        commands: of this run.
        case: whose parameters count; those of no case are always the same.

    Raises:
        OutputError: the folder cannot be made or written to, another run writes into it, or a folder is
            where a file is that the commands wrote; nothing is removed.
    """
    sets = json.dumps([case.parameter_set({}).digest, case.vary.mode, case.vary.columns]) if case else ""
    digest = sha256(sets.encode()).hexdigest()
    with alone(folder):
        with writable(folder):
            for path in folder.iterdir():
                if re.fullmatch(_FOLDERS, path.name) and (path.is_symlink() or not path.is_dir()):
                    raise OutputError(f"{path} cannot be written to: it is no folder, or a link to one", Remedy.FOLDER)
            former, names = _read(folder)
            for name, owner in names.items():
                if owner in commands and _is_folder(folder / name):
                    raise OutputError(f"{folder / name} cannot be written: Is a directory", Remedy.FOLDER)
            known = {name: owner for name, owner in names.items() if owner not in commands and former == digest}
            _remove(folder, names.keys() - known.keys())
            write_text(folder / LIST, "\n".join([digest, *(f"{owner} {name}" for name, owner in known.items()), ""]))

        def add(command: str, path: Path) -> None:
            name = path.relative_to(folder).as_posix() if path.is_relative_to(folder) else ""
            if name and known.get(name) != command:
                known[name] = command
                with (folder / LIST).open("a", encoding="utf-8") as file:
                    file.write(f"{command} {name}\n")

        def files_of(command: str) -> AbstractContextManager[None]:
            return announced(partial(add, command))

        with files_of(commands[0]):
            yield files_of


def _read(folder: Path) -> tuple[str, dict[str, str]]:
    """The digest of the parameters, and the commands by the names of their files; nothing where the list is none."""
    path = folder / LIST
    text = path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""
    digest, _, lines = text.partition("\n")
    return digest, {name: command for command, name in _LINE.findall(lines)}


def _remove(folder: Path, names: Iterable[str]) -> None:
    """Remove files, what is left unfinished of them, and their folders if these are empty then."""
    for path in (folder / name for name in names):
        for each in (path, draft_of(path)):
            if not _is_folder(each):
                each.unlink(missing_ok=True)
        if path.parent != folder:
            with suppress(OSError):
                path.parent.rmdir()


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()
