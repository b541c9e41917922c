"""How a motion can be slowed down along its path: each segment's allowances, and the path time to rest.

The device runs the path clock at a rate u, 1 when nothing holds it. A joint then has the speed q' u and the
acceleration q'' u^2 + q' du/dt, with q' and q'' as planned, so it keeps its acceleration a at every u up to 1 when

    -du/dt <= slow = min over joints of (a - max(0, -q'' sgn q')) / |q'|,    du/dt <= fast, the same with +q''.

The motors keep their torque besides, as far as the plan may use it (`planarm.trajectory.stretch`).

The device changes the clock from slice to slice of a segment: with the stretch s = 1 / u, a slice of duration D that
starts at s0 ends at s1 = s0 + slow D s0^3, at most 2 s0 (docs/protocol.md). It stops in the first slice all over which
all motors are below their start-stop speeds. `need` follows that rule from every slice's start at the planned pace,
slice by slice as the device cuts them. It is the most from any start in the segment and from its end: the device slows
down in a slice when what is left behind it does not hold a need. Its rates may be up to a fifteenth larger than those
here. So it slows down sooner, and in rare cases cuts so that it rests a part of a slice later, which its
`starving_ticks` cover (docs/decisions/0138).
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from planarm.dynamics.motor_terms import Load
from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import Scene
from planarm.stepping.plan import Allowance
from planarm.stepping.train import Floats, Ticks
from planarm.stepping.windows import start_stop_ticks
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.stretch import torque_changes
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import (
    MAX_PAYLOAD_BYTES,
    QUEUE_FRAME_BYTES,
    SLICE_TICKS,
    TICKS_HZ,
)
from planarm_wire.rates import MESSAGE_SEGMENTS, QUEUED_HEAD_BYTES, SHARED_PAYLOAD_BYTES

JUST_BEFORE_S = 1e-9
"""Accelerations jump at gridpoints; they are looked at on both sides."""

INNER = 9

LARGEST_RATE_PER_S = 1000.0
"""What stands for "at once" where no joint moves; the wire's largest rate is a little more."""

ROUNDED_DOWN = 15.0 / 16.0
"""The wire's rates have 16 steps an octave and round down."""

SURELY_CALM = 0.99
"""Share of the start-stop speed below which the device, which looks at rounded intervals, finds a motor slower."""

LARGEST_GROWTH = 2.0
"""Most by which the device lets the stretch grow in one slice."""


class Slices(NamedTuple):
    """The slices into which the device cuts segments at the planned pace; shape (slices,) each."""

    starts: Ticks
    durations: Ticks
    segment: Ticks
    """Index of the segment."""

    @classmethod
    def of(cls, durations_ticks: Sequence[int]) -> Self:
        """Return the slices of segments with these durations, in order."""
        durations = np.asarray(durations_ticks, np.int64)
        counts = -(-durations // SLICE_TICKS)
        segment = np.repeat(np.arange(len(durations)), counts)
        number = np.arange(len(segment)) - (np.cumsum(counts) - counts)[segment]
        whole = np.maximum(counts - 2, 0)[segment]
        last_two = durations[segment] - whole * SLICE_TICKS
        half = np.where(counts[segment] == 1, last_two, (last_two + 1) // 2)
        since = np.minimum(number, whole) * SLICE_TICKS + np.where(number > whole, half, 0)
        lengths = np.where(number < whole, SLICE_TICKS, np.where(number > whole, last_two - half, half))
        return cls((np.cumsum(durations) - durations)[segment] + since, lengths, segment)


def allowances(trajectory: Trajectory, scene: Scene, durations_ticks: Sequence[int]) -> tuple[Allowance, ...]:
    """Return the allowances of segments with these durations, in order, of one motion."""
    if not durations_ticks:
        return ()
    slices = Slices.of(durations_ticks)
    starts_s = np.append(slices.starts, slices.starts[-1] + slices.durations[-1]) / TICKS_HZ
    t_s = _times(trajectory, starts_s)
    q, speeds, accelerations = trajectory.sample(t_s)
    limits = np.array([joint.max_acceleration_rad_s2 for joint in scene.joints])
    of_segment = slices.segment[np.searchsorted(starts_s[1:-1], t_s, side="right")]
    first = np.searchsorted(of_segment, np.arange(len(durations_ticks)))
    over = _over_start_stop(scene, speeds)
    by_torque = torque_changes(Load.of(scene, scene.motion.torque_share), q, speeds, accelerations)
    slow, fast = (
        np.minimum.reduceat(np.minimum(_largest_change(speeds, sign * accelerations, limits), torque), first)
        for sign, torque in zip((1.0, -1.0), by_torque, strict=True)
    )
    rates = ROUNDED_DOWN * least_of_neighbours(slow)
    needs = np.append(path_ticks_to_rest(slices, rates, TICKS_HZ * t_s, over), 0)
    own = np.searchsorted(slices.segment, np.arange(len(durations_ticks)))
    behind = np.append(own[1:], len(slices.starts))
    most = np.maximum(np.maximum.reduceat(needs[:-1], own), needs[behind])
    return tuple(Allowance(float(a), float(b), float(need)) for a, b, need in zip(slow, fast, most, strict=True))


def stops(
    trajectory: Trajectory, scene: Scene, durations_ticks: Sequence[int], told: Sequence[Allowance], share: float
) -> tuple[Floats, Floats]:
    """Return where each slice of a motion starts and the path time that a stop takes from there, in seconds.

    Args:
        trajectory: as planned.
        scene: the arm.
        durations_ticks: of the segments.
        told: their allowances.
        share: of the allowed slowing that the stop uses: 1 for a quick one, one half for a stop or a hold.
    """
    slices = Slices.of(durations_ticks)
    starts_s = slices.starts / TICKS_HZ
    t_s = _times(trajectory, np.append(starts_s, (slices.starts[-1] + slices.durations[-1]) / TICKS_HZ))
    slow = np.array([allowance.slow_per_s for allowance in told])
    rates = share * ROUNDED_DOWN * least_of_neighbours(slow)
    over = _over_start_stop(scene, trajectory.sample(t_s)[1])
    return starts_s, path_ticks_to_rest(slices, rates, TICKS_HZ * t_s, over) / TICKS_HZ


def _times(trajectory: Trajectory, starts_s: Floats) -> Floats:
    """Return times at which to look, sorted: borders and gridpoints from both sides, and INNER in each slice."""
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


def _over_start_stop(scene: Scene, speeds: Floats) -> Floats:
    """Return how many times its start-stop speed the fastest motor, in these terms, has; speeds have shape (n, m)."""
    rates_hz = np.abs(Transmission.of(scene).rates(speeds))
    intervals = np.array([start_stop_ticks(axis) for axis in motor_axes(scene.joints, scene.coupling)])
    return np.asarray((rates_hz * intervals / TICKS_HZ).max(axis=1))


def least_of_neighbours(rates: Floats) -> Floats:
    """Return each segment's least rate over all messages that it may be sent in."""
    wide = MESSAGE_SEGMENTS - 1
    padded = np.concatenate([np.full(wide, np.inf), rates, np.full(wide, np.inf)])
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 2 * wide + 1).min(axis=1))


def path_ticks_to_rest(slices: Slices, slow_per_s: Floats, ticks: Floats, over_start_stop: Floats) -> Ticks:
    """Return the path time that a stop takes from the start of each slice, by the device's rule.

    Args:
        slices: at the planned pace.
        slow_per_s: the slowing that the device may use in each segment.
        ticks: increasing times, close to each other.
        over_start_stop: how many times its start-stop speed a motor has at those.
    """
    ends = np.append(slices.starts[1:], slices.starts[-1] + slices.durations[-1])
    last = np.searchsorted(slices.segment, np.arange(len(slow_per_s)), side="right") - 1
    found: Ticks = walk_to_rest(
        slices.starts, slices.segment, ends[last], slow_per_s, ticks, over_start_stop / SURELY_CALM
    )
    return found


@kernel
def walk_to_rest(
    starts: Ticks, segment: Ticks, ends: Ticks, slow_per_s: Floats, ticks: Floats, over_start_stop: Floats
) -> Ticks:
    """Return as `path_ticks_to_rest`; slices by their starts and segments, segments by their ends."""
    needs = np.zeros(starts.shape[0], np.int64)
    near = 0  # the last time looked at that is not behind the slice
    for k in range(starts.shape[0]):
        at, i, stretch = starts[k], segment[k], 1.0
        while near + 1 < ticks.shape[0] and ticks[near + 1] <= at:
            near += 1
        place = near
        while at < ends[-1]:
            if at == ends[i]:
                i += 1
            length = device_slice_ticks(ends[i] - at, stretch)
            begin, is_calm = place, over_start_stop[place] <= stretch
            while is_calm and ticks[place] < at + length and place + 1 < ticks.shape[0]:
                place += 1
                is_calm = over_start_stop[place] <= stretch
            if is_calm:
                break
            place = begin
            stretch = min(LARGEST_GROWTH * stretch, stretch + slow_per_s[i] * length / TICKS_HZ * stretch**3)
            at += length
            while place + 1 < ticks.shape[0] and ticks[place + 1] <= at:
                place += 1
        needs[k] = at - starts[k]
    return needs


@kernel
def device_slice_ticks(left_ticks: int, stretch: float) -> int:
    """Return the length of the device's next slice of a segment of which so much is left (docs/protocol.md)."""
    if stretch < LARGEST_GROWTH:
        return left_ticks if left_ticks <= SLICE_TICKS else min(SLICE_TICKS, (left_ticks + 1) // 2)
    most, rest = SLICE_TICKS, stretch
    while rest >= LARGEST_GROWTH and most > 1:
        most, rest = most // 2, rest / 2.0
    return left_ticks if left_ticks < 2 * most else most


UNSURE_BYTES = MAX_PAYLOAD_BYTES + QUEUE_FRAME_BYTES
"""What may be empty of a full queue: less than the next message takes."""


def queued_bytes(segment_bytes: Ticks) -> Ticks:
    """Return the bytes that segments take in the device's queue, with their share of the head of their frame.

    Two share a frame where both are short enough, stuffed bytes included; else each has its own.
    """
    alone = MESSAGE_SEGMENTS * segment_bytes + QUEUED_HEAD_BYTES > SHARED_PAYLOAD_BYTES
    return np.asarray(segment_bytes + np.where(alone, QUEUED_HEAD_BYTES, QUEUED_HEAD_BYTES // MESSAGE_SEGMENTS))


def held_until(starts: Ticks, segment_bytes: Ticks, queue_bytes: int) -> Ticks:
    """Return the end of the path that the device holds while each segment runs and its queue is full, in ticks."""
    last = len(segment_bytes)
    total = np.concatenate([[0], np.cumsum(queued_bytes(segment_bytes))])
    until = np.searchsorted(total, total[1:] + queue_bytes - UNSURE_BYTES, side="right") - 1
    return np.asarray(starts[np.minimum(until, last)])
