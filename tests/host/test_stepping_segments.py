"""Compression: every rule of the wire and every tolerance, on trains of real motions, random ones and nasty ones."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motion_paths import joint, tip_path, tip_points
from planarm.errors import TimingError
from planarm.stepping.quantise import quantise
from planarm.stepping.segments import Coding, compress, expand
from planarm.stepping.train import JointSteps, StepTrain, least_reversal_ticks
from planarm.trajectory.timing import time_path
from planarm_wire.codec import decode, encode
from planarm_wire.messages import (
    BOARDS,
    MAX_COARSE_STEPS,
    MAX_INTERVAL_TICKS,
    MAX_SEGMENT_STEPS,
    MAX_SEGMENT_TICKS,
    MIN_DIR_SETUP_TICKS,
    MIN_INTERVAL_TICKS,
    MIN_SLOW_INTERVAL_TICKS,
    SLOW_INTERVAL_TICKS,
    Segments,
)
from planarm_wire.steps import LONGEST_INTERVAL_TICKS, expand_moves
from planarm_wire.wirings import board_of

WITHOUT_FAST_MOTORS = Coding()
MIN_REVERSAL_TICKS = least_reversal_ticks(BOARDS["uno"])
LIMITS = (MIN_SLOW_INTERVAL_TICKS, MAX_INTERVAL_TICKS, LONGEST_INTERVAL_TICKS)
NO_STEPS = JointSteps(np.zeros(0, np.int64), np.zeros(0, np.int8))


def steps_of(gaps, directions=None):
    """One joint's steps from the gaps before each."""
    ticks = np.cumsum(np.asarray(gaps, np.int64))
    return JointSteps(ticks, np.ones(len(ticks), np.int8) if directions is None else np.array(directions, np.int8))


def train_of(*steps, after=1):
    last = max((int(one.ticks[-1]) for one in steps if len(one.ticks)), default=0)
    return StepTrain(tuple(range(len(steps))), steps, last + after)


def tolerance(ticks, coding=WITHOUT_FAST_MOTORS):
    """1 us, at most 4 % of the shorter of the intervals around each step; or 2 % of it."""
    gaps = np.diff(ticks)
    if not len(gaps):
        return np.full(len(ticks), coding.ticks)
    shorter = np.minimum(np.r_[gaps[:1], gaps], np.r_[gaps, gaps[-1:]])
    return np.floor(np.maximum(coding.share * shorter, np.minimum(coding.ticks, coding.most_share * shorter)))


def check_everything(train, coding=WITHOUT_FAST_MOTORS):
    """Compress, expand in two ways, and check counts, directions, times and the wire's rules."""
    plan = compress(train, coding)
    begin = 0
    ticks, directions = [[], []], [[], []]
    rest = [None, None]
    for k, segment in enumerate(plan.segments):
        duration = segment.duration_flags >> 1
        assert 0 < duration <= MAX_SEGMENT_TICKS
        assert bool(segment.duration_flags & 1) == (k == len(plan.segments) - 1)
        assert decode(*encode(Segments(0, 0, 0, (segment,)))).segments == (segment,)
        for j, (move, relative) in enumerate(zip(segment.moves, expand_moves(segment), strict=True)):
            count, sign = move.steps_dir >> 1, 1 if move.steps_dir & 1 else -1
            assert count == len(relative) <= MAX_SEGMENT_STEPS
            if not count:
                continue
            assert relative[0] >= 0
            assert relative[-1] < duration
            if count > 1:
                slow = move.interval_q8 >= SLOW_INTERVAL_TICKS << 8
                unit = 256 if count <= MAX_COARSE_STEPS else 65536
                assert -32768 <= move.add / unit < 32768 or slow
                ends = move.interval_q8 / 256, move.interval_q8 / 256 + (count - 2) * move.add / unit
                assert min(ends) >= (MIN_SLOW_INTERVAL_TICKS if slow else MIN_INTERVAL_TICKS)
                assert max(ends) <= (LONGEST_INTERVAL_TICKS if slow else MAX_INTERVAL_TICKS)
                assert count <= MAX_COARSE_STEPS or not slow
            if rest[j] is None:
                assert begin + relative[0] >= MIN_DIR_SETUP_TICKS
            if rest[j] is not None:
                least = MIN_REVERSAL_TICKS if rest[j][1] != sign else MIN_INTERVAL_TICKS
                assert begin + relative[0] - rest[j][0] >= least
            rest[j] = begin + relative[-1], sign
            ticks[j] += [begin + t for t in relative]
            directions[j] += [sign] * count
        begin += duration
    assert begin == plan.duration_ticks == train.duration_ticks
    made = expand(plan)
    assert made.start_usteps == train.start_usteps
    check_fast_segments_are_short(plan, made, coding)
    for j, wanted in enumerate(train.steps):
        assert made.steps[j].ticks.tolist() == ticks[j]
        assert directions[j] == made.steps[j].directions.tolist() == wanted.directions.tolist()
        assert (np.abs(made.steps[j].ticks - wanted.ticks) <= tolerance(wanted.ticks, coding)).all()
        along = np.diff(wanted.directions) == 0
        if along.any():
            assert np.diff(made.steps[j].ticks)[along].min() >= np.diff(wanted.ticks)[along].min()
    return plan


def check_fast_segments_are_short(plan, made, coding):
    """Every segment longer than the limit overlaps no interval of a motor above its start-stop speed."""
    ends = np.cumsum([segment.duration_flags >> 1 for segment in plan.segments])
    begins = np.concatenate([[0], ends[:-1]])
    for steps, start_stop in zip(made.steps, coding.start_stop_ticks, strict=False):
        fast = np.diff(steps.ticks) < 0.96 * start_stop  # the tolerance may have made a slow one fast
        for begin, end in zip(steps.ticks[:-1][fast], steps.ticks[1:][fast], strict=True):
            over = (begins < end) & (ends > begin)
            assert (ends - begins)[over].max() <= coding.fast_ticks


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), capped=st.booleans())
def test_trains_of_motions(seed, capped):
    check_everything(train_of_motion(seed), Coding.of([joint(), joint()]) if capped else WITHOUT_FAST_MOTORS)


def test_motions_take_few_segments():
    """Over many motions; a slow one alone may need more, since a step after a long pause has a segment to itself."""
    trains = [train_of_motion(seed) for seed in range(12)]
    segments = sum(len(compress(train).segments) for train in trains)
    assert segments < 0.03 * sum(len(one.ticks) for train in trains for one in train.steps)


def train_of_motion(seed):
    joints = [joint(), joint()]
    return quantise(time_path(tip_path(tip_points(np.random.default_rng(seed), 5)), joints), joints)


@st.composite
def nasty_steps(draw):
    """Random directions, and gaps of all sizes, many of them exactly at a limit or close to it."""
    gap = st.one_of(
        st.integers(0, 40),
        st.integers(0, 2000),
        st.integers(0, 200_000),
        st.sampled_from(
            [0, 320, *(longest - 800 for longest in LIMITS), *(longest - 799 for longest in LIMITS), 10**7]
        ),
    )
    count = draw(st.integers(0, 60))
    spare = draw(st.lists(gap, min_size=count, max_size=count))
    directions = draw(st.lists(st.sampled_from([1, 1, 1, -1]), min_size=count, max_size=count))
    gaps = [
        more + (MIN_DIR_SETUP_TICKS if n == 0 else MIN_REVERSAL_TICKS if directions[n] != directions[n - 1] else 800)
        for n, more in enumerate(spare)
    ]
    return steps_of(gaps, directions)


@settings(max_examples=300, deadline=None)
@given(
    first=nasty_steps(),
    second=nasty_steps(),
    after=st.sampled_from([1, 2, 1000, 10**6]),
    start_stop=st.sampled_from([0, 0, 2_000, 100_000, 10**7]),
)
def test_nasty_trains(first, second, after, start_stop):
    check_everything(train_of(first, second, after=after), Coding(start_stop_ticks=(start_stop, start_stop)))


@pytest.mark.parametrize("coding", [Coding(share=0.0, most_share=1.0), Coding(ticks=400, share=0.0, most_share=1.0)])
def test_other_tolerances_are_kept(coding):
    check_everything(train_of_motion(5), coding)


def test_three_and_four_joints_share_segments():
    rng = np.random.default_rng(4)
    for joints, wiring in ((1, "own"), (3, "own"), (4, "own"), (2, "cnc_shield"), (3, "cnc_shield"), (4, "cnc_shield")):
        steps = [random_nasty_steps(rng, board_of(joints, wiring)) for _ in range(joints)]
        train = replace(train_of(*steps), wiring=wiring)
        plan = compress(train)
        made = expand(plan)
        assert {len(segment.moves) for segment in plan.segments} == {plan.board.joints} == {train.board.joints}
        assert made.duration_ticks == train.duration_ticks
        for wanted, one in zip(steps, made.steps, strict=True):
            assert one.directions.tolist() == wanted.directions.tolist()
            assert (np.abs(one.ticks - wanted.ticks) <= tolerance(wanted.ticks)).all()


@settings(max_examples=60, deadline=None)
@given(steps=nasty_steps(), shift=st.integers(-3, 3), other=st.sampled_from([1, -1]))
def test_joints_that_step_at_nearly_the_same_ticks(steps, shift, other):
    later = JointSteps(steps.ticks + 3, steps.directions)
    moved = JointSteps(later.ticks + shift, (steps.directions * other).astype(np.int8))
    check_everything(train_of(later, moved, after=10))


@pytest.mark.parametrize("seed", range(4))
def test_counts_are_exact_over_many_steps(seed, sized):
    # Speeds that wander between 200 and 20,000 steps/s, with reversals.
    rng = np.random.default_rng(seed)
    joints = []
    for _ in range(2):
        count = sized(60_000, 600_000)
        wander = np.abs((np.cumsum(rng.normal(0.0, 0.003, count)) + 1.5) % 3.0 - 1.5)  # between 0 and 1.5, to and fro
        gaps = (800.0 * np.exp(3.0 * wander)).astype(np.int64)
        directions = np.where(np.cumsum(rng.random(count) < 2e-4) % 2 == 0, 1, -1)
        gaps[1:][np.diff(directions) != 0] += 50_000
        gaps[0] += 320
        joints.append(steps_of(gaps, directions))
    plan = check_everything(train_of(*joints))
    assert len(plan.segments) < 0.2 * sum(len(steps.ticks) for steps in joints)


@pytest.mark.parametrize("seed", [382, 1226])
def test_a_step_taken_out_of_turn_is_not_taken_twice(seed):
    """Trains in which a segment has to take a joint's step before earlier steps of the other joint."""
    rng = np.random.default_rng(seed)
    check_everything(train_of(random_nasty_steps(rng), random_nasty_steps(rng)))


def random_nasty_steps(rng, board=BOARDS["uno"]):
    """Gaps of all sizes, as `nasty_steps`, but drawn evenly: Hypothesis seldom finds what needs many odd gaps."""
    count = int(rng.integers(0, 60))
    directions = rng.choice([1, 1, 1, -1], count)
    spare = [
        int(
            rng.choice(
                [rng.integers(41), rng.integers(2001), rng.integers(200_001), rng.choice([0, 320, 64_735, 261_343])]
            )
        )
        for _ in range(count)
    ]
    turns = np.diff(directions, prepend=directions[:1]) != 0
    least = np.where(turns, least_reversal_ticks(board), max(800, board.min_interval_ticks))
    least[:1] = MIN_DIR_SETUP_TICKS
    return steps_of(least + np.array(spare, np.int64), directions)


def test_constant_speed_is_one_segment_for_all_steps_that_fit():
    # 3141.59 ticks a step: whole ticks in the train, one interval in Q16 on the wire.
    ticks = np.floor(1000 + 3141.59 * np.arange(50_000)).astype(np.int64)
    plan = check_everything(train_of(JointSteps(ticks, np.ones(50_000, np.int8)), NO_STEPS))
    assert len(plan.segments) <= 4  # 32,767 at most in one; the train's end and start may take one each


def test_top_speed_after_a_ramp_takes_few_segments():
    # The interval falls to its least value and stays: fits must not undercut it.
    ramp = np.maximum(3141.59, 16e6 / np.sqrt(2.0 * 20_000 * (np.arange(4000) + 1.0)))
    ticks = np.floor(np.cumsum(ramp)).astype(np.int64)
    plan = check_everything(train_of(JointSteps(ticks, np.ones(4000, np.int8)), NO_STEPS))
    assert len(plan.segments) < 40


def test_a_lone_step_after_a_long_gap_is_a_segment_of_one_step():
    plan = check_everything(train_of(steps_of([1000, 5_000_000]), NO_STEPS))
    assert [segment.moves[0].steps_dir >> 1 for segment in plan.segments] == [1, 1]


def test_rests_longer_than_a_segment_are_divided():
    plan = check_everything(
        train_of(steps_of([3 * MAX_SEGMENT_TICKS, 2 * MAX_SEGMENT_TICKS]), NO_STEPS, after=MAX_SEGMENT_TICKS * 2)
    )
    assert len(plan.segments) >= 7


def test_a_motion_without_steps_is_a_rest():
    plan = check_everything(StepTrain((3, 4), (NO_STEPS, NO_STEPS), 123_456))
    assert [segment.duration_flags for segment in plan.segments] == [2 * 123_456 + 1]


def test_no_motion_is_no_segment():
    plan = compress(StepTrain((3, 4), (NO_STEPS, NO_STEPS), 0))
    assert plan.segments == ()
    assert plan.start_usteps == (3, 4)


def test_what_the_firmware_cannot_step_is_refused():
    with pytest.raises(TimingError, match="joint 2"):
        compress(train_of(NO_STEPS, steps_of([1000, 200])))
