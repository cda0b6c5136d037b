"""Look at a case in the browser, with a slider for every parameter."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from fpsolve.commands.options import OPTIONS, Options
from fpsolve.signals import INTERRUPTED
from fpsolve.tell.explore import Explorer
from fpsolve.tell.local import LocalPage


def explore(
    case: Path,
    *,
    no_open: bool = False,
    options: Options = OPTIONS,
) -> int:
    """Show a case in the browser, with a slider for every parameter; end it with Ctrl-C.

    The page is served to this machine alone. It writes nothing: cases and reports are downloads.

    Example: fpsolve explore cases/fig1.toml

    Args:
        case: A case file.
        no_open: Open no browser; the address is printed.
    """
    [loaded] = options.load([case])
    with LocalPage(Explorer(loaded, f"load_case({loaded.path.name!r}).problem").answer) as page:
        print(f"{page.address} shows {loaded.name}; Ctrl-C ends it", flush=True)
        if not no_open:
            webbrowser.open(page.address)
        try:
            page.serve_forever()
        except KeyboardInterrupt:
            return INTERRUPTED
    return 0
