"""A run's journal played into a fresh emulated board: the same bytes on the same cycles give the same edges."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planarm.errors import JournalError
from planarm.link.journal import Journal, Kind
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm_wire.boards import Board
from planarm_wire.messages import BOARDS, TICKS_HZ

LISTENS_S = 0.05
"""A board listens so long after power-up; a recording of a real one begins there."""
AFTER_S = 1.0
"""What was queued at the recording's end is executed."""


@dataclass(frozen=True, slots=True)
class Replay:
    """What a replayed board did.

    Attributes:
        line: the emulator, with its pins.
        board: how its image is wired.
        same_replies: whether it answered with the very bytes that the journal has.
    """

    line: SimTransport
    board: Board
    same_replies: bool

    def edges(self) -> dict[str, int]:
        """How many edges each pin has."""
        return {pin: len(self.line.pins.edges(pin)) for pin in self.board.driver_pins}

    def differences(self, trace: Path) -> list[str]:
        """Hold the edges against a waveform file of the run, and say where the first of each pin differs."""
        from planarm_sim.trace import read_vcd  # noqa: PLC0415 - the emulator is loaded where it is used

        recorded, told = read_vcd(trace).edges, []
        for pin in self.board.driver_pins:
            was, now = recorded[pin][1:], self.line.pins.edges(pin)  # a file begins with the levels
            shared = min(len(was), len(now))
            apart = np.flatnonzero(was[["cycle", "level"]][:shared] != now[["cycle", "level"]][:shared])
            if len(apart) or len(was) != len(now):
                first = int(apart[0]) if len(apart) else shared
                told.append(f"{pin}: {len(was)} edges then, {len(now)} now, edge {first} is the first to differ")
        return told


def replay(journal: Journal, image: Path | None = None) -> Replay:
    """Play what a host sent into a fresh board.

    Args:
        journal: the run's; of a run on the emulator the times are the board's own, else they are moved to its start.
        image: the flash image; None: the released one of the board that the journal names.

    Raises:
        JournalError: nothing was sent.
        LinkError: the image cannot be loaded.
    """
    sent = [record for record in journal.records if record.kind is Kind.SENT]
    if not sent:
        raise JournalError("the journal has nothing that was sent, so there is nothing to replay")
    emulated = str(journal.about.get("port", "")).startswith("sim://")
    shift_s = 0.0 if emulated else LISTENS_S - sent[0].t_s
    board = BOARDS[journal.about.get("board", "uno")]
    line = SimTransport(image or released_image(board.name), board=board)
    for record in sent:
        cycle = round((record.t_s + shift_s) * TICKS_HZ)
        line.uno.run(cycles=max(0, cycle - line.uno.cycle))
        line.write(record.data)
    end_s = journal.records[-1].t_s + shift_s
    line.uno.run(seconds=max(0.0, end_s + AFTER_S - line.uno.time_s))
    received = b"".join(record.data for record in journal.records if record.kind is Kind.RECEIVED)
    return Replay(line, board, line.uno.serial.read().startswith(received))
