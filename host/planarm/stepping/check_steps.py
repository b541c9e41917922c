"""Certificate, part one: the steps themselves, taken from the expanded segments."""

import numpy as np

from planarm.scene import JointSpec
from planarm.stepping.certificate import Check, at_least, at_most
from planarm.stepping.train import JointSteps, StepTrain, least_reversal_ticks, timing_share
from planarm_wire.boards import Board
from planarm_wire.messages import TICKS_HZ

TIMING_TICKS = 16
"""Permitted error of a step's time: 1 us, or the board's share of the shorter interval around it if that is more."""

STEP_PAIRS = 4.5
"""Square of the time between the points of a divided difference, in micro-steps over the acceleration's limit."""
ERROR_USTEPS = 2.0
"""A step's timing error in micro-steps, in its share of the interval: where the speed is twice the mean."""


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
    allowed = np.maximum(TIMING_TICKS, np.floor(timing_share(train.board.joints) * shorter))
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
        limit = max(made.board.min_interval_ticks, int(fastest))  # in whole ticks
        least = int(np.argmin(np.where(turns, 1 << 62, gaps)))
        setting = f"joints[{number}].max_speed_deg_s"
        checks.append(
            at_least(f"joint {number} step interval", gaps[least], limit, "ticks", _time(steps.ticks[least]), setting)
        )
    if turns.any():
        least = int(np.argmin(np.where(turns, gaps, 1 << 62)))
        limit = least_reversal_ticks(made.board)
        setting = f"joints[{number}].max_acceleration_deg_s2"
        checks.append(
            at_least(f"joint {number} reversal time", gaps[least], limit, "ticks", _time(steps.ticks[least]), setting)
        )
    if len(gaps) > 1:
        checks.append(_check_acceleration(steps, joint, number, made.board))
    return checks


def _check_acceleration(steps: JointSteps, joint: JointSpec, number: int, board: Board) -> Check:
    """Check the acceleration that the steps themselves show.

    At each step the joint passes the middle between two micro-steps, at a known time. Three such points have a second
    divided difference that is the acceleration at some moment between them, whatever the motion. They are taken so far
    apart that the permitted timing error changes it by little: what exceeds the limit by no more than that is amber.
    """
    after = np.cumsum(steps.directions, dtype=np.int64)
    middles = after - 0.5 * steps.directions
    limit = joint.max_acceleration_rad_s2
    apart = int(TICKS_HZ * np.sqrt(STEP_PAIRS / (limit * joint.usteps_per_rad)))
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
    where = _time(steps.ticks[at[worst]])
    # By errors at the worst of all three points.
    blurred = limit * 4.0 * ERROR_USTEPS * timing_share(board.joints) / STEP_PAIRS
    return at_most(name, acceleration[worst], limit, "rad/s^2", where, setting, rounding=blurred, amber=limit)


def _time(tick: int) -> str:
    return f"{tick / TICKS_HZ:.6f} s"
