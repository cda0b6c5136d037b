"""What fpsolve says of faulty input, kept as text.

`python -m tests.snapshots` shows what is said otherwise now; with `--update` it becomes the text.

A file in tests/contract/refusals begins with a command and the name of a case, then has a good case up to a line of
====. The entries below it change this case, and hold each line that is said:

    ~ omega = -1.0          a line in place of that with its key
    - old line              lines in place of others (`+` alone: at the end)
    + new line
    x [vary]                a section is left out
    $ noise.D0=2            an argument of --set, or an option
    @ sets.csv 'text'       a file beside the case, or in its place
    | bad.toml:4: what is said; FOLDER is the folder of the case

Changes have {400 * 0} for 400 zeros. Each entry is refused with exit code 2, without any output, and nothing is
written.
"""

from __future__ import annotations

import ast
import re
import sys
import tempfile
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from tests.kit import run

FOLDER = Path(__file__).parent / "contract/refusals"
END = "====\n"
BAD_INPUT = 2


class Line(NamedTuple):
    """A line of an entry: one of ~-+x$@|, and what it says."""

    kind: str
    text: str


@dataclass(frozen=True)
class Entry:
    """A change of a good case, and what is said of it."""

    command: str
    name: str
    good: str
    changes: tuple[Line, ...]
    said: tuple[str, ...]

    @property
    def id(self) -> str:
        return " ".join(text for _, text in self.changes)[:60].replace("\\", "/")

    @property
    def text(self) -> str:
        """The faulty case."""
        text = f"\n{self.good}"
        for is_edit, lines in groupby(self.changes, key=lambda line: line.kind in "-+"):
            group = list(lines)
            if is_edit:
                text = _edited(text, group)
            for line in group:
                if line.kind == "x":
                    text = re.sub(rf"(?ms)^{re.escape(line.text)}\n.*?(?=^\[|\Z)", "", text)
                if line.kind == "~":
                    key = line.text.partition(" =")[0]
                    [old] = [each for each in text.splitlines() if each.startswith(f"{key} =")]
                    text = text.replace(f"\n{old}\n", f"\n{line.text}\n")
        return repeated(text[1:])

    def outcome(self, folder: Path) -> tuple[str, ...]:
        """The lines that are said, where all else is as it must be."""
        texts = {self.name: self.text}
        for name, _, content in (line.text.partition(" ") for line in self.changes if line.kind == "@"):
            texts[name] = ast.literal_eval(repeated(content))
        stated = [repeated(text) for kind, text in self.changes if kind == "$"]
        options = [word for text in stated for word in (text.split() if text.startswith("--") else ("--set", text))]
        done = run(folder, self.command, self.name, *options, **texts)
        assert (done.code, done.out) == (BAD_INPUT, ""), done.err
        assert {each.name for each in folder.rglob("*")} == texts.keys()
        return tuple(done.err.replace(str(folder), "FOLDER").splitlines())


def repeated(text: str) -> str:
    """A text with the zeros of {400 * 0}."""
    return re.sub(r"\{(\d+) \* ([^}]+)\}", lambda found: int(found[1]) * found[2], text)


def _edited(text: str, lines: list[Line]) -> str:
    """Each group of - and + lines replaced; + alone is added at the end."""
    blocks: list[tuple[list[str], list[str]]] = []
    for kind, line in lines:
        if not blocks or (kind == "-" and blocks[-1][1]):
            blocks.append(([], []))
        blocks[-1][kind == "+"].append(line)
    for old, new in blocks:
        before, after = ("".join(f"\n{line}" for line in each) + "\n" for each in (old, new))
        if old:
            assert text.count(before) == 1, old
        text = text.replace(before, after) if old else text[:-1] + after
    return text


def read(path: Path) -> tuple[str, list[Entry | str]]:
    """The head of a file, and its entries and comments."""
    head, _, body = path.read_text(encoding="utf-8").partition(END)
    first, _, good = head.partition("\n")
    command, name = first.split()[1:]
    found: list[Entry | str] = []
    changes: list[Line] = []
    said: list[str] = []

    def finish() -> None:
        if changes:
            found.append(Entry(command, name, good, tuple(changes), tuple(said)))
        changes.clear()
        said.clear()

    for line in body.splitlines():
        kind, text = line[:1], line[2:]
        if kind == "|":
            said.append(text)
            continue
        if said or kind in ("#", ""):
            finish()
        if kind in ("#", ""):
            found.append(line)
        else:
            changes.append(Line(kind, text))
    finish()
    return head + END, found


def entries() -> list[Entry]:
    """Those of all files."""
    return [each for path in sorted(FOLDER.glob("*.txt")) for each in read(path)[1] if isinstance(each, Entry)]


def good(name: str) -> str:
    """The good case that the entries of a file change."""
    return (FOLDER / f"{name}.txt").read_text(encoding="utf-8").partition(END)[0].partition("\n")[2]


def written(entry: Entry | str, said: tuple[str, ...]) -> str:
    """An entry or a comment as it stands in its file."""
    if isinstance(entry, str):
        return f"{entry}\n"
    return "".join(f"{kind} {text}\n" for kind, text in (*entry.changes, *(("|", text) for text in said)))


def main() -> int:
    """Print the entries of which something else is said; with --update write what is said."""
    differing = 0
    for path in sorted(FOLDER.glob("*.txt")):
        head, found = read(path)
        lines = [head]
        for entry in found:
            said: tuple[str, ...] = ()
            if isinstance(entry, Entry):
                with tempfile.TemporaryDirectory() as folder:
                    said = entry.outcome(Path(folder))
                if said != entry.said:
                    differing += 1
                    print(f"{path.name}: {entry.id}", *said, sep="\n| ")
            lines.append(written(entry, said))
        if "--update" in sys.argv:
            path.write_text("".join(lines), encoding="utf-8")
    return 0 if "--update" in sys.argv else bool(differing)


if __name__ == "__main__":
    raise SystemExit(main())
