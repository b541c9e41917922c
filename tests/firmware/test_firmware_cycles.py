"""What the interrupts of the released image take, instruction by instruction on the emulated chip.

The figures are those beside the code, in firmware/hal/uno. Entry takes four cycles and RETI four (ATmega328P datasheet,
7.7.1); both are counted, and so is the jump from the vector.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from firmware_board import LEAD_TICKS, Board, Schedule, end_motion, run_of, segment_of
from firmware_tracer import END_PULSES, INTERRUPTS_ON, LAP, PIN_CHANGE, RECEIVE, STEP_1, STEP_2, TRANSMIT, Tracer
from planarm_wire.codec import encode
from planarm_wire.framing import encode_frame
from planarm_wire.messages import (
    BOARDS,
    DELIMITER,
    EMERGENCY_CODE,
    ESCAPE,
    HOLD_CODE,
    PROTOCOL_VERSION,
    RESERVED,
    STEP_PINS,
    Config,
    Fault,
    Hello,
    PinMap,
    Query,
    Segment,
    Segments,
    Start,
    State,
)

RELEASE = Path(__file__).parents[2] / "firmware" / "release"
IMAGE = RELEASE / "uno.hex"
JUMP_TO_ITSELF = b"\xff\xcf"  # rjmp .-2

STEP_CYCLES, ONWARD_CYCLES, REVERSED_CYCLES, IDLE_CYCLES = 75, 75, 77, 73
MISSED_CYCLES = (82, 84)  # joint 2's interrupt goes on in that of joint 1
HIGH_CYCLES = range(56, 60)  # nothing else runs but an instruction of the main program
LOCK_CYCLES = 11  # of the main program; firmware/README.md, budgets
RECEIVE_CYCLES, OVERRUN_CYCLES, FULL_CYCLES, FULL_OVERRUN_CYCLES = 36, 42, 39, 43
HOLD_CYCLES, EMERGENCY_CYCLES = 35, 33
LAST_EMERGENCY_CYCLES = {"uno": 40, "uno_slow": 40, "uno_four": 43, "cnc_shield": 36, "cnc_shield_four": 40}
MOST_RECEIVE_CYCLES = 45
# Of what ends pulses that an emergency has found high; on the shield with two joints there are none.
END_CYCLES = {"uno": {20}, "uno_slow": {20}, "uno_four": {24}, "cnc_shield": set(), "cnc_shield_four": {24}}
CLOSED_CYCLES = 12  # the stop input's contact
OPENED_CYCLES = {"uno": 29, "uno_slow": 29, "uno_four": 32, "cnc_shield": 25, "cnc_shield_four": 29}
TRANSMIT_CYCLES, ESCAPE_CYCLES, DELIMITER_CYCLES = 34, 39, 35
LAP_CYCLES = 18
WATCH_STOP_INPUT = 4  # a bit of CONFIG's options


@pytest.fixture
def tracer() -> Tracer:
    return Tracer(IMAGE)


def play(tracer: Tracer, segments: list[Segment]) -> Board:
    """Start a motion, up to its first step; from then on the board runs by single instructions."""
    board = Board(tracer)
    fast = super(Tracer, tracer).run
    tracer.run = fast  # type: ignore[method-assign]
    board.get_ready()
    for segment in segments:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.send(Start(LEAD_TICKS))
    board.run(LEAD_TICKS - 1000)
    del tracer.run
    return board


def highs(board: Board) -> Iterator[tuple[int, int]]:
    """When each pulse of joint 1 begins, and for how long it is high."""
    edges = [edge for edge in board.edges if edge.pin == STEP_PINS[0]]
    for rise, fall in pairwise(edges):
        if rise.level:
            yield rise.tick, fall.tick - rise.tick


@pytest.mark.parametrize("joint", [0, 1])
def test_step_interrupts(tracer: Tracer, joint: int) -> None:
    def segment(positive: bool) -> Segment:
        moves = [run_of(0), run_of(0)]
        moves[joint] = run_of(5, positive=positive, fraction=40_000, interval=900)
        return segment_of(6000, *moves)

    board = play(tracer, end_motion([segment(True), segment(True), segment(False)]))
    board.run(LEAD_TICKS + 25_000)
    vector = (STEP_1, STEP_2)[joint]
    assert [cycles for number, cycles in tracer.done if number == vector] == [
        *[STEP_CYCLES] * 4,
        ONWARD_CYCLES,
        *[STEP_CYCLES] * 4,
        REVERSED_CYCLES,
        *[STEP_CYCLES] * 4,
        IDLE_CYCLES,
    ]
    assert tracer.taken(RECEIVE) <= {RECEIVE_CYCLES}
    assert tracer.taken(TRANSMIT) <= {TRANSMIT_CYCLES, ESCAPE_CYCLES, DELIMITER_CYCLES}
    assert tracer.taken(LAP) == {LAP_CYCLES}
    if joint == 0:
        free = {high for rise, high in highs(board) if rise not in tracer.locked}
        assert free and free <= set(HIGH_CYCLES)
        assert all(high < HIGH_CYCLES.stop + LOCK_CYCLES for _, high in highs(board))


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize(("steps", "turns"), [(9, False), (1, False), (1, True)])
def test_an_interrupt_that_comes_too_late_stops_both_joints(
    tracer: Tracer, steps: int, turns: bool, joint: int
) -> None:
    # Held up by more than an interval, after a step of a run, and after the last one of a run.
    def segment(positive: bool) -> Segment:
        moves = [run_of(0), run_of(0)]
        moves[joint] = run_of(steps, first=0, interval=700, positive=positive)
        return segment_of(700 * steps, *moves)

    vector = (STEP_1, STEP_2)[joint]
    board = play(tracer, end_motion([segment(not (turns and i % 2)) for i in range(8)]))
    tracer.run_until(lambda: len(tracer.taken(vector)) > 0)
    tracer.hold_interrupts(1500)
    board.run(400)
    assert [taken for number, taken in tracer.done if number == vector][-1] == MISSED_CYCLES[joint]
    status = board.ask()
    assert status.fault is Fault.MISSED_DEADLINE
    assert status.ledger.position_usteps[joint] == board.position_at(joint, board.now)
    assert status.ledger.position_usteps[1 - joint] == 0


def test_receive_interrupt(tracer: Tracer) -> None:
    board = play(tracer, end_motion([segment_of(200_000, run_of(2))]))
    tracer.done.clear()
    board.send(Query())
    board.run(40_000)
    assert tracer.taken(RECEIVE) == {RECEIVE_CYCLES}
    # Four bytes while interrupts are off: one more than the USART holds.
    tracer.done.clear()
    board.receive(bytes(4))
    tracer.hold_interrupts(5 * 640)
    board.run(2000)
    assert tracer.taken(RECEIVE) == {RECEIVE_CYCLES, OVERRUN_CYCLES}


def watching_stop_input(name: str) -> tuple[Tracer, Board]:
    """The board at rest, with the stop input's contact closed."""
    tracer = Tracer(RELEASE / f"{name}.hex", BOARDS[name])
    board, joints = Board(tracer), BOARDS[name].joints
    fast = super(Tracer, tracer).run
    tracer.run = fast  # type: ignore[method-assign]
    tracer.uno.pin(BOARDS[name].stop_pin).drive(0)
    board.hello()
    own = PinMap[BOARDS[name].pin_map.upper()]
    board.ask(Config(own, joints, 0, WATCH_STOP_INPUT, 0, 0, 0, (4000,) * joints))
    del tracer.run
    return tracer, board


@pytest.mark.parametrize("name", LAST_EMERGENCY_CYCLES)
def test_receive_interrupt_out_of_band(name: str) -> None:
    # The third byte in a row ends all steps, as does each behind it, and another byte begins anew.
    tracer, board = watching_stop_input(name)
    board.receive(bytes([HOLD_CODE, *[EMERGENCY_CODE] * 4, HOLD_CODE, EMERGENCY_CODE]))
    board.run(7 * 640 + 400)
    last = [LAST_EMERGENCY_CYCLES[name]] * 2
    told = [HOLD_CYCLES, *[EMERGENCY_CYCLES] * 2, *last, HOLD_CYCLES, EMERGENCY_CYCLES]
    assert [cycles for number, cycles in tracer.done if number == RECEIVE] == told
    assert max(RECEIVE_CYCLES, OVERRUN_CYCLES, FULL_CYCLES, FULL_OVERRUN_CYCLES, *told) <= MOST_RECEIVE_CYCLES
    ends = [cycles for number, cycles in tracer.done if number == END_PULSES]
    assert ends == [*END_CYCLES[name]] * 2


@pytest.mark.parametrize("name", LAST_EMERGENCY_CYCLES)
def test_the_stop_inputs_interrupt(name: str) -> None:
    tracer, _ = watching_stop_input(name)
    for level in (1, 0):
        tracer.uno.pin(BOARDS[name].stop_pin).drive(level)
        tracer.run(500)
    taken = [cycles for number, cycles in tracer.done if number == PIN_CHANGE]
    assert taken == [OPENED_CYCLES[name], CLOSED_CYCLES]
    assert tracer.taken(END_PULSES) == END_CYCLES[name]


def test_transmit_interrupt(tracer: Tracer) -> None:
    # WELCOME brings the host's number back, whose bytes are all to be escaped.
    board = Board(tracer)
    tracer.run(40_000)
    tracer.done.clear()
    nonce = bytes([*RESERVED, ESCAPE, DELIMITER])
    board.receive(encode_frame(0, *encode(Hello(PROTOCOL_VERSION, int.from_bytes(nonce, "little")))))
    tracer.run(100_000)
    sent = [cycles for number, cycles in tracer.done if number == TRANSMIT]
    assert set(sent) == {TRANSMIT_CYCLES, ESCAPE_CYCLES, DELIMITER_CYCLES}
    assert sent.count(ESCAPE_CYCLES) >= len(nonce)
    assert sent.count(DELIMITER_CYCLES) == 1 and sent[-1] == DELIMITER_CYCLES


def test_receive_interrupt_without_room(tracer: Tracer) -> None:
    # The main program stands still, on a jump to itself: the ring fills up. A hold finds its way past it.
    board = play(tracer, end_motion([segment_of(4_000_000, run_of(1, first=3_000_000))]))
    tracer.run_until(lambda: bool(tracer.chip.sreg & INTERRUPTS_ON))
    tracer.done.clear()
    code, left_at = tracer.uno.flash, tracer.chip.pc
    stop = next(word for word in range(len(code) // 2) if code[2 * word : 2 * word + 2] == JUMP_TO_ITSELF)
    tracer.chip.pc = stop
    board.receive(bytes([*bytes(130), HOLD_CODE]))

    def received() -> list[int]:
        return [cycles for number, cycles in tracer.done if number == RECEIVE]

    tracer.run_until(lambda: len(received()) == 131)
    assert received() == [*[RECEIVE_CYCLES] * 128, *[FULL_CYCLES] * 2, HOLD_CYCLES]
    assert tracer.chip.pc == stop
    # Four more while interrupts are off: one more than the USART holds.
    tracer.done.clear()
    board.receive(bytes(4))
    tracer.chip.sreg &= ~INTERRUPTS_ON
    tracer.uno.run(cycles=5 * 640)
    tracer.chip.sreg |= INTERRUPTS_ON
    tracer.run_until(lambda: len(received()) == 3)
    assert set(received()) == {FULL_CYCLES, FULL_OVERRUN_CYCLES}
    tracer.chip.pc = left_at
    tracer.run = super(Tracer, tracer).run  # type: ignore[method-assign]
    board.run(100_000)
    board.receive(bytes([DELIMITER]))
    status = board.ask()
    assert (status.state, status.ring_full, status.overruns) == (State.HELD, 5, 1)


@pytest.mark.parametrize("ms", [8, 9, 13, 60, 200])
def test_a_main_program_that_stands_still_latches_a_fault_and_makes_no_wrong_step(tracer: Tracer, ms: int) -> None:
    # Longer than the 16-bit timer's turn of 4.1 ms, shorter than the watchdog: what is prepared is made, on its tick,
    # and the rest is missed, since the clock counts the turns without the main program.
    motion = end_motion([segment_of(900_000, run_of(899, interval=1000, first=0)) for _ in range(8)])
    board = play(tracer, motion)
    fast = super(Tracer, tracer).run
    fast(1_500_000)
    tracer.run_until(lambda: bool(tracer.chip.sreg & INTERRUPTS_ON))
    code = tracer.uno.flash
    back = tracer.chip.pc
    tracer.chip.pc = next(word for word in range(len(code) // 2) if code[2 * word : 2 * word + 2] == JUMP_TO_ITSELF)
    stop = tracer.chip.pc
    fast(ms * 16_000)
    tracer.run_until(lambda: tracer.chip.pc == stop)
    tracer.chip.pc = back
    tracer.run = fast  # type: ignore[method-assign]
    board.run(10_000_000)
    status = board.ask()
    assert status.fault is Fault.MISSED_DEADLINE
    planned = [tick for tick, _ in Schedule.of(motion).steps[0]]
    rises = board.rises(0)
    assert [rise - rises[0] for rise in rises] == planned[: len(rises)]
    assert status.ledger.position_usteps[0] == len(rises)
