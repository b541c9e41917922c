"""What the board does to a running motion keeps the joints' accelerations, by an oracle that knows nothing of it.

Of the steps made only their ticks are looked at. A linear programme finds the motion within the joint's acceleration
that is closest to them; issue: no step may differ from it by more than one micro-step. A step is made where the motion
passes a whole micro-step, so that a lawful motion itself is off by none.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import csr_matrix, diags, hstack, vstack

from firmware_board import NativeFirmware, Schedule
from firmware_player import FAST, Player
from planarm_wire.messages import (
    HOLD_CODE,
    JOINTS,
    TICKS_HZ,
    Fault,
    Override,
    Resume,
    State,
    Stop,
)
from stretch_motion import SEGMENT_TICKS

MOST_OFF_USTEPS = 1.0
GRID_S = 0.5e-3
REST_TICKS = TICKS_HZ // 20
LONG = 10**9


def least_deviation_usteps(ticks: Sequence[int], most_usteps_s2: float) -> float:
    """Return by how much the steps differ, at the least, from any motion whose acceleration is at most so large.

    The motion is drawn by straight lines between points 0.5 ms apart, whose second differences are bounded: a bent one
    is off by an eighth of `most_usteps_s2 GRID_S^2` in between, 0.0125 micro-steps at 400,000.
    """
    at_s = (np.asarray(ticks) - ticks[0]) / TICKS_HZ
    steps = np.arange(len(at_s), dtype=float)
    points = int(at_s[-1] / GRID_S) + 3
    place = at_s / GRID_S + 0.5
    before = np.floor(place).astype(int)
    share = place - before
    rows = np.tile(np.arange(len(at_s)), 2)
    motion = csr_matrix((np.r_[1 - share, share], (rows, np.r_[before, before + 1])), shape=(len(at_s), points))
    bend = diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(points - 2, points))
    off, none = csr_matrix(-np.ones((len(at_s), 1))), csr_matrix((points - 2, 1))
    below = vstack([hstack([motion, off]), hstack([-motion, off]), hstack([bend, none]), hstack([-bend, none])])
    limit = np.full(2 * (points - 2), most_usteps_s2 * GRID_S**2)
    found = linprog(
        np.r_[np.zeros(points), 1.0],
        A_ub=below.tocsr(),
        b_ub=np.r_[steps, -steps, limit],
        bounds=[(None, None)] * points + [(0, None)],
        method="highs",
    )
    assert found.status == 0, found.message
    return float(found.fun)


def without_long_rests(ticks: Sequence[int]) -> list[int]:
    """The ticks with rests cut to 50 ms, in which the arm has come to rest."""
    kept, cut = [ticks[0]], 0
    for tick, later in pairwise(ticks):
        cut += max(0, later - tick - REST_TICKS)
        kept.append(later - cut)
    return kept


def started(firmware: NativeFirmware, run_segments: int) -> Player:
    player = Player(firmware, FAST)
    player.start()
    player.play_until(player.board.now + run_segments * SEGMENT_TICKS)
    return player


def end(player: Player, *, feed: bool = True) -> None:
    player.play_until(player.board.now + LONG, State.READY, State.FAULT, feed=feed)


def assert_lawful(player: Player, *, whole: bool = True) -> None:
    """The motion ended well, made as many steps as it told, and is within a micro-step of a lawful one."""
    status = player.board.ask()
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    made = tuple(player.board.position_at(joint, player.board.now) for joint in range(JOINTS))
    assert status.ledger.position_usteps == made
    assert (made == Schedule.of(player.motion.segments).positions()) is whole
    for joint in range(JOINTS):
        most_usteps_s2 = player.motion.acceleration[joint] * TICKS_HZ**2
        ticks = without_long_rests(player.board.rises(joint))
        assert least_deviation_usteps(ticks, most_usteps_s2) <= MOST_OFF_USTEPS, joint


def test_the_oracle_sees_what_is_unlawful(native_firmware: NativeFirmware) -> None:
    # The plan takes 0.8 of the acceleration; and a speed that changes at once is more than a step off.
    player = started(native_firmware, 1)
    end(player)
    most_usteps_s2 = FAST.acceleration[0] * TICKS_HZ**2
    ticks = player.board.rises(0)
    assert least_deviation_usteps(ticks, most_usteps_s2) < 0.1
    assert least_deviation_usteps(ticks, 0.85 * most_usteps_s2) < 0.1
    assert least_deviation_usteps(ticks, 0.75 * most_usteps_s2) > MOST_OFF_USTEPS
    slower = np.cumsum([0] + [800] * 400 + [1200] * 400)  # 20,000 steps/s to 13,333
    off_usteps = (20_000 - 13_333) ** 2 / (16 * most_usteps_s2)
    assert least_deviation_usteps(slower.tolist(), most_usteps_s2) == pytest.approx(off_usteps, abs=0.3)


@pytest.mark.parametrize("after", [8, 14, 25, 40])
def test_a_hold_and_what_follows(native_firmware: NativeFirmware, after: int) -> None:
    player = started(native_firmware, after)
    player.board.receive(bytes([HOLD_CODE]))
    player.play_until(player.board.now + LONG, State.HELD)
    player.board.send(Resume())
    end(player)
    assert_lawful(player)


@pytest.mark.parametrize("percent", [50, 5])
def test_an_override_in_mid_motion_and_back(native_firmware: NativeFirmware, percent: int) -> None:
    player = started(native_firmware, 20)
    player.board.send(Override(percent))
    player.play_until(player.board.now + 12 * SEGMENT_TICKS)
    player.board.send(Override(100))
    end(player)
    assert_lawful(player)


@pytest.mark.parametrize(("after", "silent_segments"), [(10, 14), (20, 4), (20, 20), (25, 30), (14, 200)])
def test_a_queue_that_starves_and_is_fed_again(
    native_firmware: NativeFirmware, after: int, silent_segments: int
) -> None:
    player = started(native_firmware, after)
    player.play_until(player.board.now + silent_segments * SEGMENT_TICKS, feed=False)
    end(player)
    assert_lawful(player)


def stop(player: Player) -> None:
    player.board.send(Stop(0))


def quick_stop(player: Player) -> None:
    player.board.send(Stop(1))


def stop_then_quickly(player: Player) -> None:
    stop(player)
    player.board.run(SEGMENT_TICKS)
    quick_stop(player)


def quick_stop_when_slow(player: Player) -> None:
    player.board.send(Override(20))
    player.board.run(3 * SEGMENT_TICKS)
    quick_stop(player)


@pytest.mark.parametrize("after", [12, 30])
@pytest.mark.parametrize("how", [stop, quick_stop, stop_then_quickly, quick_stop_when_slow])
def test_a_stop(native_firmware: NativeFirmware, after: int, how: Callable[[Player], None]) -> None:
    player = started(native_firmware, after)
    how(player)
    end(player, feed=False)
    assert_lawful(player, whole=False)


@pytest.mark.parametrize("seed", range(4))
def test_everything_by_chance(native_firmware: NativeFirmware, seed: int) -> None:
    chance = random.Random(seed)
    player = started(native_firmware, 5)
    begin, feed = player.board.now, True
    while player.play_until(player.board.now + chance.randrange(SEGMENT_TICKS // 3, 4 * SEGMENT_TICKS), feed=feed) and (
        player.board.ask().state is not State.READY and player.board.now < begin + 200 * SEGMENT_TICKS
    ):
        feed = chance.random() < 0.8
        chosen = chance.random()
        if chosen < 0.2:
            player.board.receive(bytes([HOLD_CODE]))
        elif chosen < 0.6:
            player.board.send(Resume())
        else:
            player.board.send(Override(chance.choice([5, 30, 60, 90, 100])))
    player.board.send(Override(100))
    player.board.send(Resume())
    end(player)
    assert_lawful(player)
