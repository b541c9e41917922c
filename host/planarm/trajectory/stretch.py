"""How fast the path clock of a planned motion may change, by the torque that the motors have.

At the rate u of the clock, 0 < u <= 1, and its change u', a motor gives a u' + b u^2 + v u + h (`motor_terms` along the
motion, with time as the path's parameter) and has T(w u) in either sense. So with the sense that u' asks for,

    |u'| <= min over u of (T(w u) - (h + v u + b u^2)) / |a|,

h, v and b taken in that sense. Over each of a few ranges of u the numerator is bounded from below: T falls with u, and
v u and b u^2 have their extremes at the ends. Together the ranges hold every rate that the device may run the clock at.
"""

import numpy as np

from planarm.dynamics.motor_terms import Load, MotorTerms, motor_terms
from planarm.dynamics.pull_out import Drives, pull_out_nm
from planarm.smoothing.smooth_path import Floats
from planarm_wire.kernel_cache import kernel

RANGES = 8
"""Ranges of u; with more the bound is closer, by less than the model of the torque is good for."""


def torque_changes(load: Load, q_rad: Floats, speeds_rad_s: Floats, accelerations_rad_s2: Floats) -> Floats:
    """Return the largest slowing and speeding up of the path clock in 1/s, infinite where no motor limits it.

    Args:
        load: masses and motors, with the share of the torque that may be used.
        q_rad: the planned motion at some times, shape (n, joints), as are the next two.
        speeds_rad_s: at rate 1.
        accelerations_rad_s2: at rate 1.

    Returns:
        Shape (2, n): slowing, speeding up; 0 where a motor has nothing left for it.
    """
    changes = np.full((2, len(q_rad)), np.inf)
    _fill(load.drives, motor_terms(load, q_rad, speeds_rad_s, accelerations_rad_s2, np.sign(speeds_rad_s)), changes)
    return changes


@kernel
def _fill(drives: Drives, terms: MotorTerms, changes: Floats) -> None:
    a, b, v, h, w = terms
    for row in range(2):
        for i in range(a.shape[0]):
            for m in range(a.shape[1]):
                if a[i, m] == 0.0:
                    continue
                sense = 1.0 if (a[i, m] > 0.0) == (row == 1) else -1.0
                left = np.inf
                for k in range(RANGES):
                    low, high = k / RANGES, (k + 1) / RANGES
                    viscous, inertial = sense * v[i, m], sense * b[i, m]
                    most = sense * h[i, m] + max(viscous * low, viscous * high)
                    most += max(inertial * low * low, inertial * high * high)
                    left = min(left, pull_out_nm(drives, m, high * w[i, m]) - most)
                changes[row, i] = min(changes[row, i], max(0.0, left) / abs(a[i, m]))
