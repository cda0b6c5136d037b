"""Known numbers by subject: each file has ROWS."""

from importlib import import_module
from pathlib import Path

SUBJECTS = sorted(path.stem for path in Path(__file__).parent.glob("[a-z]*.py"))
ROWS = [row for subject in SUBJECTS for row in import_module(f"{__name__}.{subject}").ROWS]
