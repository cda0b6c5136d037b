"""The command line as `python -m fpsolve`, and as `fpsolve`."""

from __future__ import annotations

import os
import signal

TYPE_CHECKING = False  # without `typing`, whose import takes time in which a signal ends in a traceback
if TYPE_CHECKING:
    from typing import Any, NoReturn


def main() -> NoReturn:
    """Run the command line. What is imported before it has nothing to keep: there Ctrl-C ends the process at once."""
    former = signal.getsignal(signal.SIGINT)
    if former is signal.default_int_handler:  # and not ignored, as it is in the background of a shell
        signal.signal(signal.SIGINT, _interrupted)
    from fpsolve.cli import main as run
    from fpsolve.signals import end_process, is_interrupt

    try:
        signal.signal(signal.SIGINT, former)
        code = run()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # as it is all done
    except BaseException as failure:
        if not is_interrupt(failure):
            raise
        _interrupted()
    end_process(code)


def _interrupted(*_: Any) -> NoReturn:
    os.write(2, b"interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
