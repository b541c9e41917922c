"""The images of the other boards on the emulated Uno: four joints, and the Arduino CNC shield."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_board import (
    LEAD_TICKS,
    WAKE_TICKS,
    Board,
    Delays,
    EmulatedFirmware,
    Schedule,
    end_motion,
    run_of,
    segment_of,
)
from firmware_motions import steady
from firmware_tracer import STEP_1, STEP_2, Tracer
from planarm_sim.cpu import registers as reg
from planarm_wire.codec import encode
from planarm_wire.framing import encode_frame
from planarm_wire.messages import (
    BOARDS,
    DEBOUNCE_TICKS,
    DELIMITER,
    EMERGENCY_CODE,
    HOLD_CODE,
    HOST_WINDOW_BYTES,
    MIN_DIR_SETUP_TICKS,
    MIN_HOMING_TICKS,
    SLICE_TICKS,
    TICKS_HZ,
    Config,
    Enable,
    Fault,
    Home,
    PinMap,
    Query,
    Result,
    Resume,
    Segment,
    Segments,
    Start,
    State,
    Status,
)

RELEASE = Path(__file__).parents[2] / "firmware" / "release"
OTHERS = ["uno_four", "uno_slow", "cnc_shield", "cnc_shield_four"]
FIFTEEN_K = TICKS_HZ // 15_000
# Largest distance of a rise from its tick: 0 on a compare output, 12 us of joints 3 and 4; on the shield what may run
# when a step of joint 1 or 2 is due. With four joints that is a receive interrupt (39), a lock (70, when a joint is
# started), both edges of joints 3 and 4 (336), the other joint (90) and the instructions between and before the rise
# (21): 556.
MOST_OFF_TICKS = {
    "uno_four": (0, 0, 192, 192),
    "uno_slow": (0, 0),
    "cnc_shield": (160, 160),
    "cnc_shield_four": (560, 560, 192, 192),
}
# The longest that STEP is high. With four joints what may run before joints 1 and 2's falls, at 64 cycles of their own:
# a receive interrupt (39), a lock when a joint is started (79), the other joint (83) and an instruction (2), both edges
# of joints 3 and 4 (344). Before joint 3's, which comes 93 to 125 after the rise by itself: joint 4's interrupt (105),
# the lock, and the instructions around it (4); before joint 4's joint 3's interrupt (107, and 2), too.
MOST_HIGH_TICKS = {
    "uno_four": (611, 611, 340, 422),
    "uno_slow": (240, 240),
    "cnc_shield": (56, 56),
    "cnc_shield_four": (56, 56, 340, 422),
}
WATCH_STOP_INPUT, WATCH_SWITCHES = 4, 8  # bits of CONFIG's options
# Of joints 1 and 2: every step, on in one direction, on and back, going idle.
STEP_CYCLES = {"uno_four": (83, 75, 77, 73), "cnc_shield": (84, 84, 90, 76), "cnc_shield_four": (84, 84, 90, 76)}


class Scheduled(EmulatedFirmware):
    """The emulated board; notes for which cycle the chip has scheduled the first step of joints 1 and 2."""

    LOOK_TICKS = 4000  # a joint at rest is started earlier than that before its step

    def power_on(self, boot_count: int, tick: int, delays: Delays) -> None:
        super().power_on(boot_count, tick, delays)
        self.first_at: dict[int, int] = {}
        self._timer_from = self.uno.cycle - self._word(reg.TCNT1L)  # while no instruction looks at the timer

    def run(self, ticks: int) -> None:
        end = self.uno.cycle + ticks
        while len(self.first_at) < 2 and end > self.uno.cycle + self.LOOK_TICKS:
            super().run(self.LOOK_TICKS)
            self._look()
        super().run(end - self.uno.cycle)
        self._look()

    def _look(self) -> None:
        chip = self.uno._chip
        (on,) = chip.peek_data(range(reg.TIMSK1, reg.TIMSK1 + 1))
        for joint, (mask, compare) in enumerate(((2, reg.OCR1AL), (4, reg.OCR1BL))):
            if on & mask and joint not in self.first_at:
                self.first_at[joint] = chip.cycle + (self._timer_from + self._word(compare) - chip.cycle) % 65_536

    def _word(self, address: int) -> int:
        return int.from_bytes(self.uno._chip.peek_data(range(address, address + 2)), "little")


def emulated(name: str) -> Scheduled:
    return Scheduled(RELEASE / f"{name}.hex", BOARDS[name])


def restless(name: str, seed: int, count: int) -> list[Segment]:
    """Joints that turn round, rest, crawl and run, each for itself."""
    board, chance = BOARDS[name], random.Random(seed)
    segments = []
    for _ in range(count):
        moves = []
        for _ in range(board.joints):
            interval = chance.choice([board.min_interval_ticks + 20, 1500, 4000, 20_000, 50_000])
            steps = chance.randint(0, (200_000 - 3000) // interval)
            moves.append(run_of(steps, first=1500, interval=interval, positive=chance.random() < 0.5))
        segments.append(segment_of(200_000, *moves, joints=board.joints))
    return end_motion(segments)


def assert_near_schedule(board: Board, name: str, motion: list[Segment], status: Status) -> None:
    """No fault, every step made, none farther from its tick than allowed, every driver's rule kept."""
    assert (status.state, status.fault, status.overruns) == (State.READY, Fault.NONE, 0)
    schedule, wiring = Schedule.of(motion), board.wiring
    assert status.ledger.position_usteps == schedule.positions()
    assert isinstance(board._firmware, Scheduled)
    begin, and_again = (at - schedule.steps[joint][0][0] for joint, at in sorted(board._firmware.first_at.items()))
    assert begin == and_again, "of both joints with a timer's compare unit"
    for joint, steps in enumerate(schedule.steps):
        rises = board.rises(joint)
        off = [rise - begin - tick for rise, (tick, _) in zip(rises, steps, strict=True)]
        assert max(map(abs, off)) <= MOST_OFF_TICKS[name][joint], f"joint {joint + 1}: {min(off)} to {max(off)}"
        assert board.position_at(joint, board.now) == schedule.positions()[joint], "by the pins"
        edges = [edge for edge in board.edges if edge.pin == wiring.step_pins[joint]]
        for earlier, later in itertools.pairwise(edges):
            away = later.tick - earlier.tick
            assert away >= (wiring.min_step_high_ticks if earlier.level else wiring.min_step_low_ticks), f"{joint + 1}"
            assert not earlier.level or away <= MOST_HIGH_TICKS[name][joint], f"joint {joint + 1}: {away} high"
        turns = [edge.tick for edge in board.edges if edge.pin == wiring.dir_pins[joint]]
        for edge in edges:
            away = [abs(edge.tick - turn) for turn in turns if edge.level and turn <= edge.tick]
            assert not away or min(away) >= MIN_DIR_SETUP_TICKS, f"joint {joint + 1}"


@pytest.mark.parametrize("name", OTHERS)
def test_pins_are_quiet_from_reset_on(name: str) -> None:
    wiring = BOARDS[name]
    uno = emulated(name).uno
    uno.pin(wiring.enable_pin).drive(1)  # the pull-up
    uno.reset()
    uno.clear_edges()
    uno.run(cycles=600_000)
    assert len(uno.edges(wiring.enable_pin)) == 0
    uno.pin(wiring.enable_pin).drive(0)
    assert uno.pin(wiring.enable_pin).level == 1, "driven by the chip"
    assert [len(uno.edges(pin)) for pin in (*wiring.step_pins, *wiring.dir_pins)] == [0] * 2 * wiring.joints
    assert all(uno.pin(pin).level == 1 for pin in (*wiring.limit_pins, wiring.stop_pin)), "pulled up"


@pytest.mark.parametrize("content", ["segments", "queries"])
@pytest.mark.parametrize("name", OTHERS)
def test_all_joints_at_their_rate_on_a_saturated_line(
    name: str, content: str, sized: Callable[[int, int], int]
) -> None:
    # Valid frames without a gap, for a quarter of a second or ten, at the board's least interval.
    interval = BOARDS[name].min_interval_ticks
    count = sized(8, 32 // BOARDS[name].joints)  # as many as the queue takes, none with too many steps
    duration = sized(8 * SLICE_TICKS, 10 * TICKS_HZ // count)
    motion = steady(name, interval, count * duration / TICKS_HZ, duration)
    firmware = emulated(name)
    board = Board(firmware)
    board.get_ready()
    for segment in motion:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    message = Query() if content == "queries" else Segments(0, 0, 0, (motion[0],))
    frame = encode_frame(board.seq - 1, *encode(message))
    end = board.now + LEAD_TICKS + len(motion) * duration + 100_000
    while board.now < end:
        while firmware.uno.serial.pending < HOST_WINDOW_BYTES:
            board.receive(frame)
        board.run(20_000)
    board.run(200_000)
    board.receive(bytes([DELIMITER]))
    assert_near_schedule(board, name, motion, board.ask())


def test_four_joints_at_15_000_steps_a_second() -> None:
    motion = steady("uno_four", FIFTEEN_K, 0.5)
    board = Board(emulated("uno_four"))
    board.get_ready()
    assert_near_schedule(board, "uno_four", motion, board.stream(motion))


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", OTHERS)
def test_a_random_motion_of_all_joints(name: str, seed: int) -> None:
    motion = restless(name, seed, 60)
    board = Board(emulated(name))
    board.get_ready()
    assert_near_schedule(board, name, motion, board.stream(motion))


@pytest.mark.parametrize("name", OTHERS)
def test_a_hold_rests_on_the_path_and_loses_nothing(name: str) -> None:
    motion = steady(name, 6000, 0.5)
    board = Board(emulated(name))
    joints = BOARDS[name].joints
    board.hello()
    board.ask(Config(PinMap[BOARDS[name].pin_map.upper()], joints, 0, 0, 0, 0, 0, (20_000,) * joints))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    for segment in motion[:8]:
        board.ask(Segments(200, 200, 1, (segment,)))
    board.ask(Start(LEAD_TICKS))
    board.run(400_000)
    board.receive(bytes([HOLD_CODE]))
    board.run(2_000_000)
    held = board.ask_now()
    assert held.state is State.HELD
    made = held.ledger.position_usteps
    assert made == tuple(board.position_at(joint, board.now) for joint in range(joints))
    board.send(Resume())
    board.run(20 * 8 * SLICE_TICKS)
    status = board.ask_now()
    assert status.fault is Fault.UNDERRUN, "the motion's last segment was not sent"
    assert status.ledger.position_usteps == Schedule.of(motion[:8]).positions()
    assert status.ledger.position_usteps == tuple(board.position_at(joint, board.now) for joint in range(joints))


@pytest.mark.parametrize("by_input", [False, True], ids=["line", "stop input"])
@pytest.mark.parametrize("name", OTHERS)
def test_an_emergency_stop_ends_all_pulses_and_cuts_none(name: str, by_input: bool) -> None:
    # At moments all over an interval, so that some are in the first ticks of each joint's pulse.
    interval, wiring = 2000, BOARDS[name]
    board = Board(emulated(name))
    uno = board._firmware.uno
    uno.pin(wiring.stop_pin).drive(0)
    board.hello()
    options = WATCH_STOP_INPUT if by_input else 0
    joints = wiring.joints
    board.ask(Config(PinMap[wiring.pin_map.upper()], joints, 0, options, 0, 0, 0, (20_000,) * joints))
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    for segment in steady(name, interval, 0.3)[:6]:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    board.run(300_000)
    while any(uno.pin(pin).level for pin in wiring.step_pins):  # from here on every pulse has both edges
        board.run(1)
    moving, seq = uno.snapshot(), board.seq
    stepping = set()
    for phase in range(0, interval, 11):
        uno.restore(moving)
        board.edges.clear()
        board.forget_replies()
        board.seq = seq
        board.run(phase)
        if by_input:
            uno.pin(wiring.stop_pin).drive(1)
            stopped = board.now
        else:
            board.receive(bytes([EMERGENCY_CODE] * 3))
            stopped = board.now + 3 * 640
        board.run(20_000)
        for pin in wiring.step_pins:
            ticks = [edge.tick for edge in board.edges if edge.pin == pin]
            if ticks:
                stepping.add(pin)
                assert ticks[-1] <= stopped + 480, "30 us"
            highs = [fall - rise for rise, fall in zip(ticks[::2], ticks[1::2], strict=True)]
            assert all(high >= wiring.min_step_high_ticks for high in highs), (pin, phase)
    assert stepping == set(wiring.step_pins)
    assert board.ask().fault is (Fault.STOP_INPUT if by_input else Fault.EMERGENCY_STOP)


@pytest.mark.parametrize("name", OTHERS)
def test_another_boards_wiring_is_refused(name: str) -> None:
    board = Board(emulated(name))
    board.hello()
    joints = BOARDS[name].joints
    own, high_ticks = PinMap[BOARDS[name].pin_map.upper()], BOARDS[name].min_step_high_ticks
    assert board.ask(Config(own, joints, 0, 0, 0, 0, high_ticks, (4000,) * joints)).refusal is Result.OK
    for other in set(PinMap) - {own}:
        assert board.ask(Config(other, joints, 0, 0, 0, 0, 0, (4000,) * joints)).refusal is Result.OUT_OF_RANGE
    told = board.ask(Config(own, joints, 0, 0, 0, 0, high_ticks + 1, (4000,) * joints))
    assert told.refusal is Result.OUT_OF_RANGE, "drivers that need longer pulses"


def test_a_step_too_late_of_a_scheduled_joint_stops_all_joints() -> None:
    motion = steady("uno_four", 1100, 0.2)
    tracer = Tracer(RELEASE / "uno_four.hex", BOARDS["uno_four"])
    board = Board(tracer)
    fast = super(Tracer, tracer).run
    tracer.run = fast  # type: ignore[method-assign]
    board.get_ready()
    for segment in motion[:4]:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 60_000)
    tracer.hold_interrupts(2500)
    board.run(200_000)
    status = board.ask()
    assert status.fault is Fault.MISSED_DEADLINE
    made = tuple(board.position_at(joint, board.now) for joint in range(4))
    assert status.ledger.position_usteps == made


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", STEP_CYCLES)
def test_cycles_of_the_step_interrupts(name: str, joint: int) -> None:
    def segment(positive: bool) -> Segment:
        moves = [run_of(0)] * joints
        moves[joint] = run_of(4, positive=positive, fraction=40_000, interval=1500)
        return segment_of(9000, *moves, joints=joints)

    joints = BOARDS[name].joints
    tracer = Tracer(RELEASE / f"{name}.hex", BOARDS[name])
    board = Board(tracer)
    fast = super(Tracer, tracer).run
    tracer.run = fast  # type: ignore[method-assign]
    board.get_ready()
    for part in end_motion([segment(True), segment(True), segment(False)]):
        board.ask(Segments(0, 0, 0, (part,)))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS - 1000)
    del tracer.run
    board.run(LEAD_TICKS + 30_000)
    step, onward, reversed_, idle = STEP_CYCLES[name]
    taken = [cycles for number, cycles in tracer.done if number == (STEP_1, STEP_2)[joint]]
    assert taken == [*[step] * 3, onward, *[step] * 3, reversed_, *[step] * 3, idle]


def switched_on(name: str) -> Board:
    """A board that watches its limit switches, drivers on, all switches open."""
    board, joints = Board(emulated(name)), BOARDS[name].joints
    board.hello()
    board.ask(Config(PinMap[BOARDS[name].pin_map.upper()], joints, 0, WATCH_SWITCHES, 0, 0, 0, (20_000,) * joints))
    for pin in BOARDS[name].limit_pins:
        board._firmware.uno.pin(pin).drive(1)
    board.ask(Enable(1))
    board.run(WAKE_TICKS)
    return board


@pytest.mark.parametrize("positive", [0, 1])
@pytest.mark.parametrize(("name", "joint"), [(name, joint) for name in OTHERS for joint in range(BOARDS[name].joints)])
def test_every_joint_homes_to_its_own_switch(name: str, joint: int, positive: int) -> None:
    # The switch closes from a place on; those of the other joints are closed from the beginning and mean nothing.
    closes_at = 30 if positive else -30
    board = switched_on(name)
    pins = [board._firmware.uno.pin(pin) for pin in BOARDS[name].limit_pins]
    for other in range(BOARDS[name].joints):
        pins[other].drive(int(other == joint))
    board.run(2 * DEBOUNCE_TICKS)
    assert board.ask(Home(joint, positive, 20_000, 2 * DEBOUNCE_TICKS, 200, 100)).state is State.HOMING
    for _ in range(20_000):
        board.run(2000)
        at = board.position_at(joint, board.now)
        pins[joint].drive(int(at < closes_at if positive else at > closes_at))
        if board.replies and board.replies[-1][1].state is not State.HOMING:  # type: ignore[union-attr]
            break
    status = board.ask()
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    wanted = [0] * BOARDS[name].joints
    wanted[joint] = closes_at
    assert status.ledger.position_usteps == tuple(wanted)
    assert [board.position_at(number, board.now) for number in range(BOARDS[name].joints)] == wanted, "by the pins"


@pytest.mark.parametrize("name", BOARDS)
def test_a_homing_at_the_least_interval_is_on_its_ticks_on_a_busy_line(name: str) -> None:
    # Frames that are refused, as many as the line carries: the main program has most to do there.
    joints = BOARDS[name].joints
    refused = Segments(0, 0, 0, (segment_of(96_000, *[run_of(200, first=0, interval=400)] * joints),))
    for joint in range(joints):
        board = switched_on(name)
        board.ask(Home(joint, 1, MIN_HOMING_TICKS, 2 * DEBOUNCE_TICKS, 300, 100))
        while (state := board.ask_now().state) is State.HOMING:
            board.send(refused)
            board.send(refused)
        status = board.ask()
        assert (state, status.fault) == (State.FAULT, Fault.HOMING_FAILED), joint
        rises = board.rises(joint)
        assert len(rises) == 300
        between = {later - tick for tick, later in itertools.pairwise(rises)}
        assert max(between) - min(between) <= 2 * MOST_OFF_TICKS.get(name, (0, 0))[joint], joint


@pytest.mark.parametrize(("name", "joint"), [(name, joint) for name in OTHERS for joint in range(BOARDS[name].joints)])
def test_homing_without_a_switch_tells_the_joint(name: str, joint: int) -> None:
    board = switched_on(name)
    board.ask(Home(joint, 1, 20_000, 2 * DEBOUNCE_TICKS, 30, 100))
    board.run(30 * 20_000 + 200_000)
    status = board.ask()
    assert (status.state, status.fault, status.detail) == (State.FAULT, Fault.HOMING_FAILED, joint)
    assert status.ledger.position_usteps[joint] == 30


@pytest.mark.parametrize(("name", "joint"), [(name, joint) for name in OTHERS for joint in range(BOARDS[name].joints)])
def test_a_switch_that_closes_in_motion_tells_its_joint(name: str, joint: int) -> None:
    board = switched_on(name)
    for segment in steady(name, 6000, 0.3)[:6]:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 300_000)
    board._firmware.uno.pin(BOARDS[name].limit_pins[joint]).drive(0)
    board.run(3 * DEBOUNCE_TICKS)
    status = board.ask()
    assert (status.state, status.fault, status.detail) == (State.FAULT, Fault.LIMIT_SWITCH, joint)
    assert status.ledger.position_usteps == tuple(
        board.position_at(number, board.now) for number in range(BOARDS[name].joints)
    )


@pytest.mark.parametrize("name", sorted(BOARDS))
def test_the_lock_of_a_freeze_ends_before_the_steps_that_it_does_not_leave_alone(name: str) -> None:
    # firmware/core/step_engine.cpp: FREEZE_MARGIN_TICKS. The last passes before they rest run by single instructions.
    joints = BOARDS[name].joints
    tracer = Tracer(RELEASE / f"{name}.hex", BOARDS[name])
    board = Board(tracer)
    single_run, tracer.run = tracer.run, super(Tracer, tracer).run  # type: ignore[method-assign]
    board.get_ready()
    moves = [run_of(30, first=100 + 300 * joint, interval=10_000) for joint in range(joints)]
    for segment in end_motion([segment_of(300_000, *moves, joints=joints)] * 5):
        board.ask(Segments(200, 200, 1, (segment,)))
    board.ask(Start(LEAD_TICKS))
    board.run(LEAD_TICKS + 100_000)
    board.receive(bytes([HOLD_CODE]))
    seen = [tracer.uno.snapshot()]
    while board.ask_now().state is not State.HELD:
        seen.append(tracer.uno.snapshot())
        board.run(20_000)
    tracer.uno.restore(seen[-2])  # the reply before may tell of what was before the freeze
    tracer.run = single_run  # type: ignore[method-assign]
    chip = tracer.chip
    longest, end = 0, chip.cycle + 120_000
    while chip.cycle < end:
        begin = chip.cycle
        tracer.run_until(lambda: bool(chip.sreg & 0x80))
        longest = max(longest, chip.cycle - begin)
        tracer.run_until(lambda: not chip.sreg & 0x80)
    assert 30 <= longest < 100 * joints


CLI, JUMP_TO_ITSELF = b"\xf8\x94", b"\xff\xcf"


def place_of_start(flash: bytes) -> int:
    """Where the main program locks interrupts to start a joint: the CLI before an OUT to TIFR1, of any register."""
    words = [flash[at : at + 2] for at in range(0, len(flash), 2)]
    forgets = {at for at, word in enumerate(words) if int.from_bytes(word, "little") & 0xFE0F == 0xBA06}
    (place,) = (at for at, word in enumerate(words) if word == CLI and forgets & set(range(at, at + 32)))
    return place


@pytest.mark.parametrize("name", ["uno", "uno_slow", "uno_four"])
def test_a_joint_that_is_started_too_late_makes_no_step(name: str) -> None:
    # The main program is held up right before it starts the joint, until some ticks before its first step, or after.
    interval, steps = 4000, 10
    tracer = Tracer(RELEASE / f"{name}.hex", BOARDS[name])
    board = Board(tracer)
    tracer.run = super(Tracer, tracer).run  # type: ignore[method-assign]
    board.get_ready()
    move = run_of(steps, first=1000, interval=interval, positive=False)
    board.ask(Segments(0, 0, 0, end_motion([segment_of(steps * interval, move, joints=BOARDS[name].joints)])))
    board.send(Start(200_000))
    board.run(150_000)
    flash, chip = tracer.uno.flash, tracer.chip
    place, trap = (
        place_of_start(flash),
        next(at for at in range(0, 16_000) if flash[2 * at : 2 * at + 2] == JUMP_TO_ITSELF),
    )
    tracer.run_until(lambda: chip.pc == place)
    begun, starting, seq, edges = chip.cycle, tracer.uno.snapshot(), board.seq, tuple(board.edges)

    def play(held_until: int) -> tuple[Status, list[int]]:
        tracer.uno.restore(starting)
        board.forget_replies()
        board.seq, board.edges[:] = seq, edges
        if held_until > begun:
            sreg = chip.sreg
            chip.pc, chip.sreg = trap, sreg & 0x7F
            chip.run_to(held_until)
            chip.pc, chip.sreg = place, sreg
        board.run(steps * interval + 300_000)
        return board.ask(), board.rises(0)

    _, planned = play(0)
    assert len(planned) == steps
    faults = set()
    for before in range(100, -20, -3):
        status, made = play(planned[0] - before)
        faults.add(status.fault)
        assert made == (planned if status.fault is Fault.NONE else []), f"{before} ticks before its step"
        assert status.ledger.position_usteps[0] == -len(made)
    assert faults == {Fault.NONE, Fault.MISSED_DEADLINE}


@pytest.mark.parametrize("name", ["uno_four", "cnc_shield", "cnc_shield_four"])
def test_a_fault_never_tells_more_segments_than_were_made(name: str) -> None:
    # The last step of a segment is a tick before its end, and rises later than that where an interrupt makes it.
    wiring = BOARDS[name]
    interval = 3 * wiring.min_interval_ticks
    steps = 120_000 // interval
    move = run_of(steps, first=interval - 1, interval=interval)
    segment = segment_of(steps * interval, *[move] * wiring.joints, joints=wiring.joints)
    board = Board(emulated(name))
    board.get_ready()
    for _ in range(10):
        board.ask(Segments(0, 0, 0, (segment,)))
    uno, seq = board._firmware.uno, board.seq
    queued, told = uno.snapshot(), set()
    for later_ticks in range(0, 60_000, 83):
        uno.restore(queued)
        board.forget_replies()
        board.edges.clear()
        board.seq = seq
        board.send(Start(LEAD_TICKS + later_ticks))
        board.run(LEAD_TICKS + 150_000)
        board.send(Segments(0, 0, 0, (segment_of(0, joints=wiring.joints),)))
        board.run(20_000)
        status = board.ask()
        assert status.fault is Fault.BAD_SEGMENT
        made = status.ledger.position_usteps
        assert made == tuple(len(board.rises(joint)) for joint in range(wiring.joints))
        assert all(status.ledger.executed_segments * steps <= count for count in made), (status.ledger, later_ticks)
        assert status.ledger.executed_segments >= min(made) // steps - 1
        told.add(status.ledger.executed_segments)
    assert len(told) > 1
