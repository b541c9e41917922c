"""A pseudo-terminal that looks like the Uno's serial port: hosts open it by path, close it and open it again.

A pty is not a UART: it takes any baud rate and ignores it, buffers some kilobytes, and has no DTR line. Pacing is
therefore the bridge's work; "a host opened the port" is seen by watching the terminal's file, and the rate that the
host set is read from the terminal's settings, where the system shows them (Linux; ioctl_tty(2), TCGETS2).
"""

from __future__ import annotations

import errno
import os
import pty
import select
import termios
import tty
from pathlib import Path
from types import TracebackType
from typing import Self

from planarm_sim.bridge.baud import get_baud, keeps_dtr, set_baud
from planarm_sim.bridge.open_watch import watch_opening
from planarm_sim.errors import BridgeError

__all__ = ["PtyLine"]


class PtyLine:
    """The master side of a pty in raw mode, with an optional link at a fixed path. A context manager.

    Args:
        baud: rate that the terminal is set to until a host sets another.
        link: path of a symbolic link to make; a link there that a killed emulator left is replaced: it
            dangles, or names this very terminal, whose number was free again.

    Raises:
        BridgeError: no pty to be had, or `link` exists and is not such a leftover, or cannot be made.
    """

    def __init__(self, link: str | Path | None = None, baud: int | None = None) -> None:
        try:
            self._fd, slave = pty.openpty()
        except OSError as error:
            raise BridgeError(f"no pseudo-terminal: {error.strerror or error}") from error
        try:
            tty.setraw(slave)  # bytes pass unchanged also for hosts that set nothing; stays set when all have closed
            _hang_up_on_close(slave)
            self.path = os.ttyname(slave)
            """Path of the terminal that a host opens."""
        finally:
            os.close(slave)
        os.set_blocking(self._fd, False)
        if baud is not None:
            set_baud(self._fd, baud)
        self._watch = watch_opening(self.path)
        self._was_open = False
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)
        self._link = Path(link) if link is not None else None
        if self._link is not None:
            self._make_link(self._link)

    def _make_link(self, link: Path) -> None:
        try:
            if link.is_symlink() and (not link.exists() or str(link.readlink()) == self.path):
                link.unlink()
            link.symlink_to(self.path)
        except OSError as error:
            self._close_terminal()
            raise BridgeError(f"cannot link {link} to {self.path}: {error.strerror}; give another --link") from error

    def is_open(self) -> bool:
        """Tell whether a host has the terminal open, or has closed it with bytes still to be read."""
        return all(events & select.POLLIN or not events & select.POLLHUP for _, events in self._poll.poll(0))

    def opened(self) -> bool:
        """Tell whether a host has opened the terminal since the last call, also if it has closed it again."""
        if self._watch is not None:
            return self._watch.opened()
        was_open, self._was_open = self._was_open, self.is_open()
        return self._was_open and not was_open

    def baud(self) -> int | None:
        """Rate that the host has set, bits a second; None where the system does not tell."""
        return get_baud(self._fd)

    def keeps_dtr(self) -> bool:
        """Tell whether DTR would stay up when the host closes the terminal; it has no such line, but the setting."""
        return keeps_dtr(self._fd)

    def read(self, most: int) -> bytes:
        """Take up to `most` bytes that the host sent; b"" when there are none, or when it has closed."""
        try:
            return os.read(self._fd, most) if most > 0 else b""
        except OSError as error:
            if error.errno in (errno.EIO, errno.EAGAIN):  # closed by the host; nothing there
                return b""
            raise

    def write(self, data: bytes) -> int:
        """Hand bytes to the host; returns how many its buffer took."""
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0

    def wait(self, timeout_s: float, *, for_bytes: bool) -> bool:
        """Sleep for `timeout_s`, or until a host opens or, when `for_bytes`, sends or closes, if that comes first.

        Returns whether one of these happened; True also where openings cannot be watched.
        """
        # A terminal nobody has open reports a hang-up at once, for ever: it must not be waited for.
        watched = [self._fd] if for_bytes and self.is_open() else []
        if self._watch is not None:
            watched.append(self._watch.fd)
        ready, _, _ = select.select(watched, [], [], max(timeout_s, 0.0))
        return bool(ready) or self._watch is None

    def close(self) -> None:
        """Remove the link, if it is still this terminal's, and close the terminal."""
        if self._link is not None and self._link.is_symlink() and str(self._link.readlink()) == self.path:
            self._link.unlink()
        self._close_terminal()

    def _close_terminal(self) -> None:
        if self._watch is not None:
            self._watch.close()
        os.close(self._fd)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def _hang_up_on_close(fd: int) -> None:
    """Switch HUPCL on, as a fresh serial port has it and a fresh pty has not: its last user's end drops DTR."""
    settings = termios.tcgetattr(fd)
    settings[2] |= termios.HUPCL
    termios.tcsetattr(fd, termios.TCSANOW, settings)
