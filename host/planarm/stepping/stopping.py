"""How a motion can be slowed down along its path: each segment's allowances, and the path time to rest.

The device runs the path clock at a rate u, 1 when nothing holds it. A joint then has the speed q' u and the
acceleration q'' u^2 + q' du/dt, with q' and q'' as planned, so it keeps its acceleration a at every u up to 1 when

    -du/dt <= slow = min over joints of (a - max(0, -q'' sgn q')) / |q'|,    du/dt <= fast, the same with +q''.

The device changes the clock from segment to segment: with the stretch s = 1 / u, a segment of duration D that starts at
s0 ends at s1 = s0 + slow D s0^3, at most 2 s0 (docs/protocol.md). Once all motors are below their start-stop speeds it
stops. `need` follows that rule, segment by segment, so it is what the device takes.
"""

from collections.abc import Sequence

import numpy as np

from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import Scene
from planarm.stepping.plan import Allowance
from planarm.stepping.train import Floats, Ticks
from planarm.stepping.windows import start_stop_ticks
from planarm.trajectory.motion import Trajectory
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import QUEUE_BYTES, TICKS_HZ

JUST_BEFORE_S = 1e-9
"""Accelerations jump at gridpoints; they are looked at on both sides."""

INNER = 9

LARGEST_RATE_PER_S = 1000.0
"""What stands for "at once" where no joint moves; the wire's largest rate is a little more."""

ROUNDED_DOWN = 15.0 / 16.0
"""The wire's rates have 16 steps an octave and round down."""

MESSAGE_SEGMENTS = 3
"""Segments that may share a message, and with it the least of their allowances."""

LARGEST_GROWTH = 2.0
"""Most by which the device lets the stretch grow in one segment."""


def allowances(trajectory: Trajectory, scene: Scene, durations_ticks: Sequence[int]) -> tuple[Allowance, ...]:
    """Return the allowances of segments with these durations, in order, of one motion."""
    if not durations_ticks:
        return ()
    starts = np.concatenate([[0], np.cumsum(durations_ticks)]) / TICKS_HZ
    t_s = _times(trajectory, starts)
    _, speeds, accelerations = trajectory.sample(t_s)
    limits = np.array([joint.max_acceleration_rad_s2 for joint in scene.joints])
    segment = np.searchsorted(starts[1:-1], t_s, side="right")
    first = np.searchsorted(segment, np.arange(len(durations_ticks)))
    slow, fast = (
        np.minimum.reduceat(_largest_change(speeds, sign * accelerations, limits), first) for sign in (1.0, -1.0)
    )
    needs = path_time_to_rest(
        np.asarray(durations_ticks, np.float64) / TICKS_HZ,
        ROUNDED_DOWN * least_of_neighbours(slow),
        _over_start_stop(trajectory, scene, starts[:-1]),
    )
    return tuple(
        Allowance(float(a), float(b), float(need * TICKS_HZ)) for a, b, need in zip(slow, fast, needs, strict=True)
    )


def _times(trajectory: Trajectory, starts_s: Floats) -> Floats:
    """Return times at which to look, sorted: borders and gridpoints from both sides, and INNER in each segment."""
    inner = starts_s[:-1, None] + np.diff(starts_s)[:, None] * (np.arange(1, INNER + 1) / (INNER + 1))
    jumps = np.concatenate([starts_s[:-1], trajectory.t_s[:-1]])
    before = np.concatenate([starts_s[1:], trajectory.t_s[1:]]) - JUST_BEFORE_S
    return np.sort(np.concatenate([inner.ravel(), jumps, before]))


def _largest_change(speeds: Floats, accelerations: Floats, limits: Floats) -> Floats:
    """Return the largest slowing of the path clock at each time, 1/s, for motions of shape (n, joints)."""
    against = np.maximum(0.0, -accelerations * np.sign(speeds))
    room = np.maximum(0.0, limits - against)
    rates = np.divide(room, np.abs(speeds), out=np.full_like(room, np.inf), where=speeds != 0.0)
    return np.asarray(np.minimum(rates.min(axis=1), LARGEST_RATE_PER_S))


def _over_start_stop(trajectory: Trajectory, scene: Scene, t_s: Floats) -> Floats:
    """Return at each time how many times its start-stop speed the fastest motor, in these terms, has."""
    rates_hz = np.abs(Transmission.of(scene).rates(trajectory.sample(t_s)[1]))
    intervals = np.array([start_stop_ticks(axis) for axis in motor_axes(scene.joints, scene.coupling)])
    return np.asarray((rates_hz * intervals / TICKS_HZ).max(axis=1))


def least_of_neighbours(rates: Floats) -> Floats:
    """Return each segment's least rate over all messages that it may be sent in."""
    wide = MESSAGE_SEGMENTS - 1
    padded = np.concatenate([np.full(wide, np.inf), rates, np.full(wide, np.inf)])
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 2 * wide + 1).min(axis=1))


@kernel
def path_time_to_rest(durations_s: Floats, slow_per_s: Floats, over_start_stop: Floats) -> Floats:
    """Return the path time that a stop takes from the start of each segment, by the device's rule.

    Args:
        durations_s: of the segments.
        slow_per_s: the slowing that the device may use in each.
        over_start_stop: how many times its start-stop speed a motor has at each segment's start.
    """
    count = durations_s.shape[0]
    needs = np.zeros(count)
    for k in range(count):
        stretch = 1.0
        i = k
        while i < count and over_start_stop[i] > stretch:
            stretch = min(LARGEST_GROWTH * stretch, stretch + slow_per_s[i] * durations_s[i] * stretch**3)
            needs[k] += durations_s[i]
            i += 1
    return needs


QUEUED_HEAD_BYTES = 2
"""A segment's share of its frame's head in the device's queue, four bytes, two segments a frame as a rule."""


def held_until(starts: Ticks, segment_bytes: Ticks) -> Ticks:
    """Return the end of the path that the device holds when each segment starts and its queue is full, in ticks."""
    last = len(segment_bytes)
    total = np.concatenate([[0], np.cumsum(segment_bytes + QUEUED_HEAD_BYTES)])
    held = np.minimum(np.searchsorted(total, total[:-1] + QUEUE_BYTES, side="right") - 1, last)
    return np.asarray(starts[held])
