"""How long the drivers need STEP pulses to be, and whether a board makes them so.

The least low time of a board is that at its least interval, when as much runs in between as may. Steps that are farther
apart leave so much more.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from planarm.scene.joint import JointSpec
from planarm.scene.mechanics import Matrix
from planarm_wire.boards import Board
from planarm_wire.messages import BOARDS, TICKS_HZ

TICKS_US = TICKS_HZ / 1e6

ROUNDING_TICKS = 64
"""By so much steps may be nearer to each other than at the joint's largest speed: their ticks are rounded, and segments
may move them by a microsecond each."""


@dataclass(frozen=True, slots=True)
class ShortPulse:
    """A pulse that is too short for a driver.

    Attributes:
        joint: whose driver it is, from 1.
        level: "high" or "low".
        needed_us: how long the driver needs it.
        made_us: how long the board makes it.
    """

    joint: int
    level: str
    needed_us: float
    made_us: float


def low_ticks(board: Board, interval_ticks: int) -> int:
    """Return for how long a pulse is low at least where a joint's steps are so far apart."""
    return board.min_step_low_ticks + max(0, interval_ticks - board.min_interval_ticks)


def short_pulse(joints: Sequence[JointSpec], coupling: Matrix, board: Board) -> ShortPulse | None:
    """Return the first pulse that a driver finds too short at the joints' largest speeds; None where all are well."""
    speeds = np.abs(np.array(coupling)) @ np.array([joint.max_speed_rad_s for joint in joints])
    for number, (joint, speed_rad_s) in enumerate(zip(joints, speeds.tolist(), strict=True), start=1):
        interval_ticks = int(TICKS_HZ / (speed_rad_s * joint.usteps_per_rad)) - ROUNDING_TICKS
        row = joint.driver_row
        for level, needed_s, made in (
            ("high", row.step_high_s, board.min_step_high_ticks),
            ("low", row.step_low_s, low_ticks(board, interval_ticks)),
        ):
            if pulse_ticks(needed_s) > made:
                return ShortPulse(number, level, 1e6 * needed_s, made / TICKS_US)
    return None


def short_pulse_words(title: str, short: ShortPulse, board: Board) -> str:
    """Say what is wrong with it, and what to change."""
    longest = max(BOARDS.values(), key=lambda one: one.min_step_high_ticks)
    high_us, low_us = longest.min_step_high_ticks / TICKS_US, longest.min_step_low_ticks / TICKS_US
    slower = "" if short.level == "high" else ", or lower max_speed_deg_s"
    return (
        f"{title} needs pulses that are {short.level} for {short.needed_us:.4g} us, the board {board.name} makes them"
        f" {short.level} for {short.made_us:.4g} us; the longest are those of {longest.name} ({high_us:.4g} us high,"
        f" {low_us:.4g} us low; board.wiring own, up to {longest.joints} joints):"
        f" change the wiring or the driver{slower}"
    )


def pulse_ticks(time_s: float) -> int:
    """Return whole ticks that are no shorter."""
    return ceil(round(time_s * TICKS_HZ, 6))
