"""Where results come from: what made them, from what, on what machine, and when."""

from __future__ import annotations

import platform
import shlex
import socket
import sys
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from time import monotonic
from typing import Any

from fpsolve import __version__
from fpsolve.case.case import Case

PACKAGES = ("numpy", "scipy", "scikit-fem")


@dataclass(frozen=True)
class Run:
    """One run of a case, from when this is made.

    Attributes:
        case: what is run.
        started: when, in UTC.
    """

    case: Case
    started: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))
    _begun: float = field(default_factory=monotonic)

    def facts(self) -> dict[str, Any]:
        """Versions, the command, the machine, when and how long until now, and the case as it was written."""
        return {
            "versions": versions(),
            "command": shlex.join(sys.argv),
            "host": socket.gethostname(),
            "started": self.started,
            "wall_seconds": round(monotonic() - self._begun, 3),
            "overrides": list(self.case.overrides),
            "case_text": self.case.text,
        }


def versions() -> dict[str, str]:
    """Of fpsolve, of Python, and of the packages that its numbers depend on."""
    return {"fpsolve": __version__, "python": platform.python_version(), **{name: version(name) for name in PACKAGES}}
