"""Joints 3 and 4, which Timer2's interrupts step: what those take, and what comes between a pulse's two edges."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_board import (
    LEAD_TICKS,
    WAKE_TICKS,
    Board,
    EmulatedFirmware,
    Schedule,
    end_motion,
    run_of,
    segment_of,
)
from firmware_tracer import INTERRUPTS_ON, SCHEDULED_3, SCHEDULED_4, STEP_1, STEP_2, Tracer
from planarm_wire.messages import (
    BOARDS,
    EMERGENCY_CODE,
    HOLD_CODE,
    MIN_DIR_SETUP_TICKS,
    SLICE_TICKS,
    Config,
    Enable,
    Fault,
    Move,
    PinMap,
    Resume,
    Segment,
    Segments,
    Start,
    State,
    Status,
)

RELEASE = Path(__file__).parents[2] / "firmware" / "release"
FOUR = [name for name, board in BOARDS.items() if board.joints == 4]
PORTS = {"B": 0x25, "D": 0x2B}
TIMSK2 = 0x70
JUMP_TO_ITSELF = b"\xff\xcf"  # rjmp .-2
MOST_CYCLES = 110
# firmware/hal/uno/four_joints/scheduled.cpp
CYCLES = {
    (2, "rise"): {61},
    (3, "rise"): {63},
    (2, "look"): {58},
    (3, "look"): {59},
    (2, "on"): {106, 86},
    (3, "on"): {105, 84},
    (2, "back"): {107},
    (3, "back"): {104},
    (2, "idle"): {67},
    (3, "idle"): {64},
}
MISSED_CYCLES = {
    name: dict(zip(itertools.product(range(4), ("rise", "back")), cycles, strict=True))
    for name, cycles in {
        "uno_four": (94, 94, 96, 96, 67, 103, 67, 99),
        "cnc_shield_four": (103, 107, 105, 109, 67, 103, 67, 99),
    }.items()
}
MOST_LOCKED_CYCLES = 20  # of the main program while a joint steps, with the instruction behind
WATCH_STOP_INPUT = 4  # a bit of CONFIG's options
FAULTS = {"line": Fault.EMERGENCY_STOP, "stop input": Fault.STOP_INPUT, "fault": Fault.BAD_SEGMENT}


def place_of(pin: str) -> tuple[int, int]:
    """Address and bit of the port that drives a pin."""
    number = int(pin.removeprefix("D"))
    return (PORTS["D"], number) if number < 8 else (PORTS["B"], number - 8)


class Watcher(Tracer):
    """Notes of each of Timer2's interrupts the joint, what it has done, and its cycles."""

    def __init__(self, name: str) -> None:
        super().__init__(RELEASE / f"{name}.hex", BOARDS[name])
        self.paths: list[tuple[int, str, int]] = []
        self.quickly = False

    def run(self, ticks: int) -> None:
        if self.quickly:
            EmulatedFirmware.run(self, ticks)
        else:
            super().run(ticks)

    def hold_up(self, ticks: int) -> None:
        """Let time pass without interrupts and without the main program."""
        self.run_until(lambda: bool(self.chip.sreg & INTERRUPTS_ON))
        chip, flash = self.chip, self.uno.flash
        place, sreg = chip.pc, chip.sreg
        chip.pc = next(at for at in range(len(flash) // 2) if flash[2 * at : 2 * at + 2] == JUMP_TO_ITSELF)
        chip.sreg = sreg & ~INTERRUPTS_ON
        chip.run_to(chip.cycle + ticks)
        chip.pc, chip.sreg = place, sreg

    def _step(self) -> None:
        known, before = len(self.done), self._levels()
        super()._step()
        for vector, cycles in self.done[known:]:
            if vector in (SCHEDULED_3, SCHEDULED_4):
                joint = 2 + (vector == SCHEDULED_4)
                self.paths.append((joint, self._what(joint, before, self._levels()), cycles))

    def _levels(self) -> dict[str, int]:
        levels = {
            pin: self._byte(port) >> bit & 1
            for pin in (*self.wiring.step_pins[2:], *self.wiring.dir_pins[2:])
            for port, bit in (place_of(pin),)
        }
        return levels | {"on": self._byte(TIMSK2)}

    def _byte(self, address: int) -> int:
        (value,) = self.chip.peek_data(range(address, address + 1))
        return int(value)

    def _what(self, joint: int, before: dict[str, int], after: dict[str, int]) -> str:
        step, turn = self.wiring.step_pins[joint], self.wiring.dir_pins[joint]
        if after[step] > before[step]:
            return "rise"
        fell, turned, ended = (after[key] != before[key] for key in (step, turn, "on"))
        if ended:
            return "idle" if fell and not turned else "missed"
        return "look" if not fell else "back" if turned else "on"


def ready(firmware: EmulatedFirmware, segments: list[Segment]) -> Board:
    """A board whose queue holds a motion."""
    board = Board(firmware)
    board.get_ready()
    for segment in segments:
        board.ask(Segments(0, 0, 0, (segment,)))
    return board


@pytest.mark.parametrize("name", FOUR)
def test_cycles_of_the_scheduled_interrupts_on_every_path(name: str) -> None:
    def both(positive: bool, first: int, later: int) -> Segment:
        move, other = (run_of(20, first=at, interval=2500, positive=positive) for at in (first, first + later))
        return segment_of(60_000, run_of(0), run_of(0), move, other, joints=4)

    def slow(positive: bool) -> Segment:
        moves = [run_of(3, first=9000, interval=20_000, positive=positive)] * 2
        return segment_of(60_000, run_of(0), run_of(0), *moves, joints=4)

    motion = [both(True, 2500, 0), both(False, 2500, 0), both(True, 2500, 900), both(False, 2500, 900)]
    watcher = Watcher(name)
    watcher.quickly = True
    board = ready(watcher, end_motion([*motion, slow(False), slow(True)]))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS - 4000)
    watcher.quickly = False
    board.run(450_000)
    found = {
        (joint, path): {c for j, p, c in watcher.paths if (j, p) == (joint, path)} for joint, path, _ in watcher.paths
    }
    assert found == CYCLES
    assert max(max(cycles) for cycles in found.values()) <= MOST_CYCLES
    status = board.ask()
    assert (status.fault, status.ledger.position_usteps) == (Fault.NONE, (0,) * 4)


@pytest.mark.parametrize("joint", [2, 3])
def test_steps_of_a_joint_alone_keep_their_distance_to_their_ticks(joint: int) -> None:
    """With fractions that carry at nearly every step, in the interval and in its change; joint 1 tells when."""
    steps, begin = 55, run_of(1, first=500)
    move = Move(2 * steps + 1, 1500, (1000 << 8) + 255, 127)
    motion = end_motion([segment_of(72_000, *[begin, *[run_of(0)] * (joint - 1), move], joints=4)] * 3)
    board = ready(EmulatedFirmware(RELEASE / "uno_four.hex", BOARDS["uno_four"]), motion)
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 300_000)
    schedule = Schedule.of(motion)
    begun = board.rises(0)[0] - schedule.steps[0][0][0]
    off = [rise - begun - tick for rise, (tick, _) in zip(board.rises(joint), schedule.steps[joint], strict=True)]
    assert min(off) >= -161
    assert max(off) <= -93 + MOST_LOCKED_CYCLES


def there_and_back(joint: int) -> list[Segment]:
    """Twenty steps of a joint, and after 12,500 ticks as many back."""
    segments = []
    for positive in (True, False):
        moves = [run_of(20 * (joint == mover), first=2500, interval=2500, positive=positive) for mover in range(4)]
        segments.append(segment_of(60_000, *moves, joints=4))
    return end_motion(segments)


@pytest.mark.parametrize("joint", [0, 1, 2, 3])
@pytest.mark.parametrize("path", ["rise", "back"])
@pytest.mark.parametrize("name", FOUR)
def test_cycles_of_a_missed_step(name: str, path: str, joint: int) -> None:
    """Nothing runs around a step until it is too late for it, or for the next one, or too little is left to turn."""

    watcher = Watcher(name)
    watcher.quickly = True
    board = ready(watcher, there_and_back(joint))
    board.send(Start(LEAD_TICKS))
    # Joints 1 and 2 rise on their tick: their interrupt is to find the next step too near.
    made, wait, hold = {
        ("rise", True): (19, 1000, 2000),
        ("back", True): (20, 0, 12_300),
        ("rise", False): (10, 1000, 4000),
        ("back", False): (19, 2380, 12_400),
    }[path, joint > 1]
    while len(board.rises(joint)) < made:
        board.run(50)
    board.run(wait)
    watcher.quickly = False
    watcher.hold_up(hold)
    board.run(2000)
    vector = (STEP_1, STEP_2, SCHEDULED_3, SCHEDULED_4)[joint]
    *_, cycles = (cycles for number, cycles in watcher.done if number == vector)
    assert cycles == MISSED_CYCLES[name][joint, path]
    assert cycles <= MOST_CYCLES
    watcher.quickly = True
    status = board.ask()
    assert status.fault is Fault.MISSED_DEADLINE
    assert status.ledger.position_usteps[joint] == len(board.rises(joint))


@pytest.mark.parametrize("joint", [2, 3])
def test_a_step_is_made_within_12_us_or_not_at_all(joint: int) -> None:
    """Joint 1, on a compare output, has the same steps, so it tells the tick; nothing runs around one of them."""
    steps, interval = 19, 2500
    moves = [run_of(steps * (mover in (0, joint)), first=interval, interval=interval) for mover in range(4)]
    watcher = Watcher("uno_four")
    watcher.quickly = True
    board = ready(watcher, end_motion([segment_of(50_000, *moves, joints=4)]))
    board.send(Start(LEAD_TICKS))
    while len(board.rises(joint)) < 5:
        board.run(50)
    board.run(1000)
    started, seq, edges = watcher.uno.snapshot(), board.seq, tuple(board.edges)
    latest, faults = 0, set()
    for held in range(900, 2000, 7):
        watcher.uno.restore(started)
        board.forget_replies()
        board.seq, board.edges[:] = seq, edges
        watcher.hold_up(held)
        board.run(steps * interval + 60_000)
        faults.add(board.ask().fault)
        off = [rise - tick for rise, tick in zip(board.rises(joint), board.rises(0), strict=False)]
        latest = max(latest, *off)
    assert faults == {Fault.NONE, Fault.MISSED_DEADLINE}
    assert 192 - 7 - 4 <= latest <= 192


@pytest.mark.parametrize("joint", [2, 3])
@pytest.mark.parametrize("name", FOUR)
def test_a_turn_keeps_the_drivers_setup_time_or_is_missed(name: str, joint: int) -> None:
    """Nothing runs from the last step before a turn on until little is left to the first one back."""
    watcher = Watcher(name)
    watcher.quickly = True
    board = ready(watcher, there_and_back(joint))
    board.send(Start(LEAD_TICKS))
    while len(board.rises(joint)) < 20:
        board.run(50)
    started, seq, edges = watcher.uno.snapshot(), board.seq, tuple(board.edges)
    setups, faults = set(), set()
    for held in range(11_800, 12_400, 7):
        watcher.uno.restore(started)
        board.forget_replies()
        board.seq, board.edges[:] = seq, edges
        watcher.hold_up(held)
        board.run(120_000)
        faults.add(board.ask().fault)
        (turn,) = (edge.tick for edge in board.edges[len(edges) :] if edge.pin == board.wiring.dir_pins[joint])
        setups.update(rise - turn for rise in board.rises(joint)[20:21])
    assert faults == {Fault.NONE, Fault.MISSED_DEADLINE}
    assert min(setups) >= MIN_DIR_SETUP_TICKS


def moving(firmware: EmulatedFirmware, intervals: tuple[int, ...], options: int = 0, last: int = 0) -> Board:
    """A board in motion, every joint at its interval, slow enough to stop dead; no pulse is high."""
    wiring, uno, board = firmware.wiring, firmware.uno, Board(firmware)
    uno.pin(wiring.stop_pin).drive(0)
    board.hello()
    board.ask(Config(PinMap[wiring.pin_map.upper()], 4, 0, options, 0, 0, 0, (1000,) * 4))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    moves = [run_of(8 * SLICE_TICKS // each - 1, first=2500, interval=each) for each in intervals]
    segment = segment_of(8 * SLICE_TICKS, *moves, joints=4)
    for one in end_motion([segment] * last) if last else [segment] * 6:
        board.ask(Segments(200, 200, 1, (one,)))
    board.ask(Start(LEAD_TICKS))
    board.run(300_000)
    while any(uno.pin(pin).level for pin in wiring.step_pins):  # from here on every pulse has both edges
        board.run(1)
    return board


def pulses(board: Board, joint: int) -> list[tuple[int, int]]:
    """Rise and fall of each pulse; none is left high, each is long enough for a driver."""
    ticks = [edge.tick for edge in board.edges if edge.pin == board.wiring.step_pins[joint]]
    made = list(zip(ticks[::2], ticks[1::2], strict=True))
    assert all(fall - rise >= board.wiring.min_step_high_ticks for rise, fall in made)
    return made


def assert_counted(board: Board, made_before: tuple[int, ...], status: Status) -> None:
    """The ledger tells what the pins have made."""
    made = tuple(before + len(pulses(board, joint)) for joint, before in enumerate(made_before))
    assert status.ledger.position_usteps == made


@pytest.mark.parametrize("cause", FAULTS)
@pytest.mark.parametrize("name", FOUR)
def test_an_end_between_the_edges_of_a_pulse(name: str, cause: str, sized: Callable[[int, int], int]) -> None:
    interval = 2003
    board = moving(
        EmulatedFirmware(RELEASE / f"{name}.hex", BOARDS[name]), (2000, 2001, interval, 2005), WATCH_STOP_INPUT
    )
    uno = board._firmware.uno
    started, seq = uno.snapshot(), board.seq
    before = tuple(board.position_at(joint, board.now) for joint in range(4))
    ended = [0] * 4
    # The main program does what it does in passes: those of a whole slice.
    for phase in range(0, SLICE_TICKS, sized(211, 53)) if cause == "fault" else range(0, interval, sized(11, 2)):
        uno.restore(started)
        board.edges.clear()
        board.forget_replies()
        board.seq = seq
        board.run(phase)
        if cause == "stop input":
            uno.pin(board.wiring.stop_pin).drive(1)
            stopped = board.now
        elif cause == "line":
            board.receive(bytes([EMERGENCY_CODE] * 3))
            stopped = board.now + 3 * 640
        else:
            board.send(Segments(0, 0, 0, (segment_of(0, joints=4),)))
            stopped = board.now + 100_000
        board.run(60_000)
        for joint in range(4):
            made = pulses(board, joint)
            ended[joint] += bool(made) and made[-1][1] > stopped
            assert not made or made[-1][1] <= stopped + 480, "30 us"
        status = board.ask()
        assert status.fault is FAULTS[cause]
        if cause == "fault":
            assert_counted(board, before, status)
    assert cause == "fault" or all(ended), "pulses that the stop has found high"


@pytest.mark.parametrize("name", FOUR)
def test_a_step_missed_between_the_edges_of_a_pulse(name: str, sized: Callable[[int, int], int]) -> None:
    """Joint 1 misses a step right behind a rise of joint 3 or 4, whose interrupt comes first."""
    tracer = Watcher(name)
    tracer.quickly = True
    board = moving(tracer, (1300, 30_000, 8000, 8003))
    started, seq = tracer.uno.snapshot(), board.seq
    before = tuple(board.position_at(joint, board.now) for joint in range(4))
    ended = [0] * 4
    for phase in range(0, 8000, sized(40, 13)):
        tracer.uno.restore(started)
        board.edges.clear()
        board.forget_replies()
        board.seq = seq
        board.run(phase)
        tracer.hold_up(2700)
        resumed = board.now
        board.run(40_000)
        status = board.ask()
        assert status.fault is Fault.MISSED_DEADLINE
        assert_counted(board, before, status)
        for joint in (2, 3):
            highs = [fall - rise for rise, fall in pulses(board, joint) if rise >= resumed]
            assert all(high < 240 for high in highs), "ended by the interrupt that has found joint 1's step missed"
            ended[joint] += len(highs)
    assert ended[2] and ended[3], "pulses that the missed step has ended"


@pytest.mark.parametrize("name", FOUR)
def test_a_step_missed_at_any_instruction_of_a_pass(name: str) -> None:
    """Joint 1 misses a step; the main program must not take another joint, which it finds off, for one at rest."""
    tracer = Watcher(name)
    tracer.quickly = True
    board = moving(tracer, (1300, 30_000, 8000, 8003))
    chip = tracer.chip
    while True:  # to a short pass: it hands over no runs
        tracer.run_until(tracer.begins_pass)
        begun = tracer.uno.snapshot()
        at = chip.cycle
        chip.run_to(at + 1)
        tracer.run_until(tracer.begins_pass)
        if chip.cycle - at < 1500:
            break
    seq, edges = board.seq, tuple(board.edges)
    for instruction in range(400):
        tracer.uno.restore(begun)
        board.forget_replies()
        board.seq, board.edges[:] = seq, edges
        for _ in range(instruction):
            chip.run_to(chip.cycle + 1)
        tracer.hold_up(2700)
        board.run(40_000)
        status = board.ask()
        assert status.fault is Fault.MISSED_DEADLINE
        assert status.ledger.position_usteps == tuple(board.position_at(joint, board.now) for joint in range(4))


@pytest.mark.parametrize("name", FOUR)
def test_a_hold_at_any_moment_between_two_steps_loses_none(name: str, sized: Callable[[int, int], int]) -> None:
    interval = 6007
    board = moving(EmulatedFirmware(RELEASE / f"{name}.hex", BOARDS[name]), (6000, 6003, interval, 6011), last=2)
    uno = board._firmware.uno
    started, seq = uno.snapshot(), board.seq
    before = tuple(board.position_at(joint, board.now) for joint in range(4))
    for phase in range(0, SLICE_TICKS, sized(311, 53)):
        uno.restore(started)
        board.edges.clear()
        board.forget_replies()
        board.seq = seq
        board.run(phase)
        board.receive(bytes([HOLD_CODE]))
        board.run(30_000)
        held = board.ask_now()
        assert held.state is State.HELD
        assert_counted(board, before, held)
        board.send(Resume())
        board.run(3 * 8 * SLICE_TICKS)
        status = board.ask_now()
        assert (status.state, status.fault) == (State.READY, Fault.NONE)
        assert_counted(board, before, status)
        assert status.ledger.position_usteps == tuple(
            2 * (8 * SLICE_TICKS // each - 1) for each in (6000, 6003, interval, 6011)
        )
