"""The joints' angles and derivatives along a path of the tip made of quadratic pieces: the compiled inner loop.

Source: paper C, eqs. 3-9, with the sign of eq. 9 corrected, and the second derivative of the two-link chain:
tip' = J q', and tip'' = J q'' - e (q1')^2 - f (q1' + q2')^2 with e from the base to the elbow and f from the elbow to
the tip, since each link's end is accelerated to its centre. Both are solved with J = [perp(e + f), perp(f)].
"""

from math import atan2, cos, nan, sin

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import kernel

Floats = NDArray[np.float64]


@kernel
def piece_of(borders_s: Floats, s: float, right: bool, hint: int) -> int:
    """Return the piece that holds s, at a border the one on the given side; `hint` is where to look first."""
    last = int(borders_s.shape[0]) - 2
    if 0 <= hint <= last and borders_s[hint] < s < borders_s[hint + 1]:
        return hint
    low, high = 0, borders_s.shape[0]
    while low < high:
        middle = (low + high) // 2
        if borders_s[middle] < s or (right and borders_s[middle] == s):
            low = middle + 1
        else:
            high = middle
    return min(max(low - 1, 0), last)


@kernel
def joint_states(
    arm: Floats, borders_s: Floats, tips_cm: Floats, pieces: Floats, directions_rad: Floats, s: Floats, right: bool
) -> tuple[Floats, Floats, Floats]:
    """Return angles and their first and second derivatives by s, each of shape (m, 2).

    NaN where the arm does not reach; the derivatives also where it is straight.

    Args:
        arm: length of both links, base x and y in cm, and -1 or 1, the sign of theta2.
        borders_s: ends of the pieces, shape (pieces + 1,).
        tips_cm: tip at each border, shape (pieces + 1, 2).
        pieces: first and second derivative of the tip at the start of each piece, shape (pieces, 4).
        directions_rad: direction of the tip from the base at each border, without jumps.
        s: where, shape (m,).
        right: at a border, take the piece after it.
    """
    l1, l2, base_x, base_y, sign = arm[0], arm[1], arm[2], arm[3], arm[4]
    count = s.shape[0]
    q, dq, ddq = np.empty((count, 2)), np.empty((count, 2)), np.empty((count, 2))
    at = 0
    for i in range(count):
        at = piece_of(borders_s, s[i], right, at)
        into = s[i] - borders_s[at]
        from_x, from_y = tips_cm[at, 0] - base_x, tips_cm[at, 1] - base_y
        bend_x, bend_y = pieces[at, 2], pieces[at, 3]
        slope_x, slope_y = pieces[at, 0] + into * bend_x, pieces[at, 1] + into * bend_y
        x = from_x + 0.5 * into * (pieces[at, 0] + slope_x)
        y = from_y + 0.5 * into * (pieces[at, 1] + slope_y)
        cosine = (x * x + y * y - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)
        if not -1.0 <= cosine <= 1.0:
            for j in range(2):
                q[i, j] = dq[i, j] = ddq[i, j] = nan
            continue
        q2 = sign * np.arccos(cosine)
        direction = directions_rad[at] + atan2(from_x * y - from_y * x, from_x * x + from_y * y)
        q1 = direction - atan2(l2 * sin(q2), l1 + l2 * cosine)
        q[i, 0], q[i, 1] = q1, q2
        e_x, e_y = l1 * cos(q1), l1 * sin(q1)
        f_x, f_y = l2 * cos(q1 + q2), l2 * sin(q1 + q2)
        determinant = e_x * f_y - e_y * f_x
        inverse = 1.0 / determinant if determinant != 0.0 else nan
        # The tip's velocity is perp(e) w1 + perp(f) w2 with the turning rates of both links. Its product with f
        # removes w2, and with e removes w1: perp(e) . f = e x f, perp(f) . e = -(e x f).
        w1, w2 = (slope_x * f_x + slope_y * f_y) * inverse, -(slope_x * e_x + slope_y * e_y) * inverse
        acceleration_x = bend_x + e_x * w1 * w1 + f_x * w2 * w2
        acceleration_y = bend_y + e_y * w1 * w1 + f_y * w2 * w2
        u1 = (acceleration_x * f_x + acceleration_y * f_y) * inverse
        u2 = -(acceleration_x * e_x + acceleration_y * e_y) * inverse
        dq[i, 0], dq[i, 1] = w1, w2 - w1
        ddq[i, 0], ddq[i, 1] = u1, u2 - u1
    return q, dq, ddq
