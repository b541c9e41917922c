"""Certificate: the segments themselves, against the wire's limits."""

from collections.abc import Iterator

import numpy as np

from planarm.scene import Scene
from planarm.scene.pulses import TICKS_US, low_ticks, pulse_ticks
from planarm.stepping.certificate import Check, at_least, at_most
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.table import SegmentTable
from planarm.stepping.train import StepTrain
from planarm_wire.boards import Board
from planarm_wire.messages import (
    MAX_COARSE_STEPS,
    MAX_INTERVAL_TICKS,
    MAX_SEGMENT_STEPS,
    MAX_SEGMENT_TICKS,
    MAX_SLOW_INTERVAL_TICKS,
    MIN_DIR_SETUP_TICKS,
    MIN_SLOW_INTERVAL_TICKS,
)
from planarm_wire.steps import step_count


def check_wire(plan: SegmentPlan, table: SegmentTable, board: Board) -> list[Check]:
    """Check every segment against the wire's limits on a board, and the time for DIR before the first steps."""
    broken = [*_other_board(plan, table, board), *_problems(table)]
    flagged = np.flatnonzero(table.is_last).tolist()
    if flagged != [len(plan.segments) - 1][: len(plan.segments)]:
        broken.append(f"segments flagged as last: {flagged}")
    total = int(table.durations.sum())
    checks = [
        at_most("wire limits broken", len(broken), 0, "segments", broken[0] if broken else ""),
        at_most("segments' duration less planned", abs(total - plan.duration_ticks), 0, "ticks"),
    ]
    firsts = list(_first_steps(table))
    if firsts:
        ticks, where = min(firsts)
        setting = "joints.max_acceleration_deg_s2"
        checks.append(at_least("DIR setup time at the start", ticks, MIN_DIR_SETUP_TICKS, "ticks", where, setting))
    return checks


def check_pulses(scene: Scene, made: StepTrain) -> list[Check]:
    """Check that every driver's pulses are as long as it needs them."""
    board, checks = scene.board, []
    for number, (joint, steps) in enumerate(zip(scene.joints, made.steps, strict=True), start=1):
        row = joint.driver_row
        apart = int(np.diff(steps.ticks).min()) if len(steps.ticks) > 1 else MAX_INTERVAL_TICKS
        for level, ticks, needed_s, setting in (
            ("high", board.min_step_high_ticks, row.step_high_s, "joints.driver or board.wiring"),
            ("low", low_ticks(board, apart), row.step_low_s, "joints.max_speed_deg_s, joints.driver or board.wiring"),
        ):
            name, needed = f"joint {number} step pulses {level}", pulse_ticks(needed_s)
            checks.append(at_least(name, ticks / TICKS_US, needed / TICKS_US, "us", "", setting))
    return checks


def _other_board(plan: SegmentPlan, table: SegmentTable, board: Board) -> Iterator[str]:
    """Yield in what the segments are not of the board's form; joints beyond the arm's must rest."""
    if plan.board != board:
        yield f"segments made for the board {plan.board.name}, the scene's is {board.name}"
    joints = table.counts.shape[1]
    for k, segment in enumerate(plan.segments):
        if len(segment.moves) != board.joints:
            yield f"segment {k}: moves of {len(segment.moves)} joints, {board.name} has {board.joints}"
        elif any(step_count(move) for move in segment.moves[joints:]):
            yield f"segment {k}: steps of joints that the arm does not have"


def _problems(table: SegmentTable) -> Iterator[str]:
    """Yield the wire's limits that segments break."""
    several = table.counts > 1
    inner = np.stack([table.interval_q16, table.last_interval_q16]) / 65536
    shortest, longest = inner.min(axis=0), inner.max(axis=0)
    least = np.where(table.slow, MIN_SLOW_INTERVAL_TICKS, table.board.min_interval_ticks)
    most = np.where(table.slow, MAX_SLOW_INTERVAL_TICKS, MAX_INTERVAL_TICKS)
    add = np.where(table.slow, table.add, table.add_q16)  # that the device keeps in 32 bits
    outside = (table.first < 0) | (table.last_ticks < table.first) | (table.last_ticks >= table.durations[:, None])
    rules = (
        ((table.durations <= 0) | (table.durations > MAX_SEGMENT_TICKS), "duration {}", table.durations),
        (table.counts > MAX_SEGMENT_STEPS, "{} steps of joint {}", table.counts),
        (table.slow & (table.counts > MAX_COARSE_STEPS), "{} slow steps of joint {}", table.counts),
        (several & ((shortest < least) | (longest >= most + 1)), "intervals of joint {1}", table.counts),
        (several & (np.abs(2 * add + 1) >> 32 > 0), "add of joint {1}", table.counts),
        ((table.counts > 0) & outside, "step of joint {1} outside the segment", table.counts),
    )
    for breaks, words, values in rules:
        for at in np.argwhere(breaks):
            number = int(at[1]) + 1 if len(at) > 1 else 0
            yield f"segment {at[0]}: {words.format(values[tuple(at)], number)}"


def _first_steps(table: SegmentTable) -> Iterator[tuple[int, str]]:
    """Yield the time from the motion's start, when DIR is set, to each joint's first step, and where that is."""
    starts = table.starts
    for j in range(table.counts.shape[1]):
        moving = np.flatnonzero(table.counts[:, j])
        if len(moving):
            k = int(moving[0])
            yield int(starts[k] + table.first[k, j]), f"segment {k}, joint {j + 1}"
