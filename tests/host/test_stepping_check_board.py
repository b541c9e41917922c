"""The certificate's checks of the line and the board, each on the smallest plan that can break it."""

import pytest

from planarm.scene import LinkSpec
from planarm.stepping.check_board import check_board
from planarm.stepping.expand import expand
from planarm.stepping.table import table_of
from planarm_wire.messages import BAUD, Move
from segment_plans import REST, plan_of, verdict_of

LINK = LinkSpec("sim://", BAUD)


def checks_of(plan, link=LINK):
    return check_board(table_of(plan), expand(plan), link)


@pytest.mark.parametrize("slower", [True, False])
def test_segments_must_not_be_shorter_than_the_line_takes_to_bring_them(slower):
    # A segment of one step of one joint: duration (2 or 3 bytes), steps, first (2 bytes), 0: 6 or 7 bytes, and half a
    # frame, shared with another: 3 of header, two checks of 2, delimiter. 10 bits a byte at 250,000 baud, 16 MHz.
    frame_bytes = 7 + (3 + 2 * 2 + 1) // 2
    ticks = frame_bytes * 10 * 16_000_000 // BAUD
    duration = ticks + 200 if slower else ticks - 1000
    checks = checks_of(plan_of(*[(duration, Move(3, 1000), REST)] * 2000))
    assert verdict_of(checks, "ahead of the line") == ("green" if slower else "red")


@pytest.mark.parametrize(
    ("interval_ticks", "segments_hz", "verdict"),
    [
        (320, 500, "red"),  # above the rate at which the board keeps up with both joints at 50 k steps/s
        (320, 333, "green"),
        (800, 800, "red"),  # the same at 20 k
        (800, 600, "green"),
        (8_000, 900, "green"),
    ],
)
def test_the_board_needs_time_to_read_segments(interval_ticks, segments_hz, verdict):
    """firmware/README.md: sustained segments a second fall with the step rate; the check keeps below them."""
    duration = 16_000_000 // segments_hz
    move = Move(2 * (duration // interval_ticks) + 1, 0, interval_ticks << 8)
    checks = checks_of(plan_of(*[(duration, move, move)] * 2000))
    assert verdict_of(checks, "ahead of the board") == verdict


@pytest.mark.parametrize(
    ("duration", "count", "verdict"),
    [(6_000, 40, "red"), (9_000, 40, "red"), (6_000, 2, "green"), (16_000, 40, "green")],
)
def test_segments_that_the_queue_held_at_the_start_must_be_prepared_in_time(duration, count, verdict):
    """tests/firmware/test_firmware_pace.py: 6,000 ticks in a row end in missed_deadline."""
    short = duration, Move(2 * 5 + 1, 100, duration // 5 << 8), REST
    plan = plan_of((400_000, REST, REST), *[short] * count, (400_000, REST, REST))
    assert verdict_of(checks_of(plan), "ahead of the board") == verdict


def test_a_burst_of_short_segments_cannot_be_sent_before_there_is_room():
    # The line is idle for seconds, but the device holds QUEUE_BYTES of segments, about 100 of these, and no more.
    long, short = (10**6, Move(3, 1000), REST), (4000, Move(3, 1000), REST)
    assert verdict_of(checks_of(plan_of(*[long] * 40, *[short] * 31)), "ahead of the line") == "green"
    assert verdict_of(checks_of(plan_of(*[long] * 40, *[short] * 300)), "ahead of the line") == "red"


@pytest.mark.parametrize(("steps", "verdict"), [(500, "green"), (560, "amber"), (710, "amber"), (740, "red")])
def test_interrupts_leave_a_fifth_of_every_5_ms(steps, verdict):
    """75 cycles a step and a tenth for the line: 725 steps in 80,000 ticks are 0.78, 533 are 0.6."""
    interval = 80_000 // (steps // 2)
    move = Move(2 * (steps // 2) + 1, 0, interval << 8)
    plan = plan_of((80_000, move, move), (400_000, REST, REST))
    check = next(check for check in checks_of(plan) if "load" in check.name)
    assert check.value == pytest.approx(0.1 + 75 * steps / 80_000, abs=0.005)
    assert check.verdict == verdict


@pytest.mark.parametrize(
    ("interval", "duration", "both", "verdict"),
    [
        (225, 228_000, True, "green"),
        (225, 114_000, True, "red"),  # a segment is read in every second slice
        (230, 114_000, True, "green"),
        (270, 115_000, True, "red"),  # three slices, of which two are half as long
        (290, 115_000, True, "green"),
        (270, 70_000, True, "red"),  # two, each shorter than what it takes
        (280, 70_000, True, "green"),
        (225, 70_000, False, "green"),
    ],
)
def test_slices_that_are_slowed_down_must_be_ready_in_time(interval, duration, both, verdict):
    """tests/firmware/test_firmware_fast_holds.py: such joints are held in any phase on a full line."""
    move = Move(2 * (duration // interval) + 1, 0, interval << 8)
    plan = plan_of((400_000, REST, REST), *[(duration, move, move if both else REST)] * 40, (400_000, REST, REST))
    assert verdict_of(checks_of(plan), "in a stop") == verdict


def test_time_to_spare_in_a_stop_is_that_where_a_segment_is_fastest():
    """Segments that speed up from 400 to 225 ticks and slow down again, beside the same number of steps at one rate."""

    def spare_of(*moves):
        plan = plan_of((400_000, REST, REST), *[(228_000, move, move) for move in moves] * 10, (400_000, REST, REST))
        return next(check.value for check in checks_of(plan) if "in a stop" in check.name)

    steps = 2 * 228_000 // (400 + 225)
    add = round((225 - 400) / (steps - 1) * 2**16)
    up, down = Move(2 * steps + 1, 10, 400 << 8, add), Move(2 * steps + 1, 10, 225 << 8, -add)
    on_average = Move(2 * steps + 1, 10, 228_000 // (steps + 1) << 8)
    fastest = Move(2 * 1013 + 1, 0, 225 << 8)
    assert spare_of(fastest) < spare_of(up, down) < 0.6 * spare_of(on_average)


@pytest.mark.parametrize(("segments_hz", "verdict"), [(300, "green"), (840, "amber"), (1500, "red")])
def test_the_peak_of_the_line_leaves_room_for_lost_frames(segments_hz, verdict):
    """Seven bytes and half a frame's eleven are 12.5 a segment; 25,000 a second come, with replies 11,000."""
    plan = plan_of(*[(16_000_000 // segments_hz, Move(3, 1000), REST)] * 2000)
    check = next(check for check in checks_of(plan) if "peak" in check.name)
    assert check.verdict == verdict
    assert check.value == pytest.approx(12.5 * segments_hz / 25_000, rel=0.1)


@pytest.mark.parametrize(("segments_hz", "verdict"), [(300, "green"), (1200, "red")])
def test_the_bandwidth_margin_is_what_is_carried_by_what_is_asked(segments_hz, verdict):
    """12.5 bytes a segment; the longer the motion, the less the full queue at its start helps."""
    plan = plan_of(*[(16_000_000 // segments_hz, Move(3, 1000), REST)] * 20_000)
    check = next(check for check in checks_of(plan) if "margin" in check.name)
    assert check.verdict == verdict
    assert check.value == pytest.approx(11_000 / (12.5 * segments_hz), rel=0.05)


def test_what_fits_into_the_queue_asks_nothing_of_the_line():
    assert not [check for check in checks_of(plan_of((10**6, Move(3, 1000), REST))) if "margin" in check.name]
