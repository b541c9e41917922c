"""The live page's server: on the loopback address alone, behind a token that only this run's owner is told.

Other programs of this computer cannot guess the token, other web sites cannot reach the page: the token is part of the
path, the Host header must name the loopback address (so that no foreign name leads here), and no answer may be read by
another site.
"""

from __future__ import annotations

import json
import secrets
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from typing import Any, Self

from planarm.live.live_run import LiveRun

LOOPBACK = "127.0.0.1"
TOKEN_BYTES = 16
MOST_BODY_BYTES = 200
LINGER_S = 3.0
"""After the run the page may still fetch how it ended."""

HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; connect-src 'self'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; form-action 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class LiveServer:
    """Serves one run's page until it is left; a context manager.

    Args:
        live: the run.
        page: its page, complete.
        port: 0 takes a free one.
    """

    def __init__(self, live: LiveRun, page: str, port: int = 0) -> None:
        self._live = live
        self._last_seen = threading.Event()
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self._server = ThreadingHTTPServer((LOOPBACK, port), BaseHTTPRequestHandler)
        self._port = self._server.server_port
        self._server.RequestHandlerClass = self._handler(page.encode())
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, name="live page", daemon=True)

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{LOOPBACK}:{self._port}/{self.token}/"

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Wait a moment until somebody has seen the end, then close."""
        if self._live.state["over"]:
            self._last_seen.wait(LINGER_S)
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def _answer(self) -> bytes:
        state = self._live.state
        if state["over"]:
            self._last_seen.set()
        return json.dumps(state).encode()

    def _handler(self, page: bytes) -> type[BaseHTTPRequestHandler]:
        root, order, answer = f"/{self.token}/", self._live.order, self._answer
        names = [f"{name}:{self._port}" for name in (LOOPBACK, "localhost")]

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if not self._is_ours():
                    return
                if self.path == root:
                    self._send(200, page, "text/html; charset=utf-8")
                elif self.path == f"{root}state":
                    self._send(200, answer(), "application/json")
                else:
                    self._send(404)

            def do_POST(self) -> None:
                if not self._is_ours():
                    return
                if self.path == f"{root}order":
                    self._send(204 if _ordered(self._body(), order) else 400)
                else:
                    self._send(404)

            def _body(self) -> bytes:
                told = self.headers.get("Content-Length", "")
                return self.rfile.read(int(told)) if told.isdecimal() and int(told) <= MOST_BODY_BYTES else b""

            def _is_ours(self) -> bool:
                """Refuse who came by another name, and who has no token: both look like nothing is here."""
                named = self.headers.get("Host", "") in names
                known = secrets.compare_digest(self.path[: len(root)].encode(), root.encode())
                if not (named and known):
                    self._send(404)
                return named and known

            def _send(self, status: int, body: bytes = b"", kind: str = "text/plain") -> None:
                self.send_response(status)
                for name, value in {**HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}.items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_words: Any) -> None:  # noqa: ANN401 - http.server's own
                """Say nothing: the terminal belongs to the run."""

        return Handler


def _ordered(body: bytes, order: Callable[..., None]) -> bool:
    """Give the order that a body holds; tell whether it holds one."""
    try:
        told = json.loads(body)
        order(str(told["order"]), int(told.get("percent", 100)))
    except (ValueError, KeyError, TypeError, AttributeError):
        return False
    return True
