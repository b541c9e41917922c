"""Certificate: the segments themselves, against the wire's limits."""

from collections.abc import Iterator

import numpy as np

from planarm.scene import JointSpec
from planarm.stepping.certificate import Check, at_least, at_most
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.table import SegmentTable
from planarm.stepping.train import StepTrain, Ticks
from planarm_wire.messages import (
    MAX_INTERVAL_TICKS,
    MAX_SEGMENT_STEPS,
    MAX_SEGMENT_TICKS,
    MIN_DIR_SETUP_TICKS,
    MIN_INTERVAL_TICKS,
    TICKS_HZ,
)

CALM_SEGMENT_TICKS = 65_536
"""Longest segment in which a motor may be faster than its start-stop speed: the device changes the path clock's rate
from segment to segment."""

START_STOP_SHARE = 0.96
"""A motor counts as fast from this share of the start-stop interval on: the permitted timing error moves both ends."""


def check_wire(plan: SegmentPlan, table: SegmentTable) -> list[Check]:
    """Check every segment against the wire's limits, and the DIR setup times."""
    broken = list(_problems(table))
    flagged = np.flatnonzero(table.is_last).tolist()
    if flagged != [len(plan.segments) - 1][: len(plan.segments)]:
        broken.append(f"segments flagged as last: {flagged}")
    total = int(table.durations.sum())
    checks = [
        at_most("wire limits broken", len(broken), 0, "segments", broken[0] if broken else ""),
        at_most("segments' duration less planned", abs(total - plan.duration_ticks), 0, "ticks"),
    ]
    setups = list(_dir_setups(table))
    if setups:
        ticks, where = min(setups)
        setting = "joints.max_acceleration_deg_s2"
        checks.append(at_least("DIR setup time", ticks, MIN_DIR_SETUP_TICKS, "ticks", where, setting))
    return checks


def _problems(table: SegmentTable) -> Iterator[str]:
    """Yield the wire's limits that segments break."""
    several = table.counts > 1
    inner = np.stack([table.interval_q16, table.last_interval_q16]) / 65536
    least, most = inner.min(axis=0), inner.max(axis=0)
    outside = (table.first < 0) | (table.last_ticks < table.first) | (table.last_ticks >= table.durations[:, None])
    rules = (
        ((table.durations <= 0) | (table.durations > MAX_SEGMENT_TICKS), "duration {}", table.durations),
        (table.counts > MAX_SEGMENT_STEPS, "{} steps of joint {}", table.counts),
        (
            several & ((least < MIN_INTERVAL_TICKS) | (most > MAX_INTERVAL_TICKS)),
            "intervals of joint {1}",
            table.counts,
        ),
        ((table.add_q16 < -(1 << 31)) | (table.add_q16 >= 1 << 31), "add of joint {1}", table.counts),
        ((table.counts > 0) & outside, "step of joint {1} outside the segment", table.counts),
    )
    for breaks, words, values in rules:
        for at in np.argwhere(breaks):
            number = int(at[1]) + 1 if len(at) > 1 else 0
            yield f"segment {at[0]}: {words.format(values[tuple(at)], number)}"


def _dir_setups(table: SegmentTable) -> Iterator[tuple[int, str]]:
    """Yield the time from the start of a segment that may change DIR to its step, for each joint, and where."""
    for j in range(table.counts.shape[1]):
        moving = np.flatnonzero(table.counts[:, j])
        turns = np.diff(table.positive[moving, j], prepend=-1) != 0
        for k in moving[turns].tolist():
            yield int(table.first[k, j]), f"segment {k}, joint {j + 1}"


def check_calm(table: SegmentTable, made: StepTrain, axes: tuple[JointSpec, ...]) -> Check:
    """Check that segments are short where a motor is faster than its start-stop speed, sqrt(2 a) micro-steps/s."""
    starts = table.starts
    long = np.flatnonzero(table.durations > CALM_SEGMENT_TICKS)
    worst, where = 0, ""
    for number, (steps, axis) in enumerate(zip(made.steps, axes, strict=True), start=1):
        start_stop = TICKS_HZ / np.sqrt(2.0 * axis.max_acceleration_rad_s2 * axis.usteps_per_rad)
        fast = np.flatnonzero(np.diff(steps.ticks) < START_STOP_SHARE * start_stop)
        begins, ends = steps.ticks[fast], steps.ticks[fast + 1]
        # A long segment overlaps a fast interval when the first that ends after its start begins before its end.
        following = np.searchsorted(ends, starts[long], side="right")
        inside = following < len(fast)
        hit: Ticks = long[inside][begins[following[inside]] < starts[long[inside] + 1]]
        if len(hit) and table.durations[hit].max() > worst:
            k = int(hit[table.durations[hit].argmax()])
            worst, where = int(table.durations[k]), f"segment {k}, joint {number}"
    name = "longest segment above a start-stop speed"
    return at_most(name, worst, CALM_SEGMENT_TICKS, "ticks", where)
