"""The certificate's checks of the segments against the wire's limits, each on the smallest plan that can break it."""

import numpy as np
import pytest

from planarm.stepping.check_wire import check_wire
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.table import segment_bytes, table_of
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import BOARDS, MIN_INTERVAL_TICKS, Move, Segment
from segment_plans import REST, plan_of, verdict_of


def checks_of(plan):
    return check_wire(plan, table_of(plan), BOARDS["uno"])


@pytest.mark.parametrize(("first_ticks", "verdict"), [(320, "green"), (319, "red")])
def test_dir_setup_counts_from_the_start_of_the_motion(first_ticks, verdict):
    """Later the firmware changes DIR right after the step before: that is the reversal time, checked on the steps."""
    forth, back, on = Move(3, first_ticks), Move(2, 10), Move(2, 10)
    checks = checks_of(plan_of((5000, forth, REST), (5000, back, REST), (5000, on, REST)))
    assert verdict_of(checks, "DIR setup") == verdict
    assert verdict_of(checks, "wire limits") == "green"


@pytest.mark.parametrize(
    ("segment", "words"),
    [
        ((0, REST, REST), "duration 0"),
        ((1 << 30, REST, REST), "duration"),
        ((5000, Move(3, 5000), REST), "outside"),
        ((5000, REST, Move(5, 1000, (MIN_INTERVAL_TICKS << 8) - 1)), "intervals of joint 2"),
        ((200_000, REST, Move(7, 1000, 65_000 << 8, 536 << 8)), "intervals of joint 2"),
        ((200_000, REST, Move(7, 1000, 65_536 << 8, (32_767 - 65_536) << 8)), "intervals of joint 2"),
        ((1 << 26, REST, Move(7, 1000, 65_536 << 8, 0xFF0000 << 8)), "intervals of joint 2"),
        ((1 << 29, Move(2 * 129, 500, 65_536 << 8), REST), "129 slow steps of joint 1"),
        ((200_000, REST, Move(9, 1000, (MIN_INTERVAL_TICKS + 100) << 8, -(60 << 8))), "intervals of joint 2"),
        ((5000, REST, Move(7, 100, 900 << 8, 1 << 23)), "add of joint 2"),
        ((1 << 29, Move(2 * 32_768, 500, 1000 << 8), REST), "32768 steps of joint 1"),
    ],
)
def test_each_limit_of_the_wire_is_kept(segment, words):
    check = next(check for check in checks_of(plan_of(segment)) if "wire limits" in check.name)
    assert check.verdict == "red"
    assert words in check.where


def test_the_plans_own_duration_is_that_of_its_segments():
    plan = plan_of((5000, REST, REST))
    longer = SegmentPlan(plan.segments, 5001, plan.start_usteps)
    assert verdict_of(checks_of(longer), "duration") == "red"


def test_bytes_are_those_of_the_codec():
    rng = np.random.default_rng(3)
    moves = [
        Move(int(s), int(f) if s >= 2 else 0, int(i) if s >= 4 else 0, int(a) if s >= 4 else 0)
        for s, f, i, a in zip(
            2 ** rng.uniform(0, 16, 400) - 1,
            2 ** rng.uniform(0, 30, 400) - 1,
            2 ** rng.uniform(0, 32, 400) - 1,
            rng.choice([-1, 1], 400) * (2 ** rng.uniform(0, 31, 400) - 1),
            strict=True,
        )
    ]
    segments = [Segment(int(2 ** rng.uniform(1, 31)), pair) for pair in zip(moves[::2], moves[1::2], strict=True)]
    plan = SegmentPlan(tuple(segments), 0, (0, 0))
    assert segment_bytes(table_of(plan)).tolist() == [encoded_bytes(segment) for segment in segments]
