"""A page that is served to browsers of this machine alone, and answers to what it asks."""

from __future__ import annotations

import json
import socket
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import TypeAlias

FILES = {
    "": ("explore.html", "text/html; charset=utf-8"),
    "look.css": ("look.css", "text/css; charset=utf-8"),
    "explore.css": ("explore.css", "text/css; charset=utf-8"),
    "explore.js": ("explore.js", "text/javascript; charset=utf-8"),
}
"""What is served: by its address the file of this folder, and its type."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self' http://127.0.0.1:* http://localhost:*"
)
"""What a browser lets the page do: nothing leaves it, and only pages of this machine may show it in a frame."""
Json: TypeAlias = "bool | int | float | str | Sequence[Json] | Mapping[str, Json] | None"
Answer = Mapping[str, Json]
Question = Mapping[str, object]
"""What JSON holds, unseen."""
DIGITS = 5
"""Of the number of bytes of a question."""
PAUSE = 0.1
"""Seconds between two tries to take a connection."""
LONGEST_WAIT = 300.0
"""Seconds after which a connection on which nothing comes is closed."""


class LocalPage(ThreadingHTTPServer):
    """Serves `FILES` at a free port of 127.0.0.1; `serve_forever` does it, in a thread for each connection.

    Who names another host is refused, so that no name of elsewhere that leads here shows the page; so is a question
    from another origin.

    Args:
        answer: gives the answer, which JSON can hold, to a question by its name; the last argument tells whether the
            browser has closed the connection, so that nobody waits for it any more.
    """

    daemon_threads = True

    def __init__(self, answer: Callable[[str, Question, Callable[[], bool]], Answer]) -> None:
        super().__init__(("127.0.0.1", 0), _Talk)
        self.answer, self.host = answer, f"127.0.0.1:{self.server_port}"
        self.address = f"http://{self.host}"

    def get_request(self) -> tuple[socket.socket, object]:
        """A connection; without one, as where files run out, the next try is later."""
        try:
            return super().get_request()
        except OSError:
            time.sleep(PAUSE)
            raise

    def handle_error(self, request: socket.socket | tuple[bytes, socket.socket], client_address: object) -> None:
        """Say nothing of a browser that has gone."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Talk(BaseHTTPRequestHandler):
    """One connection."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True  # which would hold an answer back for 40 ms
    timeout = LONGEST_WAIT
    server: LocalPage

    def do_GET(self) -> None:
        name, kind = FILES.get(self.path.removeprefix("/"), ("", ""))
        if self._is_named() and name:
            self._send(200, files("fpsolve.tell").joinpath(name).read_bytes(), kind)
        else:
            self._refuse()

    def do_POST(self) -> None:
        size, headers = self.headers.get("Content-Length", ""), self.headers
        is_own = self._is_named() and headers.get("Origin") == self.server.address
        is_read = size.isascii() and size.isdigit() and len(size) <= DIGITS
        if not (is_own and is_read and headers.get("Content-Type") == "application/json"):
            return self._refuse()
        try:
            question = json.loads(self.rfile.read(int(size)))
        except (ValueError, RecursionError):
            question = None
        if not isinstance(question, dict):
            return self._refuse()
        found = json.dumps(self.server.answer(self.path.removeprefix("/"), question, self._is_gone), allow_nan=False)
        return self._send(200, found.encode(), "application/json")

    def _is_gone(self) -> bool:
        """Whether the connection is closed."""
        self.connection.settimeout(0)
        try:
            return not self.connection.recv(1, socket.MSG_PEEK)
        except OSError as failure:
            return not isinstance(failure, BlockingIOError)
        finally:
            self.connection.settimeout(self.timeout)

    def _is_named(self) -> bool:
        return self.headers.get("Host") == self.server.host

    def _refuse(self) -> None:
        self.close_connection = True
        self._send(403, b"refused", "text/plain")

    def _send(self, status: int, content: bytes, kind: str) -> None:
        self.send_response(status)
        lines = {"Content-Type": kind, "Content-Length": str(len(content)), "Content-Security-Policy": POLICY}
        lines |= {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
        for name, value in lines.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Nothing is printed of a question."""
