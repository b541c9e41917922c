"""Where along a path each motor passes the middle between two micro-steps.

Between gridpoints and turning points a motor's position x(s), in micro-steps, is monotone, so each crossing is the one
root of x(s) = n + 1/2 in its piece. A first guess comes from the cubic that has the values and slopes of both ends of
the piece; Newton's method, kept in the piece by bisection, ends when what its next step would change is known to be
below ROOT_USTEPS. So it takes one look at the path for most crossings, and more only near turning points.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planarm.errors import TimingError
from planarm.model.transmission import Transmission
from planarm.smoothing.smooth_path import SmoothPath
from planarm.stepping.train import Directions, Floats

Indices = NDArray[np.intp]

ROOT_USTEPS = 1e-8
"""A crossing is found when the motor is this near to the middle."""

MAX_ITERATIONS = 100

CUBIC_ITERATIONS = 3


class Crossings(NamedTuple):
    """The crossings of all motors, one motor after the other, each in the order of the path; shape (n,) each."""

    motor: Indices
    s: Floats
    direction: Directions


@dataclass(frozen=True, slots=True)
class _Pieces:
    """Monotone pieces of the motors' positions, motor by motor; shape (pieces,) each."""

    motor: Indices
    s_low: Floats
    s_high: Floats
    x_low: Floats
    x_high: Floats
    rate_low: Floats
    rate_high: Floats


def find_crossings(path: SmoothPath, grid_s: Floats, transmission: Transmission) -> Crossings:
    """Return every crossing of every motor.

    Args:
        path: the joints' path.
        grid_s: where to look for turning points in between, ascending, with all borders of the path's pieces.
        transmission: which motor moves which joint.

    Raises:
        TimingError: a crossing cannot be located; the path is not smooth where it should be.
    """
    usteps_per_rad = transmission.usteps_per_rad
    zero_usteps = usteps_per_rad @ transmission.zero_rad
    pieces = _monotone_pieces(path, grid_s, usteps_per_rad, zero_usteps)
    low, high = np.floor(pieces.x_low + 0.5), np.floor(pieces.x_high + 0.5)
    crossed = np.abs(high - low).astype(np.int64)
    piece = np.repeat(np.arange(len(crossed)), crossed)
    direction = np.sign(high - low)[piece]
    nth = np.arange(len(piece)) - (np.cumsum(crossed) - crossed)[piece]
    middles = low[piece] + direction * (nth + 0.5)
    guess = _cubic_guess(pieces, piece, middles)
    motor = pieces.motor[piece]
    bracket = guess, pieces.s_low[piece], pieces.s_high[piece]
    s = _located(path, usteps_per_rad[motor], middles + zero_usteps[motor], direction, bracket)
    return Crossings(motor, s, direction.astype(np.int8))


def _monotone_pieces(path: SmoothPath, s: Floats, usteps_per_rad: Floats, zero_usteps: Floats) -> _Pieces:
    """Cut the grid's intervals at turning points, motor by motor."""
    right, left = path.evaluate(s[:-1], "right"), path.evaluate(s[1:], "left")
    x_low, x_high = (side.q_rad @ usteps_per_rad.T - zero_usteps for side in (right, left))
    rate_low, rate_high = right.dq_rad @ usteps_per_rad.T, left.dq_rad @ usteps_per_rad.T
    motor, turning = np.nonzero((rate_low * rate_high < 0.0).T)
    roots = _turning_points(path, usteps_per_rad[motor], s[turning], s[turning + 1], rate_low[turning, motor])
    x_turn = np.einsum("ij,ij->i", path.evaluate(roots).q_rad, usteps_per_rad[motor]) - zero_usteps[motor]
    intervals, motors = x_low.shape
    after = motor * intervals + turning + 1
    still = np.zeros(len(roots))

    return _Pieces(
        np.insert(np.repeat(np.arange(motors), intervals), after, motor),
        np.insert(np.tile(s[:-1], motors), after, roots),
        np.insert(np.tile(s[1:], motors), after - 1, roots),
        np.insert(x_low.T.ravel(), after, x_turn),
        np.insert(x_high.T.ravel(), after - 1, x_turn),
        np.insert(rate_low.T.ravel(), after, still),
        np.insert(rate_high.T.ravel(), after - 1, still),
    )


def _turning_points(path: SmoothPath, gear: Floats, low: Floats, high: Floats, rate_low: Floats) -> Floats:
    """Return where a motor's rate changes its sign between `low` and `high`.

    By false position (Illinois: an end that stays twice counts half), with bisection each time three steps have not
    halved the bracket. The position is flat there, so the square root of the machine's precision is far below any tick.
    """
    low, high = low.copy(), high.copy()
    value_low, value_high = rate_low.copy(), -rate_low  # only the sign of the far end is known; the first step bisects
    width, side, since = high - low, np.zeros(len(low)), 0
    enough = 1e-9 * width
    for iteration in range(MAX_ITERATIONS):
        share = value_low / (value_low - value_high)
        if since == 3:
            share = np.where(high - low > 0.5 * width, 0.5, share)
            width, since = high - low, 0
        middle = low + np.clip(share, 1e-3, 1.0 - 1e-3) * (high - low)
        value = np.einsum("ij,ij->i", path.evaluate(middle).dq_rad, gear)
        is_low = value * rate_low > 0.0
        stays = np.where(is_low, 1.0, -1.0) == side
        value_high = np.where(is_low, np.where(stays, 0.5 * value_high, value_high), value)
        value_low = np.where(is_low, value, np.where(stays, 0.5 * value_low, value_low))
        low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        side, since = np.where(is_low, 1.0, -1.0), since + 1
        if iteration and ((high - low <= enough) | (value == 0.0)).all():
            break
    return np.asarray(low + 0.5 * (high - low))


def _cubic_guess(pieces: _Pieces, piece: Indices, middles: Floats) -> Floats:
    """Return where the cubic through both ends of each piece passes the middles."""
    length = (pieces.s_high - pieces.s_low)[piece]
    x0, rise = pieces.x_low[piece], (pieces.x_high - pieces.x_low)[piece]
    start, end = pieces.rate_low[piece] * length / rise, pieces.rate_high[piece] * length / rise
    wanted = (middles - x0) / rise
    # From a turning point on, the position grows with the square.
    share = np.where(start <= 0.0, np.sqrt(wanted), np.where(end <= 0.0, 1.0 - np.sqrt(1.0 - wanted), wanted))
    a, b = start + end - 2.0, 3.0 - 2.0 * start - end
    for _ in range(CUBIC_ITERATIONS):
        error = share * (start + share * (b + share * a)) - wanted
        slope = start + share * (2.0 * b + 3.0 * share * a)
        share = np.clip(share - np.divide(error, slope, out=np.zeros_like(error), where=slope > 0.0), 0.0, 1.0)
    return np.asarray(pieces.s_low[piece] + share * length)


def _located(
    path: SmoothPath, gear: Floats, middles: Floats, direction: Floats, bracket: tuple[Floats, Floats, Floats]
) -> Floats:
    """Return where each motor passes its middle; the bracket is (guess, low, high)."""
    s, low, high = bracket
    left = np.arange(len(s))
    for _ in range(MAX_ITERATIONS):
        if not len(left):
            return s
        at = s[left]
        state = path.evaluate(at)
        error = np.einsum("ij,ij->i", state.q_rad, gear[left]) - middles[left]
        rate = np.einsum("ij,ij->i", state.dq_rad, gear[left])
        bend = np.einsum("ij,ij->i", state.ddq_rad, gear[left])
        before = (error < 0.0) == (direction[left] > 0.0)
        low[left] = np.where(before, at, low[left])
        high[left] = np.where(before, high[left], at)
        step = np.divide(-error, rate, out=np.full(len(at), np.inf), where=rate != 0.0)
        newton = at + step
        inside = (newton >= low[left]) & (newton <= high[left])
        following = np.where(inside, newton, 0.5 * (low[left] + high[left]))
        with np.errstate(invalid="ignore", over="ignore"):
            remains = np.where(inside, 0.5 * np.abs(bend) * step * step, np.inf)
        done = (np.abs(error) <= ROOT_USTEPS) | (remains <= ROOT_USTEPS)
        # A bracket that rounding leaves no point in is as good as found.
        done |= (following <= low[left]) & (following >= high[left])
        done |= high[left] - low[left] <= np.spacing(np.abs(at))
        s[left] = following
        left = left[~done]
    motor_place = path.place(float(s[left[0]]))
    raise TimingError(f"steps at {motor_place} could not be located; the path is not smooth there: move its way-points")
