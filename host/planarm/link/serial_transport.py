"""Serial ports, ptys and everything else that pyserial opens, with errors that say what to do."""

import contextlib
import errno
import os
import secrets
import select
import sys
from collections.abc import Iterator
from pathlib import Path

import serial
import serial.tools.list_ports

from planarm.errors import LinkError
from planarm.link.clock import Clock, RealClock
from planarm.link.port_holder import holders

WRITE_TIMEOUT_S = 1.0  # 25,000 bytes at 250,000 baud; more than ever waits to be sent
TERMIOS2_BYTES, TCGETS2, TCSETS2 = 44, 0x802C542A, 0x402C542B  # Linux, asm-generic/termbits.h; c_cflag is at 8
BOOT_BAUD = 115_200
RFC2217 = "rfc2217:"
"""pyserial 3.5 knows no time-out of writing there; the network's own ends it."""
_SLICE_S = 0.005  # how late a deadline may be noticed on lines that select() does not know


class SerialTransport:
    """A line opened by pyserial, held exclusively, on the computer's clock."""

    pins = None
    arm = None

    def __init__(self, url: str, baud: int) -> None:
        self.url = url
        self.clock: Clock = RealClock()
        self._port = _open(url, baud)
        self.descriptor = _descriptor(self._port)
        if self.descriptor is not None:
            self._port.timeout = 0
            _prepare_terminal(self._port, self.descriptor)

    def nonce(self) -> int:
        """A random number of 32 bits."""
        return secrets.randbits(32)

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        """Return what has arrived, waiting until `deadline_s` for the first byte."""
        with self._translated("read"):
            while True:
                remaining_s = deadline_s - self.clock.now_s()
                data = self._receive(max_bytes, max(remaining_s, 0.0))
                if data or remaining_s <= 0.0:
                    return data

    def write(self, data: bytes) -> None:
        """Write all of `data`; LinkError when the line does not take it within WRITE_TIMEOUT_S."""
        with self._translated("write"):
            self._port.write(data)

    def close(self) -> None:
        """Close the port and give up its lock."""
        self._port.close()

    def _receive(self, max_bytes: int, wait_s: float) -> bytes:
        if self.descriptor is not None:
            if self._port.is_open:
                select.select([self.descriptor], [], [], None if wait_s == float("inf") else wait_s)
            return bytes(self._port.read(max_bytes))
        first = bytes(self._port.read(1))
        return first + bytes(self._port.read(min(max_bytes - 1, self._port.in_waiting))) if first else b""

    @contextlib.contextmanager
    def _translated(self, action: str) -> Iterator[None]:
        try:
            yield
        except serial.PortNotOpenError as error:
            raise LinkError(f"port {self.url}: {action} after it was closed") from error
        except serial.SerialTimeoutException as error:
            raise LinkError(
                f"port {self.url}: it took no bytes for {WRITE_TIMEOUT_S:g} s; check that the other end is alive"
            ) from error
        except (serial.SerialException, OSError) as error:
            raise LinkError(
                f"port {self.url}: the line is gone ({error}); was the cable pulled, or is another program on the port?"
            ) from error


def _open(url: str, baud: int) -> serial.SerialBase:
    try:
        return serial.serial_for_url(
            url,
            baudrate=baud,
            timeout=_SLICE_S,
            write_timeout=None if url.lower().startswith(RFC2217) else WRITE_TIMEOUT_S,
            exclusive=True if os.name == "posix" and "://" not in url else None,
        )
    except (serial.SerialException, OSError, ValueError) as error:
        raise LinkError(_why_not_opened(url, baud, error)) from error


def not_found(url: str) -> str:
    """Say that there is no such port, and which there are."""
    emulator = " (the emulator in this process is sim://)" if url.lower().strip(":/") in ("", "sim") else ""
    return f"port {url or repr(url)}: not found{emulator}; serial ports found here: {_found()}"


def no_device(url: str) -> str:
    """Say that what is at a path is no serial device, and which there are."""
    what = "a folder" if Path(url).is_dir() else "a file"
    return f"port {url}: is {what}, no serial device; serial ports found here: {_found()}"


def _found() -> str:
    return ", ".join(port.device for port in serial.tools.list_ports.comports()) or "none"


def _why_not_opened(url: str, baud: int, error: Exception) -> str:
    code = getattr(error, "errno", None)
    if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return not_found(url)
    if code in (errno.EACCES, errno.EPERM):
        return f"port {url}: permission denied; {_how_to_get_permission(url)}"
    if code in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK):
        others = ", ".join(str(one) for one in holders(url) if one.pid != os.getpid()) or "another program"
        return f"port {url}: in use by {others}; close that program first"
    if "://" not in url and Path(url).exists() and not Path(url).is_char_device():
        return no_device(url)
    return f"port {url}: cannot be opened at {baud} baud ({error})"


def _how_to_get_permission(path: str) -> str:
    if sys.platform == "win32":
        return "another program may hold the port"
    import grp  # noqa: PLC0415 - POSIX only

    try:
        group_id = Path(path).stat().st_gid
        group = grp.getgrgid(group_id).gr_name
    except OSError:
        return "the folder of the port cannot be read"
    except KeyError:
        group = f"group {group_id}"
    return f"join the group {group} (sudo usermod -aG {group} $USER) and log in again"


def _descriptor(port: serial.SerialBase) -> int | None:
    """File descriptor that select() can wait on, or None."""
    if os.name != "posix":
        return None
    try:
        return int(port.fileno())
    except OSError:  # io.UnsupportedOperation: loop:// and rfc2217:// have none
        return None


def _prepare_terminal(port: serial.SerialBase, descriptor: int) -> None:
    """Keep out openers that do not ask for pyserial's advisory lock, and have bytes handed over without delay.

    Some USB chips hold bytes for 16 ms unless asked not to; drivers that know no such setting, ptys too, say so. The
    first opening resets an Uno, by DTR's edge. With HUPCL off the system leaves DTR as it is when the port is closed,
    even by a program that was killed, so that the next opening makes no edge: the board keeps its position.
    """
    import fcntl  # noqa: PLC0415 - POSIX only
    import termios  # noqa: PLC0415

    if os.isatty(descriptor):
        fcntl.ioctl(descriptor, termios.TIOCEXCL)
        _keep_dtr(descriptor)
        with contextlib.suppress(ValueError, NotImplementedError):
            port.set_low_latency_mode(True)


def let_go(path: str) -> None:
    """Have DTR fall at a port that is closed, so that the next opening resets the board again, as uploading needs.

    Raises:
        LinkError: it cannot be opened.
    """
    transport = SerialTransport(path, BOOT_BAUD)
    if transport.descriptor is not None and os.isatty(transport.descriptor):
        _keep_dtr(transport.descriptor, keep=False)
    transport.close()


def _keep_dtr(descriptor: int, *, keep: bool = True) -> None:
    """Switch HUPCL off or on, and leave all else as it is: `termios.tcsetattr` would lose a rate such as 250,000."""
    import fcntl  # noqa: PLC0415 - POSIX only
    import termios  # noqa: PLC0415

    if sys.platform != "linux":
        return
    settings = bytearray(TERMIOS2_BYTES)
    fcntl.ioctl(descriptor, TCGETS2, settings)
    control = int.from_bytes(settings[8:12], sys.byteorder)
    control = control & ~termios.HUPCL if keep else control | termios.HUPCL
    settings[8:12] = control.to_bytes(4, sys.byteorder)
    fcntl.ioctl(descriptor, TCSETS2, bytes(settings))
