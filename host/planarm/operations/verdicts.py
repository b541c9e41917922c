"""What a new obstacle means for a motion that runs: kept, avoided by a stop on its path, or unavoidable.

The rest of the motion is looked at from the least path time at which the arm can be, densely and with a bound for what
lies between.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from planarm.link.clock_sync import MOST_SLOWNESS
from planarm.link.stream import Stream
from planarm.model.shapes import Circle, Polygon, obstacle_set
from planarm.plan import Plan
from planarm.roadmap.recheck import first_contact
from planarm.stepping.stopping import stops
from planarm.trajectory.motion import Trajectory
from planarm.workspace.joint_proof import joint_world
from planarm_wire.messages import SLICE_TICKS, TICKS_HZ
from planarm_wire.steps import duration_ticks

Verdict = Literal["kept", "avoided", "unavoidable"]

LOOK_S = 0.001
"""The rest of a motion is looked at this densely, with a bound for what lies between."""
ORDER_S = 0.03
"""From a notice to a stop that takes effect: a message waits for at most one other on the line, 10 ms each."""
GENTLE_SHARE = 0.5
"""Of the allowed slowing that the device uses for a stop that is not a quick one."""


def judge(plan: Plan, shape: Circle | Polygon, margin_cm: float, least_s: float, most_s: float) -> tuple[Verdict, bool]:
    """Tell what a new obstacle means for a motion, and whether its stop has to be a quick one.

    Args:
        plan: the motion.
        shape: the obstacle.
        margin_cm: to keep from the links' centre lines.
        least_s: the path time is now at least this,
        most_s: and at most this.
    """
    return judge_contact(plan, contact_time_s(plan, shape, margin_cm, least_s), most_s)


def judge_contact(plan: Plan, contact_s: float, most_s: float) -> tuple[Verdict, bool]:
    """Tell the same from the path time of the contact, infinite where there is none."""
    if contact_s == np.inf:
        return "kept", False
    if contact_s > rest_time_s(plan, most_s, GENTLE_SHARE):
        return "avoided", False
    return ("avoided" if contact_s > rest_time_s(plan, most_s, 1.0) else "unavoidable"), True


def contact_time_s(plan: Plan, shape: Circle | Polygon, margin_cm: float, from_s: float) -> float:
    """Return the first path time from `from_s` on at which a link may be nearer than that; infinite when none is."""
    trajectory: Trajectory = plan.trajectory
    t_s = np.linspace(
        min(from_s, trajectory.duration_s), trajectory.duration_s, 2 + int(trajectory.duration_s / LOOK_S)
    )
    q_rad = np.ascontiguousarray(trajectory.sample(t_s)[0])
    world = joint_world(plan.scene)
    # Between two samples no joint turns farther than from one to the other and a little: both count half of it.
    turns = np.abs(np.diff(q_rad, axis=0)) @ np.cumsum(world.lengths_cm[::-1])[::-1]
    sway = np.zeros(len(t_s))
    np.maximum(sway[:-1], turns, out=sway[:-1])
    np.maximum(sway[1:], turns, out=sway[1:])
    index = first_contact(world, obstacle_set([shape]), margin_cm, q_rad, sway)
    return float(t_s[index]) if index >= 0 else float("inf")


def rest_time_s(plan: Plan, from_s: float, share: float) -> float:
    """Return a path time at which the arm rests at the latest when a stop is sent at `from_s`.

    `share` of the allowed slowing is what the stop uses: 1 for a quick one, else `GENTLE_SHARE`.
    """
    segments = plan.segments
    durations = [duration_ticks(segment) for segment in segments.segments]
    starts_s, needs_s = stops(plan.trajectory, plan.scene, durations, segments.allowances, share)
    ordered_s = from_s + ORDER_S
    first = max(0, int(np.searchsorted(starts_s, from_s, side="right")) - 1)
    last = int(np.searchsorted(starts_s, ordered_s, side="right")) + 1  # the slice that runs is ended as it was begun
    return min(ordered_s + SLICE_TICKS / TICKS_HZ + float(needs_s[first:last].max()), sum(durations) / TICKS_HZ)


def whereabouts_s(stream: Stream, now_s: float) -> tuple[float, float]:
    """Return the least and the largest path time of the arm: by the ledger, and by the fastest board's clock since.

    The motion has also not been going on for longer than since its start.
    """
    began_s = stream.began_s.least if stream.began_s else stream.started_s
    span_s = stream.path_span_s(now_s, MOST_SLOWNESS)
    return span_s.least, max(span_s.least, min(span_s.most, (now_s - began_s) * (1.0 + MOST_SLOWNESS)))
