"""Certificate: the arm can come to rest on the path from anywhere, within the segments that the device holds.

The allowances that travel with the plan are held against slowings found from the planned angles alone, by differences,
and against stops integrated in continuous time; the device, which changes the clock from slice to slice, takes longer.
What the motors' torque allows is found from the certificate's own torques, at rates of the clock down to a quarter.
"""

from itertools import pairwise
from math import ceil

import numpy as np

from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import Scene
from planarm.stepping.certificate import Check, Verdict, at_least, at_most
from planarm.stepping.check_motion import Planned
from planarm.stepping.check_torque import STRIDE, at_motors_nm, joint_torques_nm, pull_outs_nm
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.slowing import link_margin_ticks
from planarm.stepping.table import SegmentTable, segment_bytes
from planarm.stepping.train import Floats, Ticks
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import MAX_PAYLOAD_BYTES, QUEUE_FRAME_BYTES, SLICE_TICKS, TICKS_HZ
from planarm_wire.rates import SHARED_PAYLOAD_BYTES

ROUNDING = 0.02
"""Differences see accelerations a tenth of a millisecond wide, and the planner's at a point."""

CLOCK_RATES = (1.0, 0.75, 0.5, 0.25)
"""Rates of the clock at which torques are looked at."""

SLOWEST_RAD_S = 1e-9
"""Friction that does not depend on speed has a sense at any speed but none."""

MOST_RATE_PER_S = 1000.0


def check_stop(plan: SegmentPlan, table: SegmentTable, planned: Planned, scene: Scene) -> list[Check]:
    """Check each segment's allowances, and that every stop fits."""
    told = np.array([(one.slow_per_s, one.fast_per_s, one.need_ticks) for one in plan.allowances]).reshape(-1, 3)
    missing = abs(len(told) - len(plan.segments))
    checks = [at_most("segments without allowance", missing, 0, "segments")]
    if missing or not len(told):
        return checks
    starts = table.starts
    setting = "joints.max_acceleration_deg_s2"
    inner_s, borders_s = planned.t_s[1:-1], starts / TICKS_HZ
    looked = _looked_at(inner_s, borders_s)
    by_torque = _torque_changes(planned, scene, looked)
    for name, column, sign in (("slowing", 0, 1.0), ("speeding up", 1, -1.0)):
        torque = np.full(len(inner_s), np.inf)
        torque[looked] = by_torque[column]
        largest = _least_in(np.minimum(_largest_changes(planned, scene, sign), torque), inner_s, borders_s)
        beyond = told[:, column] / np.maximum(largest, 1e-9)
        k = int(np.argmax(beyond))
        where = f"segment {k}, {_time(starts[k])}"
        told_of = f"allowed {name} of the path, share of what the joints can"
        checks.append(at_most(told_of, beyond[k], 1.0 + ROUNDING, "", where, setting))
    needs_s = told[:, 2] / TICKS_HZ
    at, owner = _slices(table)
    slowing = np.minimum(_largest_changes(planned, scene, 1.0), np.interp(inner_s, inner_s[looked], by_torque[0]))
    beyond_s = _stops_s(planned, scene, at / TICKS_HZ, slowing) - needs_s[owner]
    k = int(np.argmax(beyond_s))
    where = f"segment {owner[k]}, {_time(int(at[k]))}"
    slice_s = SLICE_TICKS / TICKS_HZ
    checks.append(at_most("path time to rest beyond what is told", beyond_s[k], slice_s, "s", where, setting))
    checks.append(_check_fit(table, needs_s))
    return checks


def _check_fit(table: SegmentTable, needs_s: Floats) -> Check:
    """Check the path time in a full queue less that of a stop, where the queue does not hold all that is left.

    Amber at worst: where the road is too short the device slows down by itself until it is not, so it stays on the
    path, but later than planned.
    """
    starts, last = table.starts, len(table.durations)
    at, owner = _slices(table)
    name, setting = "road left after a stop", "joints.max_speed_deg_s or joints.max_acceleration_deg_s2"
    spare = [(float("inf"), 0)]
    ends, margin = _queue_ends(table), link_margin_ticks(table.board)
    for tick, k in zip(at.tolist(), owner.tolist(), strict=True):
        if ends[k] < last:
            spare.append((int(starts[ends[k]] - tick - margin) / TICKS_HZ - float(needs_s[k]), k))
    least, k = min(spare)
    if least == float("inf"):
        return at_least(name, float(starts[-1]) / TICKS_HZ, 0.0, "s", "the queue holds the whole rest of the motion")
    verdict: Verdict = "green" if least >= 0.0 else "amber"
    return Check(name, least, 0.0, "s", verdict, f"segment {k}, {_time(starts[k])}", setting)


def _slices(table: SegmentTable) -> tuple[Ticks, Ticks]:
    """Return where the device may begin to slow down, slice by slice, and in which segment that is."""
    starts: list[int] = table.starts.tolist()
    counts = [max(1, ceil((end - begin) / SLICE_TICKS)) for begin, end in pairwise(starts)]
    borders = zip(pairwise(starts), counts, strict=True)
    at = [np.arange(begin, end, max(1, ceil((end - begin) / count))) for (begin, end), count in borders]
    return np.concatenate(at), np.repeat(np.arange(len(at)), [len(one) for one in at])


def _queue_ends(table: SegmentTable) -> list[int]:
    """Return for each segment the first one that the queue does not hold while it runs.

    What runs has left the queue; less than the next message may be empty of it. A frame's head and length take four
    bytes, shared by two segments where their frame is sure to hold both.
    """
    room = table.board.queue_bytes - MAX_PAYLOAD_BYTES - QUEUE_FRAME_BYTES
    sizes = [int(size) + (2 if 2 * size + 4 <= SHARED_PAYLOAD_BYTES else 4) for size in segment_bytes(table)]
    ends, end, held = [], 0, sizes[0]
    for size in sizes:
        held -= size
        while end + 1 < len(sizes) and held + sizes[end + 1] <= room:
            end += 1
            held += sizes[end]
        ends.append(end + 1)
    return ends


def _largest_changes(planned: Planned, scene: Scene, sign: float) -> Floats:
    """Return the largest slowing (sign 1) or speeding up (-1) of the path clock at each inner time, 1/s."""
    speeds = 0.5 * (planned.speeds_rad_s[1:] + planned.speeds_rad_s[:-1])
    most = np.full(len(speeds), MOST_RATE_PER_S)
    for j, joint in enumerate(scene.joints):
        braking = -sign * planned.accelerations_rad_s2[:, j] * np.sign(speeds[:, j])
        room = np.maximum(0.0, joint.max_acceleration_rad_s2 - np.maximum(0.0, braking))
        most = np.minimum(most, room / np.maximum(np.abs(speeds[:, j]), 1e-12))
    return most


def _looked_at(inner_s: Floats, borders_s: Floats) -> Ticks:
    """Return at which inner times torque is looked at: every STRIDE-th, and the first and the last of each segment.

    Torque jumps where accelerations do, so what is between two of these times is no mean of them.
    """
    first, after = _within(inner_s, borders_s)
    some = first < after
    return np.asarray(np.unique(np.concatenate([np.arange(0, len(inner_s), STRIDE), first[some], after[some] - 1])))


def _torque_changes(planned: Planned, scene: Scene, looked: Ticks) -> Floats:
    """Return the largest slowing and speeding up of the path clock by the torque at inner times, shape (2, n).

    At the rate u of the clock speeds are u times the planned ones and torques of motion u^2 times, and its change asks
    for what accelerations as large as the speeds would.
    """
    speeds = (0.5 * (planned.speeds_rad_s[1:] + planned.speeds_rad_s[:-1]))[looked]
    accelerations, q_rad = planned.accelerations_rad_s2[looked], planned.q_rad[1:-1][looked]
    lengths, still = scene.arm.link_lengths_cm, np.zeros_like(speeds)

    def joints_nm(speeds: Floats, accelerations: Floats) -> Floats:
        return joint_torques_nm(lengths, scene.mechanics, q_rad, speeds, accelerations)

    held = joints_nm(still, still) if scene.mechanics.gravity else still
    moving = joints_nm(speeds, accelerations) - held
    per_change = at_motors_nm(scene, joints_nm(still, speeds) - held, still, speeds)
    most = np.full((2, len(speeds)), MOST_RATE_PER_S)
    resting = at_motors_nm(scene, held, np.sign(speeds) * SLOWEST_RAD_S, still)
    viscous = at_motors_nm(scene, held, speeds, still) - resting
    inertial = at_motors_nm(scene, moving, still, accelerations)
    for u in CLOCK_RATES:
        torques = resting + u * viscous + u * u * inertial
        given = scene.motion.torque_share * pull_outs_nm(scene, u * speeds)
        for row, sense in enumerate((-np.sign(per_change), np.sign(per_change))):
            room = np.maximum(0.0, given - sense * torques) / np.maximum(np.abs(per_change), 1e-12)
            most[row] = np.minimum(most[row], room.min(axis=1))
    return most


def _least_in(values: Floats, t_s: Floats, borders_s: Floats) -> Floats:
    """Return the least value in each segment, infinity where it has none.

    A value at t is that of differences over its neighbours, so all three have to lie in the segment.
    """
    ranges = zip(*(ends.tolist() for ends in _within(t_s, borders_s)), strict=True)
    return np.array([values[a:b].min() if a < b else np.inf for a, b in ranges])


def _within(t_s: Floats, borders_s: Floats) -> tuple[Ticks, Ticks]:
    """Return the first time of each segment that lies in it with both its neighbours, and the first that no more does.

    Where there is none, the first is not less than the other.
    """
    step_s = t_s[1] - t_s[0]
    return (
        np.searchsorted(t_s, borders_s[:-1] + step_s),
        np.searchsorted(t_s, borders_s[1:] - step_s, side="right"),
    )


def _stops_s(planned: Planned, scene: Scene, starts_s: Floats, slowing: Floats) -> Floats:
    """Return the path time of a stop from each start with all of the slowing there is."""
    speeds = 0.5 * (planned.speeds_rad_s[1:] + planned.speeds_rad_s[:-1])
    over = np.zeros(len(speeds))
    rates = np.abs(Transmission.of(scene).rates(speeds))
    for motor, axis in enumerate(motor_axes(scene.joints, scene.coupling)):
        over = np.maximum(over, rates[:, motor] / np.sqrt(2.0 * axis.max_acceleration_rad_s2 * axis.usteps_per_rad))
    first: Ticks = np.searchsorted(planned.t_s[1:-1], starts_s)
    return integrate_stops(slowing, over, first, float(planned.t_s[1]))


@kernel
def integrate_stops(slow_per_s: Floats, over: Floats, first: Ticks, step_s: float) -> Floats:
    """Return the path time of stops: along the path d(u^2)/d tau = -2 slow, at rest where over u is at most 1."""
    needs = np.zeros(first.shape[0])
    for k in range(first.shape[0]):
        squared = 1.0
        for i in range(first[k], slow_per_s.shape[0]):
            if over[i] * over[i] * squared <= 1.0:
                break
            squared = max(0.0, squared - 2.0 * slow_per_s[i] * step_s)
            needs[k] += step_s
    return needs


def _time(tick: int) -> str:
    return f"{tick / TICKS_HZ:.6f} s"
