"""One debugger's conversation: commands in, answers out, and whether the board may run. No I/O, no time.

GDB manual, appendix "GDB Remote Serial Protocol", "Packets". What is not known is answered by an empty packet, as
the protocol asks.
"""

from __future__ import annotations

from collections.abc import Callable

from planarm_sim.cpu.chip import StopCause
from planarm_sim.debug.packets import INTERRUPT, RESEND, PacketReader, packet, unescape
from planarm_sim.debug.target import DATA_SPACE, REGISTER_BYTES, Target

__all__ = ["Session"]

OK, UNKNOWN, BAD = b"OK", b"", b"E01"
SIGINT, SIGILL, SIGTRAP = b"S02", b"S04", b"S05"
SIGNALS = {StopCause.BREAK: SIGTRAP, StopCause.BAD_OPCODE: SIGILL, StopCause.BREAKPOINT: SIGTRAP}
SUPPORTED = b"PacketSize=1000;QStartNoAckMode+;vContSupported+;swbreak-;hwbreak-"
BREAKPOINTS, WATCHPOINTS = (b"0", b"1"), b"2"


class Session:
    """A debugger that is attached; the board stands still until it says go.

    Args:
        target: the chip.

    Attributes:
        running: whether the debugger let the board run.
        ended: whether it has gone: detached or killed.
    """

    def __init__(self, target: Target) -> None:
        self._target = target
        self._reader = PacketReader()
        self._acknowledges = True
        self._last = b""
        self._stop_reply = SIGTRAP
        self.running = False
        self.ended = False

    def receive(self, data: bytes) -> bytes:
        """Take the debugger's bytes; returns what to send."""
        events, answers = self._reader.feed(data)
        sent = answers if self._acknowledges else b""
        for event in events:
            if event == INTERRUPT:
                sent += self._stopped(SIGINT) if self.running else b""
            elif event == RESEND:
                sent += self._last
            else:
                sent += self._answer(event[1:])
        return sent

    def stopped(self, cause: StopCause) -> bytes:
        """The board stopped by itself; returns what to send."""
        changed = self._target.observer.changed_address
        if cause is StopCause.BREAKPOINT and changed is not None:
            return self._stopped(b"T05watch:%06x;" % (DATA_SPACE + changed))
        return self._stopped(SIGNALS.get(cause, SIGTRAP))

    def _stopped(self, reply: bytes) -> bytes:
        self.running = False
        self._stop_reply = reply
        return self._packet(reply)

    def _packet(self, payload: bytes) -> bytes:
        self._last = packet(payload)
        return self._last

    def _answer(self, command: bytes) -> bytes:
        kind, rest = command[:1], command[1:]
        if kind in b"cs" or command.startswith((b"vCont;", b"C", b"S")):
            return self._resume(command)
        known: dict[bytes, Callable[[bytes], bytes]] = {
            b"?": lambda _rest: self._stop_reply,
            b"g": lambda _rest: b"".join(map(self._register, range(len(REGISTER_BYTES)))),
            b"G": self._write_registers,
            b"p": lambda rest: self._register(int(rest, 16)),
            b"P": self._write_register,
            b"m": self._read_memory,
            b"M": self._write_memory,
            b"X": self._write_memory,
            b"Z": lambda rest: self._landmark(rest, add=True),
            b"z": lambda rest: self._landmark(rest, add=False),
            b"H": lambda _rest: OK,
            b"T": lambda _rest: OK,
            b"q": self._query,
            b"Q": self._set,
            b"v": lambda rest: b"vCont;c;C;s;S" if rest == b"Cont?" else UNKNOWN,
            b"D": self._detach,
            b"k": self._detach,
        }
        try:
            return self._packet(known[kind](rest) if kind in known else UNKNOWN)
        except (ValueError, IndexError):
            return self._packet(BAD)

    # --- Running ---

    def _resume(self, command: bytes) -> bytes:
        action = command.removeprefix(b"vCont;")[:1].lower()
        if action == b"s":
            cause = self._target.step()
            return self._stopped(SIGTRAP) if cause is StopCause.REACHED else self.stopped(cause)
        self._target.observer.pass_breakpoint(self._target.cycle)
        self.running = True
        return b""

    def _detach(self, _rest: bytes) -> bytes:
        self._target.release()
        self.running, self.ended = True, True
        return OK

    def _landmark(self, rest: bytes, *, add: bool) -> bytes:
        kind, address, length = rest.split(b";")[0].split(b",")
        at = int(address, 16)
        observer = self._target.observer
        if kind in BREAKPOINTS:
            words = {at // 2}
            observer.breakpoints = observer.breakpoints | words if add else observer.breakpoints - words
            return OK
        if kind == WATCHPOINTS and at >= DATA_SPACE:
            places = set(range(at - DATA_SPACE, at - DATA_SPACE + int(length, 16)))
            observer.watchpoints = observer.watchpoints | places if add else observer.watchpoints - places
            return OK
        return UNKNOWN  # reads cannot be watched

    # --- Registers and memory ---

    def _register(self, number: int) -> bytes:
        return self._target.read_register(number).hex().encode()

    def _write_register(self, rest: bytes) -> bytes:
        number, value = rest.split(b"=")
        self._target.write_register(int(number, 16), bytes.fromhex(value.decode()))
        return OK

    def _write_registers(self, rest: bytes) -> bytes:
        data = bytes.fromhex(rest.decode())
        if len(data) != sum(REGISTER_BYTES):
            return BAD
        for number, size in enumerate(REGISTER_BYTES):
            self._target.write_register(number, data[:size])
            data = data[size:]
        return OK

    def _read_memory(self, rest: bytes) -> bytes:
        address, length = (int(part, 16) for part in rest.split(b","))
        return self._target.read_memory(address, length).hex().encode() or BAD

    def _write_memory(self, rest: bytes) -> bytes:
        place, _, content = rest.partition(b":")
        address, length = (int(part, 16) for part in place.split(b","))
        data = bytes.fromhex(content.decode()) if len(content) == 2 * length and _is_hex(content) else unescape(content)
        return OK if len(data) == length and self._target.write_memory(address, data) else BAD

    # --- Queries ---

    def _query(self, rest: bytes) -> bytes:
        if rest.startswith(b"Supported"):
            return SUPPORTED
        if rest.startswith(b"Rcmd,"):
            return self._monitor(bytes.fromhex(rest[5:].decode()).strip())
        return {b"Attached": b"1", b"C": b"QC1", b"fThreadInfo": b"m1", b"sThreadInfo": b"l"}.get(rest, UNKNOWN)

    def _monitor(self, words: bytes) -> bytes:
        if words == b"reset":
            self._target.reset()
            return OK
        if words == b"cycle":
            return f"{self._target.cycle}\n".encode().hex().encode()
        return b"monitor knows reset and cycle\n".hex().encode()

    def _set(self, rest: bytes) -> bytes:
        if rest != b"StartNoAckMode":
            return UNKNOWN
        self._acknowledges = False
        return OK


def _is_hex(content: bytes) -> bool:
    return all(byte in b"0123456789abcdefABCDEF" for byte in content)
