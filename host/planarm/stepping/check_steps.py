"""Certificate, part one: the steps themselves, taken from the expanded segments."""

import numpy as np

from planarm.scene import JointSpec
from planarm.stepping.certificate import Check, at_least, at_most
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import JointSteps, StepTrain, Ticks
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import (
    BAUD,
    CRC_BYTES,
    HEADER_BYTES,
    MAX_INTERVAL_TICKS,
    MAX_SEGMENT_STEPS,
    MAX_SEGMENT_TICKS,
    MIN_DIR_SETUP_TICKS,
    MIN_INTERVAL_TICKS,
    QUEUE_SLOTS,
    TICKS_HZ,
    Move,
    Segment,
)

BITS_PER_BYTE = 10
"""On the line: start bit, eight bits, stop bit."""

STEP_INTERRUPT_TICKS = 104
LINE_LOAD = 0.1
READ_TICKS = 15_000
LATEST_READ_TICKS = 20_000
LEAST_SHARE = 0.05
"""What the board takes, measured on the emulator (firmware/README.md, budgets): a step's interrupt; the share of the
line's interrupts; the main program's work on a segment, from the rates at which it just keeps up (12,000 to 15,000);
and how long before its start a segment must be there. The last keeps an overloaded board's time finite."""

TIMING_SHARE = 0.02
TIMING_TICKS = 16
"""Permitted error of a step's time: 1 us, or this share of the shorter interval around it if that is more."""


def check_counts(train: StepTrain, made: StepTrain, number: int) -> list[Check]:
    """Check that joint `number`, from 1, makes exactly the quantised steps, and each of them in time."""
    wanted, steps = train.steps[number - 1], made.steps[number - 1]
    name = f"joint {number}"
    end = made.end_usteps[number - 1], train.end_usteps[number - 1]
    checks = [at_most(f"{name} end position less planned", abs(end[0] - end[1]), 0, "usteps", f"{end[0]} usteps")]
    if not np.array_equal(wanted.directions, steps.directions):
        length = min(len(wanted.directions), len(steps.directions))
        differ = np.flatnonzero(wanted.directions[:length] != steps.directions[:length])
        first = int(differ[0]) if len(differ) else length
        count = len(differ) + abs(len(wanted.directions) - len(steps.directions))
        return [*checks, at_most(f"{name} steps that differ from the plan", count, 0, "steps", f"step {first}")]
    checks.append(at_most(f"{name} steps that differ from the plan", 0, 0, "steps"))
    if not len(steps.ticks):
        return checks
    error = np.abs(steps.ticks - wanted.ticks)
    around = np.diff(wanted.ticks, prepend=-(1 << 62), append=1 << 62)
    shorter = np.minimum(around[:-1], around[1:])
    shorter = np.where(shorter > 1 << 60, 0, shorter)  # a lone step has no interval
    allowed = np.maximum(TIMING_TICKS, np.floor(TIMING_SHARE * shorter))
    worst = int(np.argmax(error / allowed))
    where = _time(wanted.ticks[worst])
    return [*checks, at_most(f"{name} timing error", int(error[worst]), int(allowed[worst]), "ticks", where)]


def check_gaps(made: StepTrain, joints: tuple[JointSpec, ...], number: int) -> list[Check]:
    """Check the least times between steps of joint `number`, from 1, in one direction and at reversals."""
    steps, joint = made.steps[number - 1], joints[number - 1]
    gaps, turns = np.diff(steps.ticks), np.diff(steps.directions) != 0
    checks = []
    if (~turns).any():
        fastest = TICKS_HZ / (joint.max_speed_rad_s * joint.usteps_per_rad)
        limit = max(MIN_INTERVAL_TICKS, int(fastest))  # in whole ticks
        least = int(np.argmin(np.where(turns, 1 << 62, gaps)))
        setting = f"joints[{number}].max_speed_deg_s"
        checks.append(
            at_least(f"joint {number} step interval", gaps[least], limit, "ticks", _time(steps.ticks[least]), setting)
        )
    if turns.any():
        least = int(np.argmin(np.where(turns, gaps, 1 << 62)))
        limit = MIN_INTERVAL_TICKS + MIN_DIR_SETUP_TICKS
        setting = f"joints[{number}].max_acceleration_deg_s2"
        checks.append(
            at_least(f"joint {number} reversal time", gaps[least], limit, "ticks", _time(steps.ticks[least]), setting)
        )
    if len(gaps) > 1:
        checks.append(_check_acceleration(steps, joint, number))
    return checks


def _check_acceleration(steps: JointSteps, joint: JointSpec, number: int) -> Check:
    """Check the acceleration that the steps themselves show.

    At each step the joint passes the middle between two micro-steps, at a known time. Three such points have a second
    divided difference that is the acceleration at some moment between them, whatever the motion. They are taken so far
    apart that the permitted timing error, 0.025 micro-steps, changes it by some 2 % of the limit only.
    """
    after = np.cumsum(steps.directions, dtype=np.int64)
    middles = after - 0.5 * steps.directions
    limit = joint.max_acceleration_rad_s2
    apart = int(TICKS_HZ * np.sqrt(4.5 / (limit * joint.usteps_per_rad)))
    before = np.searchsorted(steps.ticks, steps.ticks - apart, side="right") - 1
    behind = np.searchsorted(steps.ticks, steps.ticks + apart, side="left")
    at = np.flatnonzero((before >= 0) & (behind < len(steps.ticks)))
    name, setting = f"joint {number} acceleration of the steps", f"joints[{number}].max_acceleration_deg_s2"
    if not len(at):
        return at_most(name, 0.0, limit, "rad/s^2", "", setting)
    t_s = [steps.ticks[i] / TICKS_HZ for i in (before[at], at, behind[at])]
    x = [middles[i] / joint.usteps_per_rad for i in (before[at], at, behind[at])]
    slopes = (x[1] - x[0]) / (t_s[1] - t_s[0]), (x[2] - x[1]) / (t_s[2] - t_s[1])
    acceleration = np.abs(2.0 * (slopes[1] - slopes[0]) / (t_s[2] - t_s[0]))
    worst = int(np.argmax(acceleration))
    return at_most(name, acceleration[worst], limit, "rad/s^2", _time(steps.ticks[at[worst]]), setting)


def check_wire(plan: SegmentPlan) -> list[Check]:
    """Check every segment against the wire's limits, DIR setup times, and the line's speed."""
    broken = [f"segment {k}: {problem}" for k, segment in enumerate(plan.segments) for problem in _problems(segment)]
    flagged = [k for k, segment in enumerate(plan.segments) if segment.duration_flags & 1]
    if flagged != [len(plan.segments) - 1][: len(plan.segments)]:
        broken.append(f"segments flagged as last: {flagged}")
    total = sum(segment.duration_flags >> 1 for segment in plan.segments)
    checks = [
        at_most("wire limits broken", len(broken), 0, "segments", broken[0] if broken else ""),
        at_most("segments' duration less planned", abs(total - plan.duration_ticks), 0, "ticks"),
    ]
    setups = list(_dir_setups(plan))
    if setups:
        ticks, where = min(setups)
        checks.append(at_least("DIR setup time", ticks, MIN_DIR_SETUP_TICKS, "ticks", where))
    if plan.segments:
        checks += _check_supply(plan)
    return checks


def _problems(segment: Segment) -> list[str]:
    """Return the wire's limits that a segment breaks."""
    duration = segment.duration_flags >> 1
    problems = [] if 0 < duration <= MAX_SEGMENT_TICKS else [f"duration {duration}"]
    for number, move in enumerate(segment.moves, start=1):
        count = move.steps_dir >> 1
        intervals = [move.interval_q16, move.interval_q16 + (count - 2) * move.add_q16] if count > 1 else []
        if count > MAX_SEGMENT_STEPS:
            problems.append(f"{count} steps of joint {number}")
        if any(not MIN_INTERVAL_TICKS <= i / 65536 <= MAX_INTERVAL_TICKS for i in intervals):
            problems.append(f"intervals of joint {number}")
        if not -(1 << 31) <= move.add_q16 < 1 << 31:
            problems.append(f"add of joint {number}")
        if count and not 0 <= move.first_ticks <= _last_tick(move) < duration:
            problems.append(f"step of joint {number} outside the segment")
    return problems


def _last_tick(move: Move) -> int:
    n = (move.steps_dir >> 1) - 1
    return move.first_ticks + (n * move.interval_q16 + n * (n - 1) // 2 * move.add_q16) // 65536


def _dir_setups(plan: SegmentPlan) -> list[tuple[int, str]]:
    """Return the time from the start of a segment that may change DIR to its step, for each joint, and where."""
    found = []
    last = [-1] * len(plan.start_usteps)
    for k, segment in enumerate(plan.segments):
        for j, move in enumerate(segment.moves):
            if move.steps_dir >= 2:
                if move.steps_dir & 1 != last[j]:
                    found.append((move.first_ticks, f"segment {k}, joint {j + 1}"))
                last[j] = move.steps_dir & 1
    return found


def _check_supply(plan: SegmentPlan) -> list[Check]:
    """Check that the line brings every segment before it starts, each in a frame of its own, and the board reads it.

    The device holds QUEUE_SLOTS segments, so a segment is sent when the one that many before it has ended. Its main
    program reads them one by one in the time that the interrupts of the running segment leave.
    """
    overhead = HEADER_BYTES + 2 * CRC_BYTES + 1
    starts: Ticks = np.cumsum([0, *(segment.duration_flags >> 1 for segment in plan.segments)], dtype=np.int64)
    loads = [_interrupt_load(segment) for segment in plan.segments]
    line_tick = board_tick = 0.0
    line, board = [(float(starts[-1]), "")], [(float(starts[-1]), "")]
    for k, segment in enumerate(plan.segments):
        if k < QUEUE_SLOTS:
            continue  # sent before the start
        ticks = (encoded_bytes(segment) + overhead) * BITS_PER_BYTE * TICKS_HZ / BAUD
        line_tick = max(line_tick, float(starts[k - QUEUE_SLOTS + 1])) + ticks
        board_tick = max(board_tick, line_tick)
        running = min(k, int(np.searchsorted(starts, board_tick, side="right")) - 1)
        board_tick += READ_TICKS / max(1.0 - loads[running], LEAST_SHARE)
        where = f"segment {k}, {_time(int(starts[k]))}"
        line.append((float(starts[k]) - line_tick, where))
        board.append((float(starts[k]) - board_tick - LATEST_READ_TICKS, where))
    checks = []
    for name, found, setting in (
        ("time ahead of the line", line, "link.baud or joints.microsteps"),
        ("time ahead of the board", board, "joints.microsteps or joints.max_speed_deg_s"),
    ):
        ahead_ticks, where = min(found)
        checks.append(at_least(name, ahead_ticks / TICKS_HZ, 0.0, "s", where, setting))
    return checks


def _interrupt_load(segment: Segment) -> float:
    """Return the share of the processor that interrupts take while a segment runs and the line is busy."""
    steps = sum(move.steps_dir >> 1 for move in segment.moves)
    return LINE_LOAD + STEP_INTERRUPT_TICKS * steps / max(segment.duration_flags >> 1, 1)


def _time(tick: int) -> str:
    return f"{tick / TICKS_HZ:.6f} s"
