"""From segments to pins: the released firmware on the emulated Uno, streamed to over `sim://`, judged by its edges."""

import random
from itertools import accumulate

import numpy as np
import pytest

from link_echo import write_echo_image
from link_model import motion
from planarm.errors import LinkError
from planarm.link.exchange import stream_plan
from planarm.link.plan_steps import planned_usteps
from planarm.link.position import Certainty, StreamError, StreamFault
from planarm.link.sim_transport import SimTransport
from planarm.link.stream import StreamOptions
from planarm.link.transport import Transport, open_transport
from planarm_wire.messages import (
    DIR_PINS,
    EMERGENCY_CODE,
    ENABLE_PIN,
    HOLD_CODE,
    HOST_WINDOW_BYTES,
    STEP_PINS,
    Move,
    Segment,
)
from planarm_wire.steps import direction, duration_ticks, step_ticks


@pytest.fixture
def line() -> SimTransport:
    transport = open_transport("sim://")
    assert isinstance(transport, SimTransport)
    return transport


def rises(line: Transport, pin: str) -> np.ndarray:
    edges = line.pins.edges(pin)
    return edges["cycle"][edges["level"] == 1]


def level_at(line: Transport, pin: str, cycles: np.ndarray) -> np.ndarray:
    """Level of `pin` at each cycle; low before its first edge."""
    edges = line.pins.edges(pin)
    return np.concatenate([[0], edges["level"]])[np.searchsorted(edges["cycle"], cycles, side="right")]


def planned_rises(segments) -> list[np.ndarray]:
    """Ticks of each joint's steps from the motion's start, by the closed form of the protocol."""
    starts = [0, *accumulate(duration_ticks(segment) for segment in segments)]
    return [
        np.array([b + t for b, s in zip(starts, segments, strict=False) for t in step_ticks(s.moves[joint])], dtype=int)
        for joint in range(2)
    ]


def planned_levels(segments, joint: int) -> list[int]:
    return [int(direction(s.moves[joint]) > 0) for s in segments for _ in step_ticks(s.moves[joint])]


def assert_pins_show(line: Transport, segments) -> None:
    planned = planned_rises(segments)
    first = min(int(ticks[0]) for ticks in planned if len(ticks))
    start = min(int(rises(line, pin)[0]) for pin in STEP_PINS if len(rises(line, pin))) - first
    for joint, (step_pin, dir_pin) in enumerate(zip(STEP_PINS, DIR_PINS, strict=True)):
        np.testing.assert_array_equal(rises(line, step_pin) - start, planned[joint])
        assert level_at(line, dir_pin, rises(line, step_pin)).tolist() == planned_levels(segments, joint)
        assert not level_at(line, ENABLE_PIN, rises(line, step_pin)).any()  # low energises


def test_hand_made_segments_reach_the_pins_tick_by_tick(line):
    """Every number of the expected ticks is worked out by hand from the fields."""
    segments = (
        Segment(2 * 16_000, (Move(2 * 4 + 1, 1000, 2000 << 8), Move(0))),
        Segment(2 * 20_000, (Move(2 * 3, 5000, 4000 << 8, 1000 << 8), Move(2 * 1 + 1, 777))),
        Segment(2 * 8_000 + 1, (Move(1), Move(2 * 3, 1600, (1000 << 8) + (1 << 7)))),
    )
    result = stream_plan(line, segments)
    joint_1 = [1000, 3000, 5000, 7000, 21_000, 25_000, 30_000]
    joint_2 = [16_777, 37_600, 38_600, 39_601]  # half a tick more an interval: 1000.5, 2001.0
    start = rises(line, "D9")[0] - 1000
    assert (rises(line, "D9") - start).tolist() == joint_1
    assert (rises(line, "D10") - start).tolist() == joint_2
    assert level_at(line, "D4", rises(line, "D9")).tolist() == [1, 1, 1, 1, 0, 0, 0]
    assert level_at(line, "D5", rises(line, "D10")).tolist() == [1, 0, 0, 0]
    assert result.ledger_after.position_usteps == (4 - 3, 1 - 3)
    assert result.ledger_after.executed_segments == 3


def test_a_long_plan_reaches_the_pins_tick_by_tick(line):
    segments = motion(250, ticks=32_000)
    result = stream_plan(line, segments)
    assert_pins_show(line, segments)
    assert result.retransmissions == result.crc_errors == result.bytes_lost == 0
    assert result.least_queued >= 24


def test_two_plans_one_after_the_other(line):
    first, second = motion(20, seed=3), motion(20, seed=4)
    stream_plan(line, first)
    steps_before = [len(rises(line, pin)) for pin in STEP_PINS]
    result = stream_plan(line, second, options=StreamOptions(release_when_done=True))
    assert result.ledger_before.executed_segments == 20
    for pin, before, ticks in zip(STEP_PINS, steps_before, planned_rises(second), strict=True):
        assert np.array_equal(np.diff(rises(line, pin)[before:]), np.diff(ticks))
    enable = line.pins.edges(ENABLE_PIN)
    assert enable["level"][-1] == 1  # released
    assert enable["cycle"][-1] > rises(line, "D9")[-1]


def test_the_line_carries_what_250000_baud_can(line):
    """700 segments a second of about 20 bytes each: 15,000 of the line's 25,000 bytes a second with all overhead."""
    segments = motion(400, ticks=23_000)
    result = stream_plan(line, segments)
    assert_pins_show(line, segments)
    assert result.least_queued >= 8  # a quarter of the 33 such segments that the ring's bytes hold
    assert result.bytes_sent / result.motion_s > 14_000


class NoisyLine:
    """Damages single bytes in both directions of another transport; makes no hold and no emergency of them, which stop
    the arm (tests/system/test_holds.py)."""

    def __init__(self, line: SimTransport, chance: random.Random, probability: float) -> None:
        self._line, self._chance, self._probability = line, chance, probability
        self.clock, self.pins, self.nonce = line.clock, line.pins, line.nonce

    def _damage(self, data: bytes) -> bytes:
        out = bytearray()
        for byte in data:
            kind = self._chance.random() / self._probability
            if kind >= 1.0:
                out.append(byte)
            elif kind < 0.5:
                flipped = byte ^ 1 << self._chance.randrange(8)
                out.append(byte if flipped in (HOLD_CODE, EMERGENCY_CODE) else flipped)
            elif kind < 0.75:
                out += bytes([byte, byte])
        return bytes(out)

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        return self._damage(self._line.read(max_bytes // 2, deadline_s))

    def write(self, data: bytes) -> None:
        self._line.write(self._damage(data))

    def close(self) -> None:
        self._line.close()


@pytest.mark.parametrize("seed", range(3))
def test_a_noisy_line_changes_no_edge(line, seed):
    """One byte in 500 is damaged, a few thousand times more than on the worst cable reported for 250,000 baud."""
    segments = motion(120, ticks=96_000, seed=seed)
    result = stream_plan(NoisyLine(line, random.Random(seed), 0.002), segments)
    assert_pins_show(line, segments)
    assert result.ledger_after.position_usteps == planned_usteps(segments)
    assert result.retransmissions > 0
    assert result.crc_errors > 0


def test_a_reset_in_a_motion_stops_the_pins_and_is_told(line):
    segments, pressed = motion(200), []

    def press_reset(progress) -> None:
        if progress.executed_segments >= 50 and not pressed:
            pressed.append(line.uno.cycle)
            line.uno.reset()

    with pytest.raises(StreamError, match="position lost: the board restarted") as caught:
        stream_plan(line, segments, press_reset)
    assert caught.value.position.certainty is Certainty.LOST
    for pin in STEP_PINS:
        assert rises(line, pin)[-1] <= pressed[0]


def test_a_starved_queue_ends_with_the_exact_position_on_the_path(line, monkeypatch):
    """2,000 segments a second of two moves each are more than the line carries; whatever stops it tells the truth.

    The motion is not slowed for the line here, as when a line gets worse on the way.
    """
    monkeypatch.setattr("planarm.link.margin.LEAST_SEEN_BYTES", 10**9)
    segments = tuple(
        Segment(2 * 8000 + (index == 999), (Move(2 * 2 + 1, 2000, 4000 << 8), Move(2 * 2, 2000, 4000 << 8)))
        for index in range(1000)
    )
    with pytest.raises(StreamFault, match=r"(queue ran empty|not be placed on its tick).*position exact") as caught:
        stream_plan(line, segments)
    steps = [len(rises(line, pin)) for pin in STEP_PINS]
    assert caught.value.position.moved_usteps == (steps[0], -steps[1])
    for pin, ticks, count in zip(STEP_PINS, planned_rises(segments), steps, strict=True):
        assert np.all(np.diff(rises(line, pin)) >= np.diff(ticks[:count]))


def test_a_board_with_another_program_is_told(tmp_path):
    with pytest.raises(LinkError, match=r"no answer to HELLO .*flash the released image"):
        stream_plan(open_transport(f"sim://?image={write_echo_image(tmp_path)}"), motion(3))


def test_the_window_is_what_the_receive_ring_holds(line):
    """The host never has more unacknowledged bytes under way than the window, counted on the line itself."""
    pending = []

    class Watched(NoisyLine):
        def write(self, data: bytes) -> None:
            super().write(data)
            pending.append(self._line.uno.serial.pending)

    stream_plan(Watched(line, random.Random(0), 1e-12), motion(100))
    assert 56 < max(pending) <= HOST_WINDOW_BYTES
