"""The baud rate in a terminal's settings, odd ones such as 250,000 included, which Python's termios does not know.

Linux' `struct termios2` and its two requests, as on x86, ARM and RISC-V (asm-generic/termbits.h): four words of flags,
a line discipline, 19 control characters, input and output rate. Both ends of a pseudo-terminal share one of them.
"""

from __future__ import annotations

import platform
import struct
import sys
from typing import Final

__all__ = ["get_baud", "keeps_dtr", "set_baud"]

TERMIOS2: Final = struct.Struct("4IB19s2I")
TCGETS2, TCSETS2 = 0x802C542A, 0x402C542B
CBAUD, BOTHER = 0o010017, 0o010000
HUPCL = 0o002000
KNOWN: Final = sys.platform == "linux" and platform.machine() in ("x86_64", "i686", "aarch64", "armv7l", "riscv64")


def get_baud(fd: int) -> int | None:
    """Output rate of the terminal `fd`, bits a second; None where it cannot be told."""
    if not KNOWN:
        return None
    return int(TERMIOS2.unpack(_ioctl(fd, TCGETS2, bytes(TERMIOS2.size)))[-1])


def keeps_dtr(fd: int) -> bool:
    """Whether the terminal `fd` would leave DTR up when its last user closes it (HUPCL is off); False if unknown."""
    if not KNOWN:
        return False
    return not int(TERMIOS2.unpack(_ioctl(fd, TCGETS2, bytes(TERMIOS2.size)))[2]) & HUPCL


def set_baud(fd: int, baud: int) -> None:
    """Set both rates of the terminal `fd`; does nothing where `get_baud` tells nothing."""
    if not KNOWN:
        return
    *modes, control, local, line, characters, _, _ = TERMIOS2.unpack(_ioctl(fd, TCGETS2, bytes(TERMIOS2.size)))
    control = (control & ~CBAUD) | BOTHER
    _ioctl(fd, TCSETS2, TERMIOS2.pack(*modes, control, local, line, characters, baud, baud))


def _ioctl(fd: int, request: int, data: bytes) -> bytes:
    import fcntl  # noqa: PLC0415 - POSIX only

    return fcntl.ioctl(fd, request, data)
