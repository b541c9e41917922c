"""Transports: bytes to and from a device, chosen by URL.

==============================  =====================================================================
``sim://``                      the emulated Uno in this process, in virtual time, with the released image
``sim://?image=PATH``           the same with another flash image (Intel HEX)
``sim://?board=NAME``           the same with a board's released image; without it the scene's, or uno; it must be
                                the scene's where there is one
``sim://?usb=16u2``             the same with the delays and limits of the board's USB bridge
``sim://?isr=1``                the same, its waveforms tell which interrupt runs (`isr`); about three times slower
``/dev/ttyACM0``, ``COM3``      a serial port or a pty
``file://PATH``                 what is sent goes into a file, and an emulated board answers
``spy+URL``, ``spy+URL#FILE``   any of these, with everything that passes in a journal (spy.journal)
``socket://host:port`` and      whatever pyserial opens by URL
``rfc2217://``, ``loop://`` ..
==============================  =====================================================================
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol
from urllib.parse import parse_qs, urlsplit

from planarm.errors import LinkError
from planarm.link.arm_record import ArmSetup, ArmTrace, emulated_board
from planarm.link.clock import Clock
from planarm_wire.boards import Board
from planarm_wire.messages import BAUD, BOARDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIM_SCHEME = "sim"
FILE_SCHEME = "file"
SPY_PREFIX = "spy+"
SPY_FILE = "spy.journal"
PYSERIAL_SCHEMES = ("alt", "cp2110", "hwgrep", "loop", "rfc2217", "socket", "spy")


class PinTrace(Protocol):
    """What a transport to an emulated board shows beside its bytes: the edges on the board's pins."""

    def edges(self, pin: str) -> "NDArray[Any]":
        """Edges of one pin, such as "D9", as a structured array (cycle int64 at 16 MHz, level uint8)."""
        ...

    def write_vcd(self, path: Path) -> None:
        """Write the waveforms of the pins that matter to a driver (STEP, DIR, ENABLE) to a VCD file."""
        ...


class Transport(Protocol):
    """A two-way byte line with a clock of its own."""

    @property
    def clock(self) -> Clock:
        """The clock that deadlines refer to: the computer's, or the emulator's virtual one."""
        ...

    @property
    def pins(self) -> PinTrace | None:
        """The board's pins when it is an emulated one, else None."""
        ...

    @property
    def arm(self) -> ArmTrace | None:
        """The arm behind the board when it is an emulated one, else None."""
        ...

    def nonce(self) -> int:
        """Give a number of 32 bits for the next HELLO.

        It is random on a real line, and counted on an emulated one, so that runs repeat to the byte.
        """
        ...

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        """Return 1 to `max_bytes` bytes as soon as there are any, or b"" once the clock shows `deadline_s`.

        A deadline in the past reads what is there. LinkError when the line is gone.
        """
        ...

    def write(self, data: bytes) -> None:
        """Hand all of `data` to the line, in order; LinkError when it is gone or does not take it."""
        ...

    def close(self) -> None:
        """Give the line back; closing twice is fine, reading or writing afterwards is a LinkError."""
        ...


def open_transport(url: str, baud: int = BAUD, setup: ArmSetup | None = None, board: Board | None = None) -> Transport:
    """Open the line that `url` names.

    Args:
        url: see the module's text.
        baud: where that has a meaning.
        setup: what stands around an emulated board; others have what they have.
        board: which one is emulated; None: the setup's, or uno. A real one is what it is.

    Raises:
        LinkError: it cannot be opened; the message tells why.
        EmulatorError: the setup cannot be built.
    """
    if url.startswith(SPY_PREFIX):
        return _open_spied(url.removeprefix(SPY_PREFIX), baud, setup, board)
    scheme, separator, rest = url.partition("://")
    if not separator or scheme.lower() in PYSERIAL_SCHEMES:
        from planarm.link.serial_transport import SerialTransport  # noqa: PLC0415 - pyserial only where it is used

        return SerialTransport(url, baud)
    if scheme.lower() == SIM_SCHEME:
        return _open_emulator(url, baud, setup, board)
    if scheme.lower() == FILE_SCHEME:
        from planarm.link.file_transport import FileTransport  # noqa: PLC0415 - the emulator only where it is used

        if not rest:
            raise LinkError(f"port {url!r}: give a path, as in file://stream.bin")
        return FileTransport(rest, baud, setup, board)
    known = ", ".join(f"{name}://" for name in (SIM_SCHEME, FILE_SCHEME, *PYSERIAL_SCHEMES))
    raise LinkError(f"port {url!r}: unknown scheme {scheme!r}; give a device path or one of {known}")


def _open_spied(url: str, baud: int, setup: ArmSetup | None, board: Board | None) -> Transport:
    from planarm.link.journal import JournalWriter  # noqa: PLC0415 - the journal only where one is kept
    from planarm.link.recording import RecordingTransport  # noqa: PLC0415

    inner, _, file = url.partition("#")
    line = open_transport(inner, baud, setup, board)
    path = Path(file or SPY_FILE)
    path.unlink(missing_ok=True)
    journal = JournalWriter(path)
    journal.note(line.clock.now_s(), {"port": inner, "baud": baud})
    return RecordingTransport(line, journal)


@dataclass(frozen=True, slots=True)
class _Emulated:
    """What a sim:// URL asks for."""

    board: Board
    image: str | None
    usb: Literal["direct", "16u2"]
    isr: bool


def require_port(url: str, board: Board) -> None:
    """Check that a URL names a device that is there, and no other board than a scene's, before anything is made.

    A real board tells what it is when it is opened, and so does a flash image of one's own.

    Raises:
        LinkError: it does, or is no URL of the emulator.
    """
    inner = url.removeprefix(SPY_PREFIX).partition("#")[0] if url.startswith(SPY_PREFIX) else url
    if inner.lower().startswith(f"{SIM_SCHEME}://"):
        _emulated(inner, board)
    elif inner.startswith("/") and not Path(inner).is_char_device():
        from planarm.link.serial_transport import no_device, not_found  # noqa: PLC0415 - pyserial only where it is used

        raise LinkError(no_device(inner) if Path(inner).exists() else not_found(inner))


def _emulated(url: str, wanted: Board | None) -> _Emulated:
    """Read a sim:// URL for a scene's board, where there is one."""
    parts = urlsplit(url)
    options = parse_qs(parts.query, keep_blank_values=True)
    kinds: dict[str, Literal["direct", "16u2"]] = {"direct": "direct", "16u2": "16u2"}
    usb = kinds.get(options.get("usb", ["direct"])[-1])
    isr = {"0": False, "1": True}.get(options.get("isr", ["0"])[-1])
    named = options.get("board", [(wanted or emulated_board(None)).name])[-1]
    known = {"image", "board", "usb", "isr"}
    if parts.netloc or parts.path or set(options) - known or usb is None or isr is None or named not in BOARDS:
        raise LinkError(
            f"port {url!r}: the emulator takes sim://, sim://?image=PATH, sim://?board=NAME with one of"
            f" {', '.join(BOARDS)}, sim://?usb=16u2, sim://?isr=1, or several of these by &"
        )
    if wanted is not None and named != wanted.name:
        raise LinkError(
            f"port {url!r}: the scene's arm needs the board {wanted.name}; leave board={named} out, or change"
            " board.wiring in the scene"
        )
    return _Emulated(BOARDS[named], options["image"][-1] if "image" in options else None, usb, isr)


def _open_emulator(url: str, baud: int, setup: ArmSetup | None, board: Board | None) -> Transport:
    from planarm.link.released_image import released_image  # noqa: PLC0415
    from planarm.link.sim_transport import SimTransport  # noqa: PLC0415 - the emulator only where it is used

    asked = _emulated(url, board or (setup.scene.board if setup else None))
    line = SimTransport(asked.image or released_image(asked.board.name), baud, setup, asked.usb, asked.board)
    if asked.isr:
        line.uno.observe()
    return line
