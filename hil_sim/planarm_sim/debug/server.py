"""The socket at which a debugger attaches, on this computer only."""

from __future__ import annotations

import select
import socket
from collections.abc import Callable
from types import TracebackType
from typing import Final, Self

from planarm_sim.cpu.chip import StopCause
from planarm_sim.debug.session import Session
from planarm_sim.debug.target import Target
from planarm_sim.errors import BridgeError

__all__ = ["GdbServer", "serve"]

LOOPBACK: Final = "127.0.0.1"
SLICE_CYCLES: Final = 32_000
"""Emulated cycles between two looks at the socket while the board runs: 2 ms."""
WAIT_S: Final = 0.05


class GdbServer:
    """Listens for one debugger at a time. A context manager.

    Args:
        port: TCP port of 127.0.0.1; 0 takes a free one.
        attach: makes the target when a debugger comes.

    Attributes:
        port: the port that is listened at.

    Raises:
        BridgeError: the port cannot be had.
    """

    def __init__(self, port: int, attach: Callable[[], Target]) -> None:
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind((LOOPBACK, port))
            self._listener.listen(1)
        except (OSError, OverflowError) as error:
            self._listener.close()
            raise BridgeError(f"gdb port {port}: {error}; choose another from 1024 to 65535") from error
        self.port: int = self._listener.getsockname()[1]
        self._attach = attach
        self._target: Target | None = None
        self._peer: socket.socket | None = None
        self._session: Session | None = None

    @property
    def attached(self) -> bool:
        """Whether a debugger is attached."""
        return self._session is not None

    @property
    def holds(self) -> bool:
        """Whether a debugger is attached and has the board stand still."""
        return self._session is not None and not self._session.running

    def poll(self, timeout_s: float) -> None:
        """Serve the debugger, or take one that comes; waits up to `timeout_s` for either."""
        watched = self._listener if self._peer is None else self._peer
        if not select.select([watched], [], [], timeout_s)[0]:
            return
        if self._peer is None or self._session is None:
            self._peer, _ = self._listener.accept()
            self._peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._target = self._attach()
            self._session = Session(self._target)
            return
        try:
            data = self._peer.recv(4096)
        except ConnectionError:
            data = b""
        self._send(self._session.receive(data))
        if not data or self._session.ended:
            self._hang_up()

    def board_stopped(self, cause: StopCause) -> None:
        """Tell the debugger why the board stands still."""
        if self._session is not None:
            self._send(self._session.stopped(cause))

    def _send(self, data: bytes) -> None:
        if data and self._peer is not None:
            try:
                self._peer.sendall(data)
            except ConnectionError:
                self._hang_up()

    def _hang_up(self) -> None:
        if self._target is not None:
            self._target.release()
        if self._peer is not None:
            self._peer.close()
        self._target = self._peer = self._session = None

    def close(self) -> None:
        """Let go of the debugger and of the port."""
        self._hang_up()
        self._listener.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def serve(server: GdbServer, run_slice: Callable[[int], StopCause]) -> None:
    """Wait for a debugger and have the board do what it says until it goes.

    Args:
        server: where it attaches.
        run_slice: lets the board run for so many cycles, and tells why it came back.
    """
    while not server.attached:
        server.poll(WAIT_S)
    while server.attached:
        server.poll(WAIT_S if server.holds else 0.0)
        if server.attached and not server.holds:
            cause = run_slice(SLICE_CYCLES)
            if cause is not StopCause.REACHED:
                server.board_stopped(cause)
