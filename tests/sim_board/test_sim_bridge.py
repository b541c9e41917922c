"""The bridge between board, line and clock: all of it in emulated time, with a line and a clock made here."""

from pathlib import Path

import pytest

from planarm_sim import Uno
from planarm_sim.board import CLOCK_HZ
from planarm_sim.board.usb_bridge import FLUSH_CYCLES, PACKET_CYCLES, RING_BYTES
from planarm_sim.bridge import Bridge
from planarm_sim.bridge.bridge import AHEAD_S, GIVE_UP_LAG_S, LEAST_SLICE_S, LIVELY_SLICE_S, MAX_CHUNK_S, QUIET_SLICE_S
from sim_board.fake_line import FakeClock, FakeLine

DATA = Path(__file__).parent / "data"
BOOT_S = 0.001
TICK_S = FLUSH_CYCLES / CLOCK_HZ
BYTE_S = 40e-6  # ten bits at 250,000 baud
POWER_UP, RESET = b"R\x01", b"R\x02"  # what echo.S sends first: 'R' and MCUSR


class Rig:
    def __init__(
        self,
        acts,
        *,
        image="echo.hex",
        speed="real",
        boot_s=0.0,
        cost_s=0.0,
        room=10**6,
        usb="direct",
        power_up_s=BOOT_S,
    ) -> None:
        self.uno = Uno.from_hex(DATA / image, usb=usb)
        self.uno.run(seconds=power_up_s)  # the program has greeted, and cleared MCUSR
        self.clock = FakeClock()
        self.line = FakeLine(self.clock, acts, room)
        self.said: list[str] = []
        self.steps = 0
        self.bridge = Bridge(
            self.uno,
            self.line,
            self.clock,
            speed=speed,
            boot_s=boot_s,
            say=self.said.append,
            after_run=self._count,
        )
        self.clock.cost_s = cost_s

    def _count(self) -> None:
        self.steps += 1


# --- real time ---


def test_emulated_time_follows_the_clock():
    rig = Rig([(0.0, "open")])
    rig.bridge.run(seconds=0.5)
    assert rig.uno.time_s - BOOT_S == pytest.approx(0.5, abs=1e-6)
    assert rig.clock.time_s - rig.line.start_s == pytest.approx(0.5, abs=1.5 * QUIET_SLICE_S)
    assert rig.said == []


@pytest.mark.parametrize("acts", [[], [(0.0, "open")]], ids=["closed", "open and silent"])
def test_a_quiet_line_lets_the_processor_sleep(acts):
    rig = Rig(acts)
    rig.bridge.run(seconds=0.5)
    # The board greets at power-up and after the reset by opening: some lively milliseconds. Then quiet slices only.
    assert rig.steps < 0.5 / QUIET_SLICE_S + 100
    assert min(rig.line.waits[-100:-1]) == pytest.approx(QUIET_SLICE_S)
    assert sum(rig.line.waits) == pytest.approx(0.5, abs=1.5 * QUIET_SLICE_S)


def test_bytes_come_back_in_order_and_no_sooner_than_the_line_carries_them():
    text = bytes(range(10, 210))
    rig = Rig([(0.0, "open"), (0.1, text)])
    rig.bridge.run(seconds=0.2)
    assert rig.line.text == RESET + bytes(byte + 1 for byte in text)
    echoed = [(when, data) for when, data in rig.line.received if when > 0.1]
    count = 0
    for when, data in echoed:
        count += len(data)
        assert when >= 0.1 + (count + 1) * BYTE_S - 10e-6, "in and out, one byte overlapping the next"
    assert echoed[-1][0] <= 0.1 + 201 * BYTE_S + 2 * LIVELY_SLICE_S
    assert rig.bridge.counts.from_host_bytes == 200
    assert rig.bridge.counts.to_host_bytes == 202


def test_an_answer_to_a_quiet_line_comes_at_once():
    rig = Rig([(0.0, "open"), (0.1, b"a"), (0.15003, b"b")])
    rig.bridge.run(seconds=0.2)
    answers = [when for when, data in rig.line.received if data in (b"b", b"c")]
    assert [a - b for a, b in zip(answers, (0.1, 0.15003), strict=True)] == pytest.approx(
        [2 * BYTE_S, 2 * BYTE_S], abs=2 * LIVELY_SLICE_S
    )


def test_the_host_is_held_back_beyond_the_ring():
    rig = Rig([(0.0, "open"), (0.01, bytes([9] * 1000))])
    fullest = 0

    def watch() -> None:
        nonlocal fullest
        fullest = max(fullest, rig.uno.serial.pending)

    rig.bridge._after_run = watch
    rig.bridge.run(seconds=0.03)
    assert RING_BYTES - 10 <= fullest <= RING_BYTES
    assert rig.line.inbox, "20 ms carry 500 of the 1000 bytes"
    rig.bridge.run(seconds=0.03)
    assert rig.line.text == RESET + bytes([10] * 1000)


# --- opening and closing ---


def test_opening_resets_the_board_as_a_uno_does():
    rig = Rig([(0.05, "open"), (0.10, "close"), (0.15, "open"), (0.16, b"a"), (0.17, "close")])
    rig.bridge.run(seconds=0.2)
    assert rig.line.text == RESET + RESET + b"b"
    assert rig.bridge.counts.opened == 2
    assert rig.bridge.counts.lost_bytes == len(POWER_UP), "sent before anyone had opened"


@pytest.mark.parametrize("usb", ["direct", "16u2"])
@pytest.mark.parametrize("opened_s", [0.000_05, 0.001, 0.003])
def test_what_the_old_program_sent_does_not_come_after_the_reset(usb, opened_s):
    """The USB bridge keeps bytes for up to 4 ms: who opens the line in between gets the new program's only."""
    rig = Rig([(opened_s, "open")], usb=usb, boot_s=0.01, power_up_s=0.0)
    rig.bridge.run(seconds=0.05)
    assert rig.line.text in (RESET, b"R\x03"), "MCUSR also tells the power-up when the program had not cleared it"
    assert rig.bridge.counts.lost_bytes + rig.bridge.counts.to_host_bytes <= len(POWER_UP) + len(RESET)


def test_a_host_that_leaves_dtr_up_resets_the_board_only_once():
    rig = Rig([(0.05, "open"), (0.1, "close"), (0.15, "open"), (0.16, b"a")], boot_s=0.1)
    rig.line.dtr_stays_up = True
    rig.bridge.run(0.5)
    assert rig.line.text == RESET + b"b", "the second opening finds it running"


def test_closing_and_opening_at_once_is_an_opening():
    rig = Rig([(0.05, "open"), (0.1, "close"), (0.1, "open")])
    rig.bridge.run(seconds=0.2)
    assert rig.line.text == RESET + RESET
    assert rig.bridge.counts.opened == 2


def test_opening_can_be_harmless():
    rig = Rig([(0.05, "open"), (0.06, b"a"), (0.10, "close"), (0.15, "open"), (0.16, b"c")], boot_s=None)
    rig.bridge.run(seconds=0.2)
    assert rig.line.text == b"bd"


def test_what_is_sent_to_a_closed_line_does_not_reach_the_next_host():
    rig = Rig([(0.05, "open"), (0.1, b"abc"), (0.1, "close"), (0.15, "open")])
    rig.bridge.run(seconds=0.2)
    assert rig.line.text == RESET + RESET
    counts = rig.bridge.counts
    assert counts.from_host_bytes == 3, "the board still gets what the host sent last"
    assert counts.lost_bytes == len(POWER_UP) + 3


def test_a_host_that_does_not_read_loses_bytes_and_stops_nothing():
    rig = Rig([(0.0, "open"), (0.01, bytes([7] * 50))], room=12)
    rig.bridge.run(seconds=0.05)
    assert rig.line.text == RESET + bytes([8] * 10)
    assert rig.bridge.counts.lost_bytes == 40 + len(POWER_UP)


def test_an_opened_board_stays_in_reset_while_the_boot_loader_would_run():
    rig = Rig([(0.05, "open"), (0.10, b"lost"), (0.149, b"lost"), (0.16, b"a")], boot_s=0.1)
    rig.bridge.run(seconds=0.2)
    assert rig.line.text == RESET + b"b"
    assert 0.15 <= rig.line.received[0][0] <= 0.15 + 2 * QUIET_SLICE_S
    assert rig.clock.time_s == pytest.approx(0.2 + 0.1, abs=3 * QUIET_SLICE_S), "the board's time stands still"
    assert rig.said == [], "and that is no lag"
    assert rig.bridge.counts.from_host_bytes == 1


def test_opening_twice_during_reset_starts_it_again():
    rig = Rig([(0.05, "open"), (0.1, "close"), (0.12, "open")], boot_s=0.1)
    rig.bridge.run(seconds=0.2)
    assert rig.line.text == RESET
    assert rig.line.received[0][0] >= 0.22


def test_bytes_on_the_line_at_an_opening_are_the_old_programs():
    rig = Rig([(0.05, "open"), (0.1, b"abcdef"), (0.1001, "close"), (0.1001, "open")])
    rig.bridge.run(seconds=0.2)
    assert rig.line.text == RESET + RESET
    assert rig.bridge.counts.from_host_bytes == 6
    assert 4 <= rig.bridge.counts.lost_bytes - len(POWER_UP) <= 6, "all were heard; the last echoes are cut off"


# --- too slow, stopped, as fast as it goes ---


def test_a_computer_too_slow_for_real_time_is_told_once():
    rig = Rig([], cost_s=2 * MAX_CHUNK_S)  # every look at the clock costs more than a chunk of emulated time gains
    rig.bridge.run(seconds=3.0)
    assert len(rig.said) == 1
    assert "behind the clock" in rig.said[0]
    assert rig.bridge.counts.lag_given_up_s > 1.0
    assert rig.clock.time_s - rig.line.start_s > 3.0


def test_a_short_stall_is_caught_up_in_silence():
    rig = Rig([(0.0, "open")])
    rig.bridge.run(seconds=0.1)
    rig.clock.time_s += 0.9 * GIVE_UP_LAG_S  # the computer was busy elsewhere
    rig.bridge.run(seconds=0.9 * GIVE_UP_LAG_S + 0.1)
    assert rig.said == []
    assert rig.uno.time_s - BOOT_S == pytest.approx(rig.clock.time_s - rig.line.start_s, abs=2 * QUIET_SLICE_S)


def test_a_condition_ends_the_loop_after_the_step():
    rig = Rig([])
    rig.bridge.run(seconds=10, until=lambda: rig.steps > 0)
    assert rig.steps == 1
    assert 0 < rig.uno.time_s - BOOT_S <= QUIET_SLICE_S + 1e-6


def test_as_fast_as_it_goes_needs_no_clock_and_paces_bytes_all_the_same():
    text = bytes(range(10, 110))
    whole = RESET + bytes(byte + 1 for byte in text)
    rig = Rig([(0.0, "open"), (0.0, text)], speed="max")
    rig.bridge.run(seconds=0.004)
    assert rig.line.waits == []
    assert rig.clock.time_s == rig.line.start_s
    assert whole.startswith(rig.line.text)
    assert 40 < len(rig.line.text) < 0.004 / BYTE_S, "the line carries 100 bytes in 4 ms, and they come after a look"
    rig.bridge.run(seconds=QUIET_SLICE_S + 3 * BYTE_S + LIVELY_SLICE_S)
    assert rig.line.text == whole


@pytest.mark.parametrize("speed", ["real", "max"])
def test_a_run_ends_on_its_cycle(speed):
    rig = Rig([(0.0, "open")], speed=speed, image="pulses.hex")
    rig.bridge.run(seconds=0.0123)
    assert 0 <= rig.uno.cycle - (BOOT_S + 0.0123) * CLOCK_HZ < 16


# --- awake no more often than the USB bridge asks for ---


def test_behind_the_usb_bridge_bytes_come_at_its_ticks_and_nobody_looks_in_between():
    """A lone byte is on the wire for 40 us each way, then lies in the ring until the tick: multiples of 4.096 ms."""
    moments = [0.1 + 0.0131 * n for n in range(20)]
    rig = Rig([(0.0, "open"), *((when, b"a") for when in moments)], usb="16u2", boot_s=None)
    rig.bridge.run(seconds=0.1)
    steps = rig.steps
    rig.bridge.run(seconds=0.4)
    came = [when for when, data in rig.line.received if data == b"b"]
    ticks = [when + BOOT_S - PACKET_CYCLES / CLOCK_HZ for when in came]  # since power-up, as the bridge's timer counts
    off = [tick - round(tick / TICK_S) * TICK_S for tick in ticks]
    assert len(came) == 20
    assert max(map(abs, off)) <= LEAST_SLICE_S + 1e-6
    assert all(
        2 * BYTE_S <= answer - when <= 2 * BYTE_S + TICK_S + 1e-4 for when, answer in zip(moments, came, strict=True)
    )
    assert rig.steps - steps <= 0.4 / QUIET_SLICE_S + 0.4 / TICK_S + 2 * 20 + 10


def test_a_delivery_finds_the_chip_nearly_there_and_goes_before_all_other_work():
    """What a delivery waits for is a short run: the chip was brought up to AHEAD_S before, and records come after."""
    rig = Rig([(0.0, "open"), *((0.1 + 0.0131 * n, b"a") for n in range(20))], usb="16u2", boot_s=None)
    rig.bridge.run(seconds=0.1)
    done: list[tuple[str, int]] = []
    run, write, looks = rig.uno.run, rig.line.write, rig.line.baud
    rig.uno.run = lambda cycles: (done.append(("run", cycles)), run(cycles=cycles))
    rig.line.write = lambda data: (done.append(("write", len(data))), write(data))[1]
    rig.line.baud = lambda: (done.append(("look", 0)), looks())[1]
    rig.bridge._follow_baud = True
    rig.bridge._after_run = lambda: done.append(("record", 0))
    rig.bridge.run(seconds=0.4)
    writes = [at for at, (what, _) in enumerate(done) if what == "write"]
    assert len(writes) == 20
    for at in writes:
        assert done[at - 1][0] == "run"
        assert done[at - 1][1] <= 2 * AHEAD_S * CLOCK_HZ
        assert done[at - 2][0] == "record", "nobody looked at the line before this run"
        assert done[at + 1][0] == "record"
    assert sum(what == "look" for what, _ in done) >= 0.4 / (2 * QUIET_SLICE_S), "at other times somebody does"


def test_a_full_ring_is_filled_again_before_it_runs_dry():
    rig = Rig([(0.0, "open"), (0.01, bytes([9] * 2000))], usb="16u2", boot_s=None)
    rig.bridge.run(seconds=0.011)
    emptiest = 10**6

    def watch() -> None:
        nonlocal emptiest
        if rig.line.inbox:
            emptiest = min(emptiest, rig.uno.serial.pending)

    rig.bridge._after_run = watch
    rig.bridge.run(seconds=0.05)
    assert emptiest > 0, "the line is busy for as long as the host has something to say"
