"""Boards as CONFIG sets them up: joints that move fast, and the switches of either kind of board."""

from __future__ import annotations

from dataclasses import replace

from firmware_board import (
    LEAD_TICKS,
    WAKE_TICKS,
    Board,
    EmulatedFirmware,
    Firmware,
    NativeFirmware,
    end_motion,
    run_of,
    segment_of,
)
from planarm_wire.messages import (
    BAUD,
    DEBOUNCE_TICKS,
    JOINTS,
    Config,
    Enable,
    PinMap,
    Result,
    Segments,
    Start,
)

BYTE_TICKS = 10 * 16_000_000 // BAUD
MOST_TICKS_AFTER_STOP = 480  # 30 us
MOST_DEBOUNCE_TICKS = DEBOUNCE_TICKS * 3 // 2 + 8000  # and a pass of the main program
ACTIVE_HIGH, RELEASES, STOP_INPUT, LIMITS, OPENS = 1, 2, 4, 8, 16
WIRING = Config(PinMap.OWN, JOINTS, 0, 0, 0, 160_000, 0, (160_000, 160_000))


def configured(firmware: Firmware, **changes: int) -> Board:
    board = Board(firmware)
    board.hello()
    status = board.ask(replace(WIRING, **changes))
    assert status.refusal is Result.OK
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    return board


def moving(board: Board) -> None:
    """Both joints at 50,000 and 31,000 steps/s for 60 ms."""
    motion = end_motion(
        [segment_of(96_000, run_of(299, first=0, interval=320), run_of(180, first=0, interval=520))] * 10
    )
    for segment in motion:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(300_000)
    assert board.rises(0)


class Switches:
    """The inputs of either board; by default nothing is hit and the stop circuit is closed."""

    def __init__(self, firmware: Firmware) -> None:
        self.firmware = firmware
        self.set()

    def set(self, hit: int = 0, stop_open: bool = False) -> None:
        if isinstance(self.firmware, NativeFirmware):
            self.firmware.set_inputs(hit | (0x80 if stop_open else 0))
            return
        assert isinstance(self.firmware, EmulatedFirmware)
        uno = self.firmware.uno
        uno.pin("A0").drive(1 if stop_open else 0)
        for joint, pin in enumerate(("A1", "A2")):
            uno.pin(pin).drive(0 if hit >> joint & 1 else 1)
