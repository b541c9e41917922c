"""What a board is told of a scene before anything moves: CONFIG and the soft limits. The one place that knows."""

from __future__ import annotations

from enum import IntFlag

import numpy as np

from planarm.link.stream_values import plain_config
from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import Scene
from planarm.stepping.windows import start_stop_ticks
from planarm_wire.messages import TICKS_HZ, Config, SoftLimits

MOST_USTEPS = 2**31 - 1
"""A position has 32 bits."""
ROUNDING = 1.0 + 1e-6
"""Of half a micro-step, by which a certified pose may lie beyond a joint limit; as the certificate has it."""


class Option(IntFlag):
    """Bits of CONFIG's options."""

    ENABLE_ACTIVE_HIGH = 1 << 0
    EMERGENCY_RELEASES = 1 << 1
    STOP_INPUT = 1 << 2
    LIMIT_SWITCHES = 1 << 3
    LIMITS_OPEN_WHEN_HIT = 1 << 4


def options_of(scene: Scene) -> Option:
    """Return what a scene switches on; its limit switches are watched in every motion."""
    board, switches = scene.board_spec, scene.limit_switches
    wanted = {
        Option.ENABLE_ACTIVE_HIGH: board.enable_active_high,
        Option.EMERGENCY_RELEASES: board.emergency_releases,
        Option.STOP_INPUT: board.stop_input,
        Option.LIMIT_SWITCHES: bool(switches),
        Option.LIMITS_OPEN_WHEN_HIT: any(switch.normally_closed for switch in switches),
    }
    return Option(sum(bit for bit, on in wanted.items() if on))


def config_of(scene: Scene) -> Config:
    """Return what a scene's board is told of its drivers, inputs and motors; joints that the arm lacks rest.

    DIR is never inverted: a scene's `reversed` joints have micro-steps that count the other way.
    """
    plain, board = plain_config(scene.board), scene.board_spec
    motors = [start_stop_ticks(axis) for axis in motor_axes(scene.joints, scene.coupling)]
    return Config(
        plain.pin_map,
        plain.joints,
        plain.dir_inverted,
        int(options_of(scene)),
        round(1e3 * (board.idle_release_s or 0.0)),
        round(board.wake_s * TICKS_HZ),
        plain.high_ticks,
        (*motors, *plain.start_stop_ticks[len(motors) :]),
    )


def soft_limits_of(scene: Scene) -> SoftLimits:
    """Return how far each motor turns at most while all joints are within their limits.

    A certified pose may lie beyond a joint limit by the rounding to micro-steps, so every limit is taken that much
    wider. A motor that several joints turn may go wherever these let it, which is a little more than the joints may.
    Joints that the arm lacks have no limit.
    """
    transmission = Transmission.of(scene)
    rounding_rad = 0.5 * ROUNDING * np.abs(transmission.rad_per_ustep).sum(axis=1)
    low_rad, high_rad = np.array(scene.arm.joint_limits_rad).T
    middle = transmission.usteps(0.5 * (low_rad + high_rad))
    reach = np.abs(transmission.usteps_per_rad) @ (0.5 * (high_rad - low_rad) + rounding_rad)
    least = np.maximum(np.floor(middle - reach), -MOST_USTEPS).astype(int).tolist()
    most = np.minimum(np.ceil(middle + reach), MOST_USTEPS).astype(int).tolist()
    lacking = scene.board.joints - len(scene.joints)
    return SoftLimits((*least, *(0,) * lacking), (*most, *(-1,) * lacking))
