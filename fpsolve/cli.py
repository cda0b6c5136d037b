"""The command line: runs a command, and says what went wrong."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from io import TextIOWrapper
from pathlib import Path

from cyclopts import CycloptsError
from rich.console import Console

from fpsolve import letters
from fpsolve.commands import BAD_INPUT, CLOSED_PIPE, INTERRUPTED, NOT_CONVERGED, app, print_error
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.process import drop_blocked_output, ended_by_signals, flush_output


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the help of `app` names the exit codes.

    SIGHUP and SIGTERM interrupt it too; the exit code is then 128 and the number of the signal.
    """
    with ended_by_signals() as received:
        code = _run(argv)
    return 128 + received[0] if received else code


def _run(argv: Sequence[str] | None) -> int:
    """Run a command, and say what went wrong."""
    for stream in (sys.stdout, sys.stderr):  # a terminal that has no Greek shows its names
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors=letters.HANDLER)
    try:
        _refuse_lost_folder()
        code = app(argv, result_action="return_value", exit_on_error=False, error_console=Console(stderr=True))
        flush_output()
    except CycloptsError:  # cyclopts has said what is wrong
        return BAD_INPUT
    except FpsolveError as failure:
        print_error(str(failure))
        return NOT_CONVERGED if isinstance(failure, NotConverged) else BAD_INPUT
    except KeyboardInterrupt as interrupt:
        print_error(str(interrupt) or "interrupted")
        return INTERRUPTED
    except (OSError, SystemExit) as failure:  # rich exits where a pipe is closed
        return _end_blocked(failure)
    return code if isinstance(code, int) else 0


def _end_blocked(failure: OSError | SystemExit) -> int:
    """End where the output cannot be written: quietly if nobody reads it any more, as with `| head -1`."""
    drop_blocked_output()
    if isinstance(failure, BrokenPipeError | SystemExit):
        return CLOSED_PIPE
    place, reason = failure.filename or "the output", failure.strerror or failure
    print_error(f"{place} cannot be written: {reason}; send it to another place")
    return BAD_INPUT


def _refuse_lost_folder() -> None:
    try:
        Path.cwd()
    except OSError:
        raise FpsolveError("the working folder does not exist any more; change to another folder") from None


if __name__ == "__main__":
    sys.exit(main())
