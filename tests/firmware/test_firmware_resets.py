"""What outlives a reset: why the chip started, whether the drivers were enabled, and how often the EEPROM is written.

ATmega328P datasheet, 11.9.1 (MCUSR) and 11.8 (watchdog). The stock boot loader clears MCUSR before it starts a program,
so every cause is tried with the register as the chip leaves it and with nothing in it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_board import LEAD_TICKS, WAKE_TICKS, Board, EmulatedFirmware, end_motion, run_of, segment_of
from planarm_sim.cpu import layout as at
from planarm_sim.cpu import registers as reg
from planarm_sim.cpu.values import ResetCause
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import (
    BOARDS,
    EMERGENCY_CODE,
    EMERGENCY_REPEATS,
    ENABLE_PIN,
    JOINTS,
    STEP_PINS,
    TICKS_HZ,
    WATCHDOG_MS,
    Clear,
    Config,
    Enable,
    PinMap,
    Reset,
    Result,
    Segments,
    Start,
    State,
    Welcome,
)
from sim_board.optiboot import build_optiboot

BOOT_CYCLES = 600_000
BOOT_LOADER_CYCLES = 2 * 16_000_000
BYTE_CYCLES = 640
IMAGE = Path(__file__).parents[2] / "firmware" / "release" / "uno.hex"
WRITE_CYCLES = 54_400  # 3.4 ms a byte
MARK_CYCLES = 4 * WRITE_CYCLES
WDIE, WDE, WDP2 = 1 << 6, 1 << 3, 1 << 2  # WDTCSR
JUMP_TO_ITSELF = b"\xff\xcf"  # rjmp .-2
RECORD_BYTES, RECORDS = 4, 128
CELL_WRITES = 100_000  # ATmega328P datasheet, 8.1


def reset_and_ask(firmware: EmulatedFirmware, board: Board, cause: ResetCause, *, hidden: bool) -> Welcome:
    """Reset the chip, with its causes cleared as a boot loader does, and open a session."""
    board.forget_replies()
    firmware.uno.serial.read()
    firmware.uno.reset(cause)
    if hidden:
        firmware.uno._chip._state[reg.MCUSR] = 0
    board.run(BOOT_CYCLES)
    board.forget_replies()  # the reset may have cut one short
    return board.hello()


@pytest.mark.parametrize(
    ("cause", "shown", "behind_a_boot_loader"),
    [
        (ResetCause.POWER_ON, Reset.POWER_ON, Reset.POWER_ON),
        (ResetCause.EXTERNAL, Reset.EXTERNAL, Reset.UNKNOWN),
        (ResetCause.BROWN_OUT, Reset.BROWN_OUT, Reset.UNKNOWN),
    ],
)
def test_why_the_chip_started(
    emulated_firmware: EmulatedFirmware, cause: ResetCause, shown: Reset, behind_a_boot_loader: Reset
) -> None:
    board = Board(emulated_firmware)
    assert reset_and_ask(emulated_firmware, board, cause, hidden=False).reset_cause is shown
    assert reset_and_ask(emulated_firmware, board, cause, hidden=True).reset_cause is behind_a_boot_loader


@pytest.fixture(scope="module")
def behind_optiboot(tmp_path_factory: pytest.TempPathFactory) -> EmulatedFirmware:
    return EmulatedFirmware(IMAGE, bootloader=build_optiboot(tmp_path_factory.mktemp("optiboot")))


@pytest.mark.parametrize(
    ("cause", "told"),
    [
        (ResetCause.POWER_ON, Reset.POWER_ON),
        (ResetCause.EXTERNAL, Reset.UNKNOWN),
        (ResetCause.BROWN_OUT, Reset.UNKNOWN),
    ],
)
def test_why_the_chip_started_behind_the_stock_boot_loader(
    behind_optiboot: EmulatedFirmware, cause: ResetCause, told: Reset
) -> None:
    # After an external reset it waits for an upload for about a second, and starts the program by its own watchdog.
    board = Board(behind_optiboot)
    board.get_ready()
    behind_optiboot.uno.reset(cause)
    board.forget_replies()
    board.run(BOOT_LOADER_CYCLES if cause is ResetCause.EXTERNAL else BOOT_CYCLES)
    board.forget_replies()
    welcome = board.hello()
    assert (welcome.reset_cause, welcome.interrupted) == (told, 1)


def stand_still(firmware: EmulatedFirmware, *, interrupts: bool) -> None:
    """Let the main program do nothing any more, with interrupts on or off."""
    chip, code = firmware.uno._chip, firmware.uno.flash
    chip.pc = next(word for word in range(len(code) // 2) if code[2 * word : 2 * word + 2] == JUMP_TO_ITSELF)
    chip.sreg = chip.sreg & 0x7F | interrupts << 7  # a lock or an interrupt may have them off just now


INTERRUPTS = pytest.mark.parametrize("interrupts", [True, False], ids=["interrupts on", "interrupts off"])


@INTERRUPTS
def test_the_watchdogs_reset_is_told_behind_the_stock_boot_loader(
    behind_optiboot: EmulatedFirmware, interrupts: bool
) -> None:
    # With interrupts off the one that leaves a mark in memory cannot come, and the boot loader clears MCUSR.
    board = Board(behind_optiboot)
    board.get_ready()
    stand_still(behind_optiboot, interrupts=interrupts)
    board.run(3 * WATCHDOG_MS * TICKS_HZ // 1000)
    board.forget_replies()
    welcome = board.hello()
    assert (welcome.reset_cause, welcome.interrupted) == (Reset.WATCHDOG if interrupts else Reset.UNKNOWN, 1)


def run_to_release(firmware: EmulatedFirmware) -> None:
    """Run to the very cycle in which the drivers are released, within a second."""
    uno = firmware.uno
    begin = uno.cycle
    while True:
        before = uno.snapshot()
        uno.clear_edges()
        uno.run(cycles=20_000)
        released = [int(cycle) for cycle, level in uno.edges(ENABLE_PIN) if level]
        if released:
            uno.restore(before)
            uno.run(cycles=released[0] - uno.cycle)
            return
        assert uno.cycle - begin < TICKS_HZ, "no watchdog"


@INTERRUPTS
@pytest.mark.parametrize("hidden", [False, True], ids=["MCUSR as it is", "MCUSR cleared"])
def test_a_main_program_that_stands_still_is_reset(
    emulated_firmware: EmulatedFirmware, hidden: bool, interrupts: bool
) -> None:
    # In the middle of a motion; the ledger begins anew, and the mark in EEPROM tells that the drivers were enabled.
    board = Board(emulated_firmware)
    board.get_ready()
    for segment in end_motion([segment_of(96_000, run_of(299, first=0, interval=320))] * 20):
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(300_000)
    assert board.ask_now().ledger.position_usteps[0] > 0
    chip = emulated_firmware.uno._chip
    stand_still(emulated_firmware, interrupts=interrupts)
    stood_from = board.now
    run_to_release(emulated_firmware)
    # The watchdog's oscillator may be 10 % off; the main program had fed it less than a pass before.
    assert (board.now - stood_from) / TICKS_HZ == pytest.approx(2 * WATCHDOG_MS / 1000, rel=0.15)
    assert chip._state[reg.MCUSR] == ResetCause.WATCHDOG
    if hidden:
        chip._state[reg.MCUSR] = 0
    board.run(BOOT_CYCLES)
    board.forget_replies()
    welcome = board.hello()
    told = Reset.WATCHDOG if interrupts or not hidden else Reset.UNKNOWN
    assert (welcome.reset_cause, welcome.interrupted) == (told, 1)
    status = board.ask()
    assert (status.state, status.ledger.position_usteps, status.ledger.executed_segments) == (State.IDLE, (0, 0), 0)


@pytest.mark.parametrize("board", BOARDS)
@pytest.mark.parametrize("cause", [ResetCause.POWER_ON, ResetCause.EXTERNAL, ResetCause.WATCHDOG])
def test_the_watchdog_is_on_from_start_up_on(board: str, cause: ResetCause) -> None:
    # Within 5 us of the reset, before memory is set up. All of start-up, 17 ms with the journal, fits in its 250 ms.
    firmware = EmulatedFirmware(IMAGE.with_name(f"{board}.hex"), BOARDS[board])
    uno, chip = firmware.uno, firmware.uno._chip
    uno.reset(cause)
    uno.run(cycles=80)
    for _ in range(BOOT_CYCLES // 2000):
        assert chip._state[reg.WDTCSR] == WDIE | WDE | WDP2
        uno.run(cycles=2000)


@pytest.mark.parametrize("after_cycles", [5_000, 100_000, 250_000], ids=["memory", "journal read", "journal written"])
def test_a_start_up_that_stands_still_is_reset(emulated_firmware: EmulatedFirmware, after_cycles: int) -> None:
    board = Board(emulated_firmware)
    emulated_firmware.uno.reset(ResetCause.EXTERNAL)
    board.run(after_cycles)
    stand_still(emulated_firmware, interrupts=False)
    board.run(2 * WATCHDOG_MS * TICKS_HZ // 1000 + BOOT_CYCLES)
    board.forget_replies()
    assert board.hello().reset_cause is Reset.WATCHDOG


def test_a_watchdog_reset_is_told_once(emulated_firmware: EmulatedFirmware) -> None:
    board = Board(emulated_firmware)
    assert reset_and_ask(emulated_firmware, board, ResetCause.WATCHDOG, hidden=False).reset_cause is Reset.WATCHDOG
    assert reset_and_ask(emulated_firmware, board, ResetCause.EXTERNAL, hidden=True).reset_cause is Reset.UNKNOWN


@pytest.mark.parametrize(
    ("orders", "interrupted"),
    [([], 0), ([1], 1), ([1, 0], 0), ([1, 0, 1], 1)],
    ids=["never enabled", "enabled", "released again", "enabled again"],
)
def test_drivers_that_were_enabled_are_told_after_a_reset(
    emulated_firmware: EmulatedFirmware, orders: list[int], interrupted: int
) -> None:
    board = Board(emulated_firmware)
    board.hello()
    for on in orders:
        board.ask(Enable(on))
        board.run(WAKE_TICKS)
    welcome = reset_and_ask(emulated_firmware, board, ResetCause.EXTERNAL, hidden=True)
    assert welcome.interrupted == interrupted
    again = reset_and_ask(emulated_firmware, board, ResetCause.EXTERNAL, hidden=True)
    assert again.interrupted == 0, "this boot enabled nothing"


@pytest.mark.parametrize("behind", ["nothing", "RELEASE", "CLEAR"])
def test_no_step_is_made_before_the_mark_is_written(emulated_firmware: EmulatedFirmware, behind: str) -> None:
    # ENABLE, segments and START in one go, with the shortest lead; resets around the first step. RELEASE, and CLEAR
    # after an emergency stop, leave a mark of their own, which is still being written when ENABLE comes.
    board = Board(emulated_firmware)
    board.hello()
    if behind != "nothing":
        board.ask(Enable(1))
        board.run(WAKE_TICKS)
    if behind == "CLEAR":
        board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
        board.run(40_000)
        board.ask()
    uno = emulated_firmware.uno
    uno.clear_edges()
    if behind != "nothing":
        board.send(Enable(0) if behind == "RELEASE" else Clear())
        board.run(14_000)
    for message in (Enable(1), Segments(0, 0, 0, (segment_of(400_000, run_of(200), last=True),)), Start(LEAD_TICKS)):
        board.send(message)
    board.run(60_000)
    started = uno.snapshot()
    board.run(WAKE_TICKS)
    first = board.rises(0)[0]
    for moment in (first - 200, first + 10):
        uno.restore(started)
        uno.run(cycles=moment - uno.cycle)
        assert bool(uno.edges(STEP_PINS[0])["level"].any()) is (moment > first)
        welcome = reset_and_ask(emulated_firmware, board, ResetCause.EXTERNAL, hidden=True)
        assert welcome.interrupted == 1


def test_a_reset_while_the_mark_is_written_leaves_the_old_one_or_the_new(emulated_firmware: EmulatedFirmware) -> None:
    board = Board(emulated_firmware)
    board.hello()
    board.ask()
    uno = emulated_firmware.uno
    idle, seq = uno.snapshot(), board.seq
    nonces, told = set(), []
    moments = range(2_000, 320_000, 13_700)
    for moment in moments:
        uno.restore(idle)
        board.send(Enable(1), seq=seq)
        uno.run(cycles=moment)
        welcome = reset_and_ask(emulated_firmware, board, ResetCause.EXTERNAL, hidden=True)
        told.append(welcome.interrupted)
        nonces.add((welcome.boot_nonce, welcome.interrupted))
    assert told == sorted(told) and set(told) == {0, 1}, "from some moment on the mark stands"
    assert told[-1] == 1 and told.index(1) * 13_700 < MARK_CYCLES + 60_000
    assert len({nonce for nonce, _ in nonces}) <= 2, "the count goes on by one or by two"


def run_and_note_writes(firmware: EmulatedFirmware, board: Board, ticks: int, writes: dict[int, int]) -> None:
    """Let time pass; `writes` is where each of the EEPROM's writes goes, told by the cycle in which it ends."""
    state = firmware.uno._chip._state
    end = board.now + ticks
    while board.now < end:
        board.run(WRITE_CYCLES // 4)
        if state[at.DUE_EEPROM] != at.NEVER:
            writes[int(state[at.DUE_EEPROM])] = int(state[at.EE_BUSY_ADDRESS])


@pytest.mark.parametrize("wait_ms", [21, 5, 6.5, 8], ids=["written", "5 ms", "6.5 ms", "8 ms"])
def test_marks_wander_through_the_eeprom(
    emulated_firmware: EmulatedFirmware, wait_ms: float, sized: Callable[[int, int], int]
) -> None:
    # Enabled and released again and again, the marks written or overtaken by the next while they are: no cell is
    # written more often than once a round of all records.
    board = Board(emulated_firmware)
    board.hello()
    writes: dict[int, int] = {}
    orders = sized(2 * RECORDS, 4 * RECORDS)
    for turn in range(orders):
        board.send(Enable((turn + 1) % 2))
        run_and_note_writes(emulated_firmware, board, round(wait_ms * TICKS_HZ / 1000), writes)
    assert len(writes) >= orders
    assert max(Counter(writes.values()).values()) <= orders // RECORDS
    assert RECORDS * CELL_WRITES == 12_800_000, "what hal/uno/journal.h tells"


def test_an_overtaken_mark_never_counts(emulated_firmware: EmulatedFirmware) -> None:
    # RELEASE, and ENABLE 5 to 6.7 ms behind it: two bytes of the mark in between are written. A reset while the next
    # one is written, or after it, tells that the drivers were enabled, and no number of a boot comes twice, for some
    # rounds of all records.
    board = Board(emulated_firmware)
    board.hello()
    nonces = []
    for boot in range(80):
        board.send(Enable(1))
        board.run(WAKE_TICKS)
        board.send(Enable(0))
        board.run(80_000 + boot * 7_919 % 27_000)
        board.send(Enable(1))
        board.run(6_000 + boot * 10_007 % 260_000)
        welcome = reset_and_ask(emulated_firmware, board, ResetCause.EXTERNAL, hidden=True)
        assert welcome.interrupted == 1, boot
        nonces.append(welcome.boot_nonce)
    assert len(set(nonces)) == len(nonces)


def test_what_a_boot_loader_left_in_timer_0_is_no_byte(emulated_firmware: EmulatedFirmware) -> None:
    # The receive ring's indices and counts are in registers of timer 0, which a boot loader may have used.
    board = Board(emulated_firmware)
    uno = emulated_firmware.uno
    uno.reset()
    for address, value in ((reg.OCR0A, 5), (reg.OCR0B, 2), (reg.TCNT0, 9), (reg.GPIOR2, 77), (reg.TCCR0B, 1)):
        uno._chip.poke_data(address, bytes([value]))
    uno.run(cycles=BOOT_CYCLES)
    board.forget_replies()
    board.hello()
    status = board.ask()
    assert (status.overruns, status.crc_errors, status.ring_full) == (0, 0, 0)


def test_drivers_are_released_by_their_new_polarity_before_the_eeprom_is_ready(
    emulated_firmware: EmulatedFirmware,
) -> None:
    # CONFIG right behind RELEASE, whose mark is still being written: 3.4 ms a byte.
    board = Board(emulated_firmware)
    board.hello()
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    board.edges.clear()
    board.send(Enable(0))
    active_high = Config(PinMap.OWN, JOINTS, 0, 1, 0, 160_000, 0, (160_000,) * JOINTS)
    board.send(active_high)
    sent = board.now + (encoded_bytes(Enable(0)) + encoded_bytes(active_high)) * BYTE_CYCLES
    board.run(400_000)
    assert board.ask().refusal is Result.OK
    released, driven_low = [edge for edge in board.edges if edge.pin == ENABLE_PIN]
    assert (released.level, driven_low.level) == (1, 0)
    assert driven_low.tick - sent < 20_000
