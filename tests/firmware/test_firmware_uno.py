"""The released image on the emulated Uno: what only the chip can show. Start-up, boot count, speed with a busy line."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_board import (
    LEAD_TICKS,
    Board,
    EmulatedFirmware,
    Schedule,
    end_motion,
    run_of,
    segment_of,
)
from firmware_motions import fast, restless
from firmware_streamer import LedgerReader, Streamer
from planarm_sim import Uno
from planarm_wire.codec import decode, encode
from planarm_wire.framing import Frame, FrameDecoder, encode_frame
from planarm_wire.messages import (
    BAUD,
    DELIMITER,
    DIR_PINS,
    ENABLE_PIN,
    HOST_WINDOW_BYTES,
    MIN_INTERVAL_TICKS,
    MIN_STEP_HIGH_TICKS,
    MIN_STEP_LOW_TICKS,
    PROTOCOL_VERSION,
    STEP_PINS,
    TICKS_HZ,
    Fault,
    Hello,
    Segment,
    Segments,
    Start,
    State,
    Status,
    Welcome,
)

IMAGE = Path(__file__).parents[2] / "firmware" / "release" / "uno.hex"
RESET_TO_PINS_CYCLES = 32  # 2 us, with a look at the EEPROM for ENABLE's polarity
# Before a pulse ends there may run what is left of a receive interrupt (39), a lock of the main program (11), the other
# joint's interrupt (77) and the one instruction between two (2); it ends after 56 itself.
MOST_HIGH_TICKS = 185
BOOT_CYCLES = 600_000
POLARITY_ADDRESS, ACTIVE_HIGH = 1023, 0x01  # firmware/hal/uno/polarity.h


def boot_nonce(uno: Uno) -> int:
    """The nonce of a board that has just booted."""
    uno.serial.write(encode_frame(0, *encode(Hello(PROTOCOL_VERSION, 1))))
    uno.run(cycles=100_000)
    (frame,) = FrameDecoder().feed(uno.serial.read())
    assert isinstance(frame, Frame)
    welcome = decode(frame.type_code, frame.payload)
    assert isinstance(welcome, Welcome)
    return welcome.boot_nonce


def test_drivers_are_released_at_once_and_nothing_else_moves() -> None:
    uno = Uno.from_hex(IMAGE, baud=BAUD)
    uno.run(cycles=RESET_TO_PINS_CYCLES)
    assert uno.pin(ENABLE_PIN).level == 1
    uno.run(cycles=BOOT_CYCLES)
    assert uno.pin(ENABLE_PIN).level == 1
    assert uno.edges(ENABLE_PIN)["level"].tolist() == [1], "the pull-up, and high ever since"
    assert uno.edges(ENABLE_PIN)["cycle"][0] <= RESET_TO_PINS_CYCLES
    assert [len(uno.edges(pin)) for pin in (*STEP_PINS, *DIR_PINS)] == [0] * 4


@pytest.mark.parametrize("high", [0, 1])
def test_enable_is_never_driven_against_what_holds_it(high: int) -> None:
    # A resistor keeps the drivers off until the firmware runs; CONFIG's polarity is in EEPROM by then, or nothing is.
    # Undriven, a pin that the firmware drives low for a moment would look like one that floats.
    uno = Uno.from_hex(IMAGE, baud=BAUD)
    if not high:
        uno._chip.eeprom[POLARITY_ADDRESS] = ACTIVE_HIGH
    uno.pin(ENABLE_PIN).drive(high)
    uno.reset()
    uno.clear_edges()
    uno.run(cycles=BOOT_CYCLES)
    assert uno.pin(ENABLE_PIN).level == high
    assert len(uno.edges(ENABLE_PIN)) == 0
    uno.pin(ENABLE_PIN).drive(1 - high)
    uno.run(cycles=100)
    assert uno.pin(ENABLE_PIN).level == high, "driven by the chip, not by the resistor alone"


def test_every_reset_gives_another_nonce() -> None:
    uno = Uno.from_hex(IMAGE, baud=BAUD)
    uno.run(cycles=BOOT_CYCLES)
    nonces = [boot_nonce(uno)]
    for _ in range(20):
        uno.reset()
        uno.run(cycles=BOOT_CYCLES)
        nonces.append(boot_nonce(uno))
    assert len(set(nonces)) == len(nonces)


def test_a_reset_while_the_count_is_written_repeats_no_nonce() -> None:
    # The count goes to EEPROM for about 3.4 ms; a reset at any moment of it must not bring an old nonce back.
    uno = Uno.from_hex(IMAGE, baud=BAUD)
    uno.run(cycles=BOOT_CYCLES)
    seen = [boot_nonce(uno)]
    for moment in range(1000, 70_000, 6_900):
        uno.reset()
        uno.run(cycles=moment)
        uno.reset()
        uno.run(cycles=BOOT_CYCLES)
        seen.append(boot_nonce(uno))
    assert len(set(seen)) == len(seen)


def test_reset_in_motion_releases_the_drivers_and_forgets_the_motion(emulated_firmware: EmulatedFirmware) -> None:
    board = Board(emulated_firmware)
    board.get_ready()
    board.ask(Segments(0, 0, 0, (segment_of(1_000_000, run_of(900)),)))
    board.send(Start(LEAD_TICKS))
    board.run(100_000)
    uno = emulated_firmware.uno
    uno.reset()
    board.edges.clear()
    board.run(BOOT_CYCLES)
    assert uno.pin(ENABLE_PIN).level == 1
    assert not any(edge.level for edge in board.motion_edges())
    board.hello()
    status = board.ask()
    assert (status.state, status.ledger.position_usteps) == (State.IDLE, (0, 0))


def reversing(ratio: float) -> list[Segment]:
    """Joint 1 at 800 ticks, joint 2 slower by a ratio, both turning round at boundaries 2 ms apart."""
    interval, duration = 800, 32_000
    slow = round(interval * ratio)
    return [
        segment_of(
            duration,
            run_of(duration // interval, first=0, interval=interval, positive=i % 2 == 0),
            run_of((duration - 7) // slow, first=7, interval=slow, positive=i % 3 == 0),
        )
        for i in range(60)
    ]


def assert_every_edge(board: Board, motion: list[Segment], status: Status) -> None:
    """No fault, no byte lost in the USART, every rising edge on its tick, every pulse long enough, ledger exact."""
    assert (status.fault, status.overruns) == (Fault.NONE, 0)
    schedule = Schedule.of(motion)
    begin = board.rises(0)[0] - schedule.steps[0][0][0]
    for joint in range(2):
        assert board.rises(joint) == [begin + tick for tick, _ in schedule.steps[joint]]
        edges = [edge for edge in board.edges if edge.pin == STEP_PINS[joint]]
        highs = [fall.tick - rise.tick for rise, fall in zip(edges[::2], edges[1::2], strict=True)]
        lows = [rise.tick - fall.tick for fall, rise in zip(edges[1::2], edges[2::2], strict=False)]
        assert min(highs) >= MIN_STEP_HIGH_TICKS
        assert max(highs) <= MOST_HIGH_TICKS, f"joint {joint + 1}: {max(highs)}"
        assert min(lows) >= MIN_STEP_LOW_TICKS
    assert status.ledger.position_usteps == schedule.positions()


@pytest.mark.parametrize("busy_line", [False, True], ids=["line as needed", "window always full"])
@pytest.mark.parametrize(
    "motion",
    [
        reversing(1.0),
        reversing(1.618),
        fast(320, 1.0037, 62_500, 75),
        fast(320, 1.0, 62_500, 75),
        fast(320, 1.618, 62_500, 75),
        fast(246, 65_041 / 65_000, 228_000, 24),
        fast(MIN_INTERVAL_TICKS, 1.0037, 228_000, 24),
        fast(MIN_INTERVAL_TICKS, 1.0, 228_000, 24),
    ],
    ids=[
        "20 k, both turn",
        "20 k and 12.4 k, both turn",
        "50 k and 49.8 k",
        "50 k",
        "50 k and 30.9 k",
        "65,041 and 65,000",
        "71 k, all phases",
        "71 k",
    ],
)
def test_full_rate_with_both_joints(
    emulated_firmware: EmulatedFirmware, motion: list[Segment], busy_line: bool
) -> None:
    # Streamed while the joints move.
    motion = end_motion(motion)
    board = Board(emulated_firmware)
    board.get_ready()
    for segment in motion[:16]:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    status = Streamer(board, motion[16:], busy_line).run(len(motion), 12_000_000)
    assert (status.ring_full, status.crc_errors) == (0, 0)
    assert_every_edge(board, motion, status)


@pytest.mark.parametrize("least_interval", [320, 246, MIN_INTERVAL_TICKS], ids=["50 k", "65 k", "71 k"])
def test_a_random_motion(
    emulated_firmware: EmulatedFirmware, least_interval: int, sized: Callable[[int, int], int]
) -> None:
    # The window always full; about 7 ms a segment: 1.7 s, or 10 s with --full.
    motion = end_motion(restless(1, least_interval, sized(250, 1450)))
    board = Board(emulated_firmware)
    board.get_ready()
    for segment in motion[:16]:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    status = Streamer(board, motion[16:], busy_line=True).run(len(motion), 320_000_000)
    assert (status.ring_full, status.crc_errors) == (0, 0)
    assert_every_edge(board, motion, status)


@pytest.mark.parametrize("least_interval", [246, MIN_INTERVAL_TICKS], ids=["65 k", "71 k"])
def test_steps_of_fast_growing_intervals_are_found_in_time(
    emulated_firmware: EmulatedFirmware, least_interval: int
) -> None:
    # After both joints at full rate, segments that begin at the least interval: a slice has far fewer steps of the next
    # than its first interval tells.
    motion = end_motion(restless(1, least_interval, 484)[470:])
    board = Board(emulated_firmware)
    board.get_ready()
    for segment in motion:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    status = Streamer(board, [], busy_line=True).run(len(motion), 8_000_000)
    assert_every_edge(board, motion, status)


@pytest.mark.parametrize(
    ("interval", "ratio"),
    [(320, 1.0037), (246, 65_041 / 40_170), (246, 65_041 / 65_000), (MIN_INTERVAL_TICKS, 1.0037)],
    ids=["50,000 : 49,816", "65,041 : 40,170", "65,041 : 65,000", "71,111 : 70,849"],
)
def test_constant_rates_on_a_saturated_line(
    emulated_firmware: EmulatedFirmware, interval: int, ratio: float, sized: Callable[[int, int], int]
) -> None:
    # Valid frames fill the line without a gap, whatever the window. They repeat a number, so each is answered by STATUS
    # and none queues anything; many find the ring full.
    duration = 30_000 * interval
    count = sized(1, math.ceil(10 * TICKS_HZ / duration))
    motion = end_motion(fast(interval, ratio, duration, count))
    board = Board(emulated_firmware)
    board.get_ready()
    for segment in motion:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    frame = encode_frame(board.seq - 1, *encode(Segments(0, 0, 0, (motion[0],))))
    end = board.now + LEAD_TICKS + duration * count + 100_000
    serial = emulated_firmware.uno.serial
    while board.now < end:
        while serial.pending < HOST_WINDOW_BYTES:
            board.receive(frame)
        board.run(20_000)
    board.run(200_000)
    board.receive(bytes([DELIMITER]))
    status = board.ask()
    assert_every_edge(board, motion, status)


def test_the_ledger_is_exact_at_its_tick_between_the_steps(emulated_firmware: EmulatedFirmware) -> None:
    # Both joints at the board's rate in all phases, a pulse or an interrupt at nearly every moment. What the ledger
    # tells must be the steps that have risen at its tick; the tick of cycle 0 is the same for all.
    motion = end_motion(fast(MIN_INTERVAL_TICKS, 1.0037, 250_000, 16))
    board = Board(emulated_firmware)
    board.get_ready()
    for segment in motion[:12]:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    reader = LedgerReader(board, motion[12:])
    reader.run(len(motion), 12_000_000)
    reader.assert_exact()


def test_more_bytes_than_the_ring_holds_are_counted_and_harmless(emulated_firmware: EmulatedFirmware) -> None:
    # No window kept, no delimiter: the steps go on, and what is lost is told.
    motion = end_motion([segment_of(800_000, run_of(999, interval=800), run_of(999, interval=800))])
    board = Board(emulated_firmware)
    board.get_ready()
    board.ask(Segments(0, 0, 0, tuple(motion)))
    board.ask(Start(LEAD_TICKS))
    board.receive(bytes(range(256)) * 4)
    board.run(1_200_000)
    status = board.ask()
    assert status.fault is Fault.NONE
    assert status.crc_errors > 0
    rises = board.rises(0)
    assert [tick - rises[0] for tick in rises] == [800 * i for i in range(999)]
