"""What a spline costs: its duration under speed and acceleration, and seconds for coming too near to anything.

The duration is that of the time-optimal motion on a coarse grid, slowed down where a stop would not fit, good to
about a hundredth, which is all that a comparison of splines needs. Clearance, joint limits and the tip's rectangle
are looked at on the same grid; the price for what is missing is exact: high enough that the best spline under it
keeps all of them. What the optimiser hands out is proved and timed anew.
"""

from math import inf
from typing import NamedTuple

import numpy as np

from planarm.fastest.stops import slowed_duration_s
from planarm.smoothing.smooth_path import Floats
from planarm.trajectory.topp import fastest_squared_speeds
from planarm.workspace.joint_proof import JointWorld, link_ends, link_spare
from planarm_wire.kernel_cache import kernel

INTERVALS = 12
"""Gridpoints on each span."""

PRICE_S_CM = 10.0
"""Seconds for each centimetre that is missing; a centimetre of room gains some hundredths of a second."""

CM_PER_RAD = 30.0
"""What a radian beyond a joint limit counts, in centimetres."""

IMPOSSIBLE_S = 1e6


class Problem(NamedTuple):
    """What the splines of one search have in common."""

    world: JointWorld
    basis: Floats
    """Of `spline_basis.span_basis`, shape (spans, 4, controls)."""
    start_rad: Floats
    goal_rad: Floats
    speeds_rad_s: Floats
    accelerations_rad_s2: Floats
    box_cm: Floats
    """Least and greatest x and y of the tip, shape (4,)."""
    extra_cm: float
    """Clearance wanted at gridpoints beyond the margin, for what lies between them."""
    stopping_rad_s2: Floats
    """All of each joint's acceleration, for stops."""
    road_s: float
    """Path time within which every stop has to end; infinite when stops need not fit."""


@kernel
def costs(problem: Problem, candidates: Floats, out: Floats) -> None:
    """Fill (cost in s, duration in s, what is missing in cm) of each candidate, shape (candidates, 3).

    A candidate is the row of its inner control points, joint by joint within each point: shape (candidates, inner * n).
    """
    spans, joints = problem.basis.shape[0], problem.start_rad.shape[0]
    count = spans * INTERVALS + 1
    q, dq, ddq = np.empty((count, joints)), np.empty((count, joints)), np.empty((count, joints))
    planes, bounds = np.empty((count - 1, 4 * joints, 2)), np.empty((count - 1, 4 * joints))
    for i in range(count - 1):
        for j in range(joints):
            bounds[i, 4 * j : 4 * j + 4] = problem.accelerations_rad_s2[j]
    controls, ends = np.empty((problem.basis.shape[2], joints)), np.empty((joints + 1, 2))
    for k in range(candidates.shape[0]):
        _fill_controls(problem, candidates[k], controls)
        _evaluate(problem.basis, controls, q, dq, ddq)
        missing = _missing_cm(problem, q, ends)
        duration = _duration_s(problem, dq, ddq, planes, bounds)
        out[k, 0], out[k, 1], out[k, 2] = duration + PRICE_S_CM * missing, duration, missing


@kernel
def _fill_controls(problem: Problem, candidate: Floats, controls: Floats) -> None:
    joints, last = controls.shape[1], controls.shape[0] - 1
    for j in range(joints):
        controls[0, j], controls[last, j] = problem.start_rad[j], problem.goal_rad[j]
        for c in range(1, last):
            controls[c, j] = candidate[(c - 1) * joints + j]


@kernel
def _evaluate(basis: Floats, controls: Floats, q: Floats, dq: Floats, ddq: Floats) -> None:
    """Fill angles and derivatives at every gridpoint; s is one a span."""
    spans = basis.shape[0]
    for p in range(spans):
        for j in range(controls.shape[1]):
            c0, c1, c2, c3 = 0.0, 0.0, 0.0, 0.0
            for c in range(p, p + 4):  # only four control points are felt on a span
                c0 += basis[p, 0, c] * controls[c, j]
                c1 += basis[p, 1, c] * controls[c, j]
                c2 += basis[p, 2, c] * controls[c, j]
                c3 += basis[p, 3, c] * controls[c, j]
            for i in range(INTERVALS + (1 if p == spans - 1 else 0)):
                x, at = i / INTERVALS, p * INTERVALS + i
                q[at, j] = c0 + x * (c1 + x * (c2 + x * c3))
                dq[at, j] = c1 + x * (2.0 * c2 + 3.0 * x * c3)
                ddq[at, j] = 2.0 * c2 + 6.0 * x * c3


@kernel
def _missing_cm(problem: Problem, q: Floats, ends: Floats) -> float:
    """Return what is missing to clearance, joint limits and the tip's rectangle, summed over the gridpoints.

    Inside an obstacle the clearance is 0 however deep: there the number of gridpoints tells which spline is nearer out.
    """
    world, box = problem.world, problem.box_cm
    joints = q.shape[1]
    total = 0.0
    for i in range(q.shape[0]):
        missing = 0.0
        for j in range(joints):
            beyond = max(world.low_rad[j] - q[i, j], q[i, j] - world.high_rad[j])
            missing = max(missing, CM_PER_RAD * beyond)
        link_ends(world, q[i], ends)
        for k in range(joints):
            missing = max(missing, problem.extra_cm - link_spare(world, ends, k))
        x, y = ends[joints, 0], ends[joints, 1]
        total += max(missing, box[0] - x, x - box[1], box[2] - y, y - box[3])
    return total


@kernel
def _duration_s(problem: Problem, dq: Floats, ddq: Floats, planes: Floats, bounds: Floats) -> float:
    """Return the duration of the fastest motion on the grid; IMPOSSIBLE_S when nothing moves somewhere."""
    count, joints = dq.shape
    h = 1.0 / INTERVALS
    limits = np.empty(count)
    for i in range(count):
        rate = inf
        for j in range(joints):
            if dq[i, j] != 0.0:
                rate = min(rate, problem.speeds_rad_s[j] / abs(dq[i, j]))
        limits[i] = rate * rate if 0 < i < count - 1 and rate < inf else 0.0
    for i in range(count - 1):
        for j in range(joints):
            a, b, row = dq[i, j] / (2.0 * h), ddq[i, j], 4 * j
            planes[i, row, 0], planes[i, row, 1] = b - a, a
            planes[i, row + 1, 0], planes[i, row + 1, 1] = a - b, -a
            a, b = dq[i + 1, j] / (2.0 * h), ddq[i + 1, j]
            planes[i, row + 2, 0], planes[i, row + 2, 1] = -a, b + a
            planes[i, row + 3, 0], planes[i, row + 3, 1] = a, -b - a
    x = fastest_squared_speeds(planes, bounds, limits)
    if problem.road_s < inf:
        return min(IMPOSSIBLE_S, slowed_duration_s(dq, ddq, x, h, problem.stopping_rad_s2, problem.road_s))
    duration = 0.0
    for i in range(count - 1):
        both = np.sqrt(x[i]) + np.sqrt(x[i + 1])
        if both <= 0.0:
            return IMPOSSIBLE_S
        duration += 2.0 * h / both
    return duration
