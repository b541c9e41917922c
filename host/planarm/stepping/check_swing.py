"""Certificate: how far each rotor swings behind its field, as planned and with the path clock held on the way.

The torque check is quasi-static; this one lets the rotors swing (`planarm.stepping.swing`), along the expanded segments
and, with the changes of the path clock that the allowances permit, through one hold at any moment. Moments are tried
one after another: a dense sample, not a proof; a second hold while the first one still swings is not in it. Quick stops
and those of a starving queue use all of the allowed slowing. An override is not in it: it changes the clock as a hold
does, but then the motion runs at another rate.
"""

import numpy as np

from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import Scene
from planarm.stepping.certificate import Check, at_most
from planarm.stepping.check_motion import Planned
from planarm.stepping.clearance import joint_positions_cm
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.swing import LOST_RAD, Holds
from planarm.stepping.swinging import Run, Swinging
from planarm.stepping.train import Floats, StepTrain
from planarm.stepping.windows import start_stop_ticks
from planarm_wire.messages import GENTLE_PERCENT, TICKS_HZ

FULL_STEP_RAD = 0.5 * np.pi
"""Electrical angle of a full step."""

MOST_FULL_STEPS = 1.0
"""Lag at which a rotor's torque is largest: beyond, it is pulled back less the farther it is, and from two full steps
on it is lost. Half a micro-step comes on top: so much of the lag is the field's own jump."""
AMBER_BELOW = 0.2
MOST_HELD_FULL_STEPS = 1.5
"""With a hold on the way, which most motions never see, half a step is left to where a rotor is lost, however coarse
the micro-steps are."""
QUIET_BELOW = 0.75
"""Where no rotor comes nearer than this to the limit, running and in a first pattern of holds, one pattern is all."""

AFTER_S = 0.1
"""Half a period of the slowest swing that is looked for, 5 Hz."""
SWINGS_ON_S = 0.2
"""How long the arm is looked at when a hold is over and the clock runs on."""

HOLD_EVERY_S = 0.025
"""One moment after another: a quarter of a period of swings of 10 Hz, where heavy arms swing most."""
MOST_MOMENTS = 200
HOLD_EVERY_HURRIED_S = 0.2
MOST_MOMENTS_HURRIED = 15
QUICK_STOPS_EVERY = 2
LONGEST_PAUSE_S = 0.15
TEST_EVERY_S = 0.3
SPREAD = 0.7
"""Part of an interval over which the hard test's holds are spread."""
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
GENTLE = 0.01 * GENTLE_PERCENT

NAME, NAME_HELD, NAME_STOPPED = "lag of the rotor", "lag of the rotor with a hold", "lag of the rotor with a quick stop"
SETTING = "joints.max_acceleration_deg_s2, joints.max_jerk_deg_s3 or motion.acceleration_share"
SETTING_HELD = "joints.max_acceleration_deg_s2 or motion.torque_share"
"""Holds may use what a lower share or a limit of jerk leaves free, so these do not help against them."""


def check_swing(planned: Planned, plan: SegmentPlan, made: StepTrain, scene: Scene, from_s: float = 0.0) -> list[Check]:
    """Check that no rotor swings as far behind its field as where its torque falls.

    `from_s` is above 0 for a motion that is being executed up to there: it has to be certified before it gets there, so
    fewer moments are tried, those after it.
    """
    swinging = Swinging.of(planned, made, scene)
    half_usteps = 0.5 / np.array([joint.microsteps for joint in scene.joints])
    most, most_held = (
        np.minimum(MOST_FULL_STEPS + half_usteps, MOST_HELD_FULL_STEPS),
        np.full(len(scene.joints), MOST_HELD_FULL_STEPS),
    )
    running = swinging.follow(swinging.start, swinging.path_s, after_s=AFTER_S)
    found = [(NAME, SETTING, running, most, most - AMBER_BELOW)]
    if plan.allowances:
        holds = holds_of(swinging, planned, plan, scene)
        held, stopped = held_runs(swinging, holds, running, most_held * FULL_STEP_RAD, from_s)
        found.append((NAME_HELD, SETTING_HELD, held, most_held, most))
        found.append((NAME_STOPPED, SETTING_HELD, stopped, most_held, most))
    checks = []
    for name, setting, run, limits, ambers in found:
        for j, (limit, amber) in enumerate(zip(limits, ambers, strict=True)):
            value, where = run.lags_rad[j] / FULL_STEP_RAD, _place(planned, scene, float(run.at_s[j]))
            check = at_most(f"joint {j + 1} {name}", value, limit, "full steps", where, setting, amber=amber)
            checks.append(check)
    return checks


def held_runs(swinging: Swinging, holds: Holds, running: Run, most_rad: Floats, from_s: float = 0.0) -> tuple[Run, Run]:
    """Return the largest lags with one hold anywhere, and with one stop of a starving queue anywhere.

    Both are those of one hard test, holds and such stops all along the motion, where no rotor comes near its limit in
    that. Else the motion is held at one moment after another, each time for itself.
    """
    start, end_s = swinging.start, swinging.path_s
    tested = swinging.follow(start, end_s, every_hold(holds, end_s), AFTER_S)
    if (np.maximum(tested.lags_rad, running.lags_rad) < most_rad - QUIET_BELOW * FULL_STEP_RAD).all():
        return tested, tested
    held, stopped, here = start, start, start
    every_s = max(HOLD_EVERY_S, end_s / MOST_MOMENTS)
    if from_s > 0.0:
        every_s = max(HOLD_EVERY_HURRIED_S, (end_s - from_s) / MOST_MOMENTS_HURRIED)
    for number, at_s in enumerate(np.arange(from_s + every_s, end_s, every_s)):
        here = swinging.follow(here, float(at_s))
        held, stopped = held.worse(here), stopped.worse(here)
        if (here.lags_rad > LOST_RAD).any():
            break  # the running motion itself is red
        pause_s = np.array([LONGEST_PAUSE_S * (number * GOLDEN % 1.0)])
        one = holds._replace(begin_s=np.array([here.path_s]), pause_s=pause_s, share=np.array([GENTLE]))
        if (held.lags_rad <= most_rad).all():
            held = held.worse(swinging.follow(here, end_s, one, SWINGS_ON_S))
        if number % QUICK_STOPS_EVERY == 0 and (stopped.lags_rad <= most_rad).all():
            quick = one._replace(share=np.ones(1))
            stopped = stopped.worse(swinging.follow(here, end_s, quick, SWINGS_ON_S))
    return held, stopped


def every_hold(holds: Holds, path_s: float) -> Holds:
    """Return holds all along a motion, every other one a starving queue's stop, at uneven moments."""
    number = np.arange(int(path_s / TEST_EVERY_S) + 1)
    uneven = np.mod((number + 1) * GOLDEN, 1.0)
    return holds._replace(
        begin_s=TEST_EVERY_S * (number + SPREAD * uneven),
        pause_s=LONGEST_PAUSE_S * np.mod((number + 1) * GOLDEN**2, 1.0),
        share=np.where(number % 2 == 0, GENTLE, 1.0),
    )


def _place(planned: Planned, scene: Scene, at_s: float) -> str:
    """Say when and where on the path a lag is."""
    q_rad = planned.q_rad[min(round(at_s / float(planned.t_s[1])), len(planned.t_s) - 1)]
    lengths = np.array(scene.arm.link_lengths_cm, np.float64)
    x, y = joint_positions_cm(lengths, scene.arm.base_cm, q_rad[None])[0, -1]
    return f"{at_s:.6f} s, tip ({x:.2f}, {y:.2f}) cm"


def holds_of(swinging: Swinging, planned: Planned, plan: SegmentPlan, scene: Scene) -> Holds:
    """Return how a motion's path clock may be held, and no hold yet."""
    starts_s = np.cumsum([0, *(segment.duration_flags >> 1 for segment in plan.segments)]) / TICKS_HZ
    times_s = planned.t_s[swinging.nodes]
    segment = np.minimum(np.searchsorted(starts_s, times_s, side="right") - 1, len(plan.allowances) - 1)
    told = np.array([(one.slow_per_s, one.fast_per_s) for one in plan.allowances])[segment]
    speeds = planned.speeds_rad_s[swinging.nodes]
    rates_hz = np.abs(Transmission.of(scene).rates(speeds))
    intervals = np.array([start_stop_ticks(axis) for axis in motor_axes(scene.joints, scene.coupling)])
    return Holds(
        np.ascontiguousarray(told[:, 0]),
        np.ascontiguousarray(told[:, 1]),
        (rates_hz * intervals / TICKS_HZ).max(axis=1),
        *(np.empty(0) for _ in range(3)),
    )
