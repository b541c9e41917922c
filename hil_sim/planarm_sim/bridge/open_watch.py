"""Notices every opening of a file, also one that follows a closing within microseconds.

A pseudo-terminal's master side shows only whether a host has it open *now*. A program that closes its port and opens
it again would pass unseen between two looks, and with it the reset that a Uno makes. Linux' inotify(7) keeps the
events in order. Where there is no inotify, `watch_opening` gives None and the caller has to look by itself.
"""

from __future__ import annotations

import ctypes
import os
import struct

__all__ = ["OpenWatch", "watch_opening"]

IN_CLOSE_WRITE, IN_CLOSE_NOWRITE, IN_OPEN = 0x08, 0x10, 0x20
EVENT = struct.Struct("iIII")
"""struct inotify_event: watch, mask, cookie, length of the name that follows (0 for a watched file)."""


class OpenWatch:
    """The openings of one file.

    Attributes:
        fd: becomes readable when something happened; for select.
    """

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self._is_open = False

    def opened(self) -> bool:
        """Tell whether somebody opened the file since the last call, while nobody had it open."""
        try:
            events = os.read(self.fd, 4096)
        except BlockingIOError:
            return False
        opened = False
        for _, mask, _, _ in EVENT.iter_unpack(events):
            if mask & IN_OPEN:
                opened |= not self._is_open
                self._is_open = True
            elif mask & (IN_CLOSE_WRITE | IN_CLOSE_NOWRITE):
                self._is_open = False
        return opened

    def close(self) -> None:
        """Watch no longer."""
        os.close(self.fd)


def watch_opening(path: str) -> OpenWatch | None:
    """Watch a file that nobody has open; None where the system has no inotify, or none left."""
    libc = ctypes.CDLL(None)
    if not hasattr(libc, "inotify_init1"):
        return None
    fd = int(libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC))
    if fd < 0:
        return None
    if libc.inotify_add_watch(fd, os.fsencode(path), IN_OPEN | IN_CLOSE_WRITE | IN_CLOSE_NOWRITE) < 0:
        os.close(fd)
        return None
    return OpenWatch(fd)
