"""The tutorials as Markdown: `python docs/tutorial_pages.py` runs them, and writes each page beside its script."""

import re
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from textwrap import dedent

SCRIPTS = sorted(Path(__file__).with_name("tutorials").glob("*.py"))


def blocks(script: Path) -> Iterator[tuple[str, str]]:
    """The blocks of a script of sphinx-gallery: words in reStructuredText, and the code below them."""
    _, words, rest = script.read_text(encoding="utf-8").split('"""', 2)
    code, *others = re.split(r"^# %%\n", rest, flags=re.MULTILINE)
    yield words, code
    for other in others:
        words, code = re.match(r"((?:#[^\n]*\n)*)(.*)", other, re.DOTALL).groups()
        yield re.sub("^# ?", "", words, flags=re.MULTILINE), code


def markdown(words: str) -> str:
    """Words in Markdown, with what the tutorials use of reStructuredText."""
    words = re.sub(r"^(.+)\n=+$", r"# \1", words.strip(), flags=re.MULTILINE)
    words = re.sub(r"^(.+)\n-+$\n*", r"## \1\n\n", words, flags=re.MULTILINE)
    words = re.sub(r"\.\. math::\n\n((?: +.*\n)+)", lambda found: f"$$\n{dedent(found[1])}$$\n", words)
    words = re.sub(r":math:`(.+?)`", r"$\1$", words)
    words = re.sub(r":doc:`([^`<]+)`", lambda found: f":doc:`{Path(found[1]).name} <{found[1]}>`", words)
    words = re.sub(r":doc:`(.+?) <(.+?)>`", r"[\1](\2.md)", words)
    return words.strip().replace("](/", "](../").replace("``", "`")


def page(script: Path, is_run: bool = False) -> str:
    """A tutorial in Markdown; if it is run, with what it prints."""
    names, parts = dict[str, object](), []
    for words, code in blocks(script):
        parts.append(markdown(words))
        if code.strip():
            parts.append(f"```python\n{code.strip()}\n```")
        if is_run:
            with redirect_stdout(StringIO()) as printed:
                exec(code, names)
            if printed.getvalue():
                parts.append(f"```text\n{printed.getvalue().strip()}\n```")
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    for script in map(Path, sys.argv[1:]) if sys.argv[1:] else SCRIPTS:
        script.with_suffix(".md").write_text(page(script, is_run=True), encoding="utf-8")
