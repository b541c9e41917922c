"""How long a motion takes once it is slowed down where a stop takes more road than the device holds.

The device can come to rest on the path only within what its queue holds. Planning ends by slowing the motion where
that is too little for a stop; here the same is estimated on the optimiser's coarse grid, so that the search does not
run after speed that is taken away again. A stop along the path follows d(u^2)/d tau = -2 slow, u the rate of the path
clock, with the slowing that all of each joint's acceleration allows; it takes a path time that grows with the speed,
so where it is k times the road there is, the motion is k times slower for as long as the stop lasts.
"""

from math import inf, sqrt

import numpy as np

from planarm.smoothing.smooth_path import Floats
from planarm_wire.kernel_cache import kernel


@kernel
def slowed_duration_s(
    dq: Floats, ddq: Floats, x: Floats, h: float, accelerations_rad_s2: Floats, road_s: float
) -> float:
    """Return the duration of a motion, in seconds, once all its stops fit; infinite when nothing moves somewhere.

    Args:
        dq: derivatives of the angles by the path parameter at the gridpoints, shape (n, joints).
        ddq: second derivatives.
        x: the squared rate of the path parameter there, shape (n,).
        h: between gridpoints.
        accelerations_rad_s2: all that each joint has, shape (joints,).
        road_s: path time that the device's queue holds, less the link's margin.
    """
    count, joints = dq.shape[0] - 1, dq.shape[1]
    times, slow, slower = np.empty(count), np.empty(count), np.ones(count)
    left_s = 0.0
    for i in range(count):
        both = sqrt(x[i]) + sqrt(x[i + 1])
        if both <= 0.0:
            return inf
        times[i] = 2.0 * h / both
        left_s += times[i]
        u, middle = (x[i + 1] - x[i]) / (2.0 * h), 0.5 * (x[i] + x[i + 1])
        slow[i] = inf
        for j in range(joints):
            speed = 0.5 * (dq[i, j] + dq[i + 1, j]) * sqrt(middle)
            change = 0.5 * (dq[i, j] + dq[i + 1, j]) * u + 0.5 * (ddq[i, j] + ddq[i + 1, j]) * middle
            if speed != 0.0:
                braking = max(0.0, -change if speed > 0.0 else change)
                slow[i] = min(slow[i], max(0.0, accelerations_rad_s2[j] - braking) / abs(speed))
    for i in range(count):
        if left_s <= road_s:
            break
        left_s -= times[i]
        needed, squared, end = 0.0, 1.0, i
        while end < count and squared > 0.0:
            lost = 2.0 * slow[end] * times[end]
            needed += times[end] * (1.0 if lost <= squared else squared / lost)
            squared -= lost
            end += 1
        if needed > road_s:
            for k in range(i, end):
                slower[k] = max(slower[k], needed / road_s)
    total = 0.0
    for i in range(count):
        total += times[i] * slower[i]
    return total
