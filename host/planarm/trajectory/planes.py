"""A path's limits on a grid, as the half-planes and bounds that the solver takes.

Acceleration: |q' u + q'' x| <= A gives two half-planes at each end of an interval. Torque: a motor gives
a u + b x + v sqrt(x) + h, and has T(w sqrt(x)), flat up to the corner speed and falling as 1 / speed beyond; a share k
of what h leaves may be used. T is a convex function of x where it falls, so its tangent lies below it: the plan uses
the smaller of the flat torque and the tangent at the speed of the solution before, a conservative estimate that is
exact at that speed, and no worse with every round (the solution before stays possible). sqrt(x) is concave: its tangent
is above it, and its chord below.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from planarm.dynamics.motor_terms import MotorTerms, motor_terms
from planarm.errors import TimingError
from planarm.smoothing.smooth_path import Floats, JointState, SmoothPath
from planarm.trajectory.limits import Limits
from planarm.trajectory.samples import Samples, take_samples

REST_SHARE = 1e-12
"""Where the motion rests, the chord of sqrt(x) ends at this share of the largest x instead of at 0."""

SLOW_SHARE = 0.05
MOST_HALVINGS = 60
NEWTON_STEPS = 12
"""Each halves the bracket at least; near a turning point it squares the error."""
NEAR = 1e-9
"""A turning point this near to a gridpoint, as a share of the path, is not told from it."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Gridpoints and, for each interval and joint (or motor), the shares of the limits that the solver may use.

    Attributes:
        s: gridpoints, shape (m,).
        speed_share, acceleration_share, torque_share: shape (m - 1, n).
        tangent_x: squared path speed at which the torque's tangents touch, shape (m,); zero for the flat torque alone.
        growth: how many times `tangent_x`, or a share of its peak, the squared path speed may be.
        samples: the path in every interval.
    """

    s: Floats
    samples: Samples
    speed_share: Floats
    acceleration_share: Floats
    torque_share: Floats
    tangent_x: Floats
    growth: float = np.inf

    @classmethod
    def on(cls, path: SmoothPath, s: Floats, tangent_x: Floats | None = None) -> Self:
        """Return the grid with these gridpoints and all of every limit."""
        samples = take_samples(path, s[:-1], s[1:])
        ones = np.ones((len(s) - 1, samples.q_rad.shape[2]))
        return cls(s, samples, ones, ones, ones, np.zeros(len(s)) if tangent_x is None else tangent_x)


class Ends(NamedTuple):
    """The path at the start and the end of every interval, as seen from inside."""

    start: JointState
    end: JointState
    start_terms: MotorTerms | None
    end_terms: MotorTerms | None


def path_ends(samples: Samples, limits: Limits) -> Ends:
    """Return the path and its load at both ends of every interval."""
    start, end = samples.starts, samples.ends
    if limits.load is None:
        return Ends(start, end, None, None)
    return Ends(start, end, *(motor_terms(limits.load, *state, samples.senses) for state in (start, end)))


def with_turning_points(path: SmoothPath, s: Floats) -> Floats:
    """Return the gridpoints and between them the points at which a joint turns back: there its friction jumps."""
    rates = path.evaluate(s[:-1], "right").dq_rad, path.evaluate(s[1:], "left").dq_rad
    interval, joint = np.nonzero(rates[0] * rates[1] < 0.0)
    if not len(joint):
        return s
    low, high, before = s[interval], s[interval + 1], rates[0][interval, joint]
    at, each = 0.5 * (low + high), np.arange(len(joint))
    for _ in range(NEWTON_STEPS):
        state = path.evaluate(at)
        rate, bend = state.dq_rad[each, joint], state.ddq_rad[each, joint]
        low, high = np.where(rate * before > 0.0, at, low), np.where(rate * before > 0.0, high, at)
        newton = at - np.divide(rate, bend, out=np.full(len(at), np.inf), where=bend != 0.0)
        at = np.where((low <= newton) & (newton <= high), newton, 0.5 * (low + high))
    turning = at[(at - s[interval] > NEAR * s[-1]) & (s[interval + 1] - at > NEAR * s[-1])]
    return np.asarray(np.unique(np.concatenate([s, turning])))


def require_holding(path: SmoothPath, grid: Grid, limits: Limits) -> None:
    """Check that every motor can hold what it carries, and move it against friction, with something left.

    Raises:
        TimingError: one cannot; the message names motor, place and what is missing.
    """
    ends, s = path_ends(grid.samples, limits), grid.s
    if limits.load is None or ends.start_terms is None or ends.end_terms is None:
        return
    flat = limits.load.drives.flat_nm
    at, held = np.concatenate([s[:-1], s[1:]]), np.abs(np.concatenate([ends.start_terms.h, ends.end_terms.h]))
    worst, motor = np.unravel_index(int(np.argmax(held - flat)), held.shape)
    if held[worst, motor] >= flat[motor]:
        key = f"joints[{motor + 1}]"
        raise TimingError(
            f"joint {motor + 1} cannot move at {path.place(float(at[worst]))}: gravity and friction take "
            f"{held[worst, motor]:.4g} N m of its motor behind the gear, which may use {flat[motor]:.4g} N m; raise "
            f"{key}.gear_ratio, {key}.motor.current_a or motion.torque_share, or lower mechanics.end_masses_kg"
        )


def squared_limits(ends: Ends, grid: Grid, limits: Limits, rest: Floats) -> Floats:
    """Return the largest x by the speed limits at each gridpoint: the least over both sides and all joints.

    Args:
        ends: the path at the intervals' ends.
        grid: the grid and its shares.
        limits: the limits.
        rest: indices of the gridpoints at which the motion rests.
    """
    allowed = limits.speeds_rad_s * grid.speed_share
    # A gridpoint at which no joint moves gets the largest limit found elsewhere.
    rate = np.full(len(grid.s), np.inf)
    for state, at in ((ends.start, slice(None, -1)), (ends.end, slice(1, None))):
        dq = state.dq_rad
        bound = np.divide(allowed, np.abs(dq), out=np.full(dq.shape, np.inf), where=dq != 0.0).min(axis=1)
        rate[at] = np.minimum(rate[at], bound)
    rate[np.isinf(rate)] = rate[np.isfinite(rate)].max()
    rate[rest] = 0.0
    if np.isinf(grid.growth):
        return np.asarray(rate**2)
    # Where the solution before is slow, friction hardly depends on speed: there x may grow to a share of its peak.
    known = np.maximum(grid.tangent_x, SLOW_SHARE * grid.tangent_x.max())
    return np.asarray(np.minimum(rate**2, grid.growth * known))


def half_planes(ends: Ends, grid: Grid, limits: Limits, x_limits: Floats) -> tuple[Floats, Floats]:
    """Return ((c, d) of each half-plane, shape (intervals, planes, 2); their bounds, shape (intervals, planes))."""
    h = np.diff(grid.s)[:, None]
    accelerations = limits.accelerations_rad_s2 * grid.acceleration_share
    sides = []
    for state, at_end in ((ends.start, False), (ends.end, True)):
        for sign in (1.0, -1.0):
            sides.append(_side(sign * state.dq_rad, sign * state.ddq_rad, accelerations, h, at_end))
    if limits.load is not None:
        for terms, at_end in ((ends.start_terms, False), (ends.end_terms, True)):
            at = slice(1, None) if at_end else slice(None, -1)
            cap = np.maximum(x_limits[at], REST_SHARE * x_limits.max())
            sides += _torque_sides(terms, grid, limits, (grid.tangent_x[at], cap), h, at_end)
    planes, bounds = zip(*sides, strict=True)
    return np.ascontiguousarray(np.concatenate(planes, axis=1)), np.ascontiguousarray(np.concatenate(bounds, axis=1))


def _side(a: Floats, b: Floats, bound: Floats, h: Floats, at_end: bool) -> tuple[Floats, Floats]:
    """Return the half-planes of a u + b x <= bound at the start or the end of each interval; u = (y - x) / (2 h)."""
    slope = a / (2.0 * h)
    c, d = (-slope, b + slope) if at_end else (b - slope, slope)
    return np.stack([c, d], axis=-1), bound


def _torque_sides(
    terms: MotorTerms | None, grid: Grid, limits: Limits, x_at: tuple[Floats, Floats], h: Floats, at_end: bool
) -> list[tuple[Floats, Floats]]:
    """Return the half-planes of both senses of torque, for the flat torque and for the tangent.

    `x_at` holds, at this end of each interval, x where the tangents are to touch, and the largest x.
    """
    assert terms is not None
    assert limits.load is not None
    flat, corner = limits.load.drives.flat_nm, limits.load.drives.corner_rad_s
    cap = x_at[1][:, None]
    share = limits.share * grid.torque_share
    turns = terms.w != 0.0
    corner_x = np.divide(corner, np.abs(terms.w), out=np.full(terms.w.shape, np.inf), where=turns) ** 2
    sides = []
    for sign in (1.0, -1.0):
        v, held = sign * terms.v, sign * terms.h
        touch = _possible_touch(x_at[0][:, None], np.maximum(v, 0.0), share * flat, share * held, corner_x)
        root = np.sqrt(touch)
        slope = np.where(v > 0.0, np.divide(v, 2.0 * root, out=np.zeros(v.shape), where=root > 0.0), v / np.sqrt(cap))
        offset = 0.5 * np.maximum(v, 0.0) * root
        left = share * (flat - held) - offset
        sides.append(_side(sign * terms.a, sign * terms.b + slope, np.maximum(0.0, left), h, at_end))
        falls = touch > corner_x
        if falls.any():
            there = np.where(
                falls, share * flat * np.sqrt(np.where(falls, corner_x, 0.0)) / np.where(falls, root, 1.0), 0
            )
            fall = there / (2.0 * np.where(falls, touch, 1.0))
            left = np.where(falls, 1.5 * there - share * held - offset, left)
            sides.append(_side(sign * terms.a, sign * terms.b + slope + fall, np.maximum(0.0, left), h, at_end))
    return sides


def _possible_touch(wanted: Floats, v: Floats, flat: Floats, held: Floats, corner_x: Floats) -> Floats:
    """Return where tangents touch so that rest stays possible under them: as wanted, else less.

    At x = 0 the tangents leave 1.5 T(touch) - held - v sqrt(touch) / 2; a tenth of what rest has must stay.
    """
    touch = np.maximum(np.broadcast_to(wanted, v.shape), 0.0)
    for _ in range(MOST_HALVINGS):
        falling = np.sqrt(np.divide(corner_x, touch, out=np.ones(v.shape), where=touch > corner_x))
        top = np.where(touch > corner_x, 1.5 * falling, 1.0) * flat
        short = top - held - 0.5 * v * np.sqrt(touch) < 0.1 * (flat - held)
        if not short.any():
            break
        touch = np.where(short, 0.5 * touch, touch)
    return touch
