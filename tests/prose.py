"""Sentences of the docs and of the messages that are hard to read: `python -m tests.prose [FILE ...]`.

A sentence is hard if it has more than 25 words, begins with What, That of or Those, or says that something is told,
said, left or found without who does so. A formula or a piece of code is one word. `ALLOWED` lists exceptions.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
DOCS = [each for each in CHECKOUT.glob("docs/**/*.md") if {"generated", "keys.md"}.isdisjoint(each.parts)]
PAGES = [CHECKOUT / "README.md", *sorted(DOCS)]
CODE = CHECKOUT / "fpsolve"
PRINTED = [CODE / "messages.py", *sorted(CODE.glob("tell/*.py")), *sorted(CODE.glob("commands/*.py"))]
MOST_WORDS = 25
RIDDLE = re.compile(r"^\W*(What|That of|Those)\b(?!.*\?\W*$)|\b(is|are) (told|said|left|found)\b")
ALLOWED: dict[str, str] = {}
"""How a sentence begins that may stay, and why."""
NOT_PROSE = re.compile(r"^ *(```|~~~).*?^ *\1$|<!--.*?-->|^ *\$\$.*?\$\$", re.DOTALL | re.MULTILINE)
ONE_WORD = re.compile(r"(?:\{\w+\})?(`+)[^`]+\1|\$[^$]+\$|<http[^>]*>")
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
BREAK = re.compile(
    r"\n\s*\n|^\s*(?:[-*+]|\d+\.|>)\s+|^#+ .*$|^ *:::.*$|^\(.*\)=$|(?<!\\)\|(?=\s*$|.*\|\s*$)", re.MULTILINE
)
"""Where a sentence ends without a full stop: paragraphs, items, headings, admonitions, anchors and cells of tables."""
SHORT = re.compile(r"\b(e\.g|i\.e|s\.e|vs|cf|ca|Eqs?|Figs?|Nos?|Refs?|Secs?|Ch|pp)\.(?=\W)")
STOP = re.compile(r"""(?<=[.!?])["'”’)*_\]]*\s+""")
WORD = re.compile(r"[\w'’./-]*\w[\w'’./-]*")
TEMPLATE = re.compile(r":\?|¦[^{}]*")
"""What a template of a message has beside the first of two alternatives."""


def texts(path: Path) -> Iterator[str]:
    """The page, or the texts in a file of Python that are no docstrings."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        yield text
        return
    tree = ast.parse(text)
    known = {each.value for each in ast.walk(tree) if isinstance(each, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            known |= {*node.values}
            yield "".join(part.value if isinstance(part, ast.Constant) else "x" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in known:
            yield TEMPLATE.sub(" ", node.value)


def sentences(text: str) -> Iterator[str]:
    """The sentences of a text in Markdown, without its code and its displayed formulas."""
    text = LINK.sub(r"\1", ONE_WORD.sub("x", NOT_PROSE.sub("", text)))
    for block in BREAK.split(text):
        for each in STOP.split(SHORT.sub(r"\1", block)):
            yield " ".join(each.split())


def hard(path: Path) -> list[str]:
    """The hard sentences of a file, each with its number of words."""
    found = []
    for each in (sentence for text in texts(path) for sentence in sentences(text)):
        count = len(WORD.findall(each))
        if (count > MOST_WORDS or RIDDLE.search(each)) and not each.startswith(tuple(ALLOWED)):
            found.append(f"{path.name}: {count:3} {each}")
    return found


if __name__ == "__main__":
    found = [each for path in map(Path, sys.argv[1:] or [*PAGES, *PRINTED]) for each in hard(path)]
    print(*found, sep="\n")
    sys.exit(found != [])
