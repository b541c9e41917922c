"""Allowances of the path clock, the path time to rest, and motions slowed down until every stop fits."""

from dataclasses import replace

import numpy as np
import pytest

from host_scenes import make_scene
from motion_paths import joint, joint_line, joint_waves, tip_path, tip_points, waves
from planarm.scene import MechanicsSpec
from planarm.stepping.check_motion import Planned
from planarm.stepping.check_stop import check_stop
from planarm.stepping.schedule import schedule
from planarm.stepping.slowing import shortfall_ticks
from planarm.stepping.stopping import LARGEST_RATE_PER_S, Slices, allowances, least_of_neighbours, path_ticks_to_rest
from planarm.stepping.table import table_of
from planarm.trajectory.timing import time_path
from planarm_wire.messages import SLICE_TICKS, TICKS_HZ
from planarm_wire.wirings import board_of

SLICE = SLICE_TICKS
ONE = joint(speed=2.0, acceleration=10.0)
SCENE = replace(make_scene(), joints=(ONE, ONE))


def slices(trajectory):
    return [SLICE] * int(trajectory.duration_s * 16e6 / SLICE)


def test_the_allowance_is_what_the_acceleration_leaves_over_the_speed():
    """Along a line with 8 of 10 rad/s^2: 10 / 2 in the middle, at 2 rad/s; 2 / speed while braking."""
    motion = time_path(joint_line((0.0, 0.0), (3.0, 0.0)), SCENE.joints)
    found = allowances(motion, SCENE, slices(motion))
    middle, early, late = found[len(found) // 2], found[len(found) // 10], found[-(len(found) // 10) - 1]
    assert middle.slow_per_s == pytest.approx(5.0, rel=1e-3)
    assert middle.fast_per_s == pytest.approx(5.0, rel=1e-3)
    speed = 8.0 * (len(found) // 10 + 1) * SLICE / 16e6
    assert early.slow_per_s == pytest.approx(10.0 / speed, rel=0.02)
    assert early.fast_per_s == pytest.approx(2.0 / speed, rel=0.02)
    assert late.slow_per_s < 0.25 * late.fast_per_s


def test_nothing_that_rests_limits():
    motion = time_path(joint_line((0.0, 0.0), (1.0, 0.0)), SCENE.joints)
    assert allowances(motion, SCENE, []) == ()
    found = allowances(motion, SCENE, [*slices(motion), SLICE, 16_000_000])
    assert found[-1].slow_per_s == LARGEST_RATE_PER_S
    assert found[-1].need_ticks == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_joints_keep_their_accelerations_at_every_rate_of_the_clock(seed):
    """q'' u^2 + q' du/dt, at random moments, rates u up to 1 and changes within the allowance."""
    rng = np.random.default_rng(seed)
    motion = time_path(waves(rng), SCENE.joints)
    found = allowances(motion, SCENE, slices(motion))
    ticks = rng.uniform(0.0, len(found) * SLICE - 1, 4000)
    _, speeds, accelerations = motion.sample(ticks / 16e6)
    segment = (ticks // SLICE).astype(int)
    u = rng.uniform(0.0, 1.0, len(ticks))[:, None]
    for sign, name in ((-1.0, "slow_per_s"), (1.0, "fast_per_s")):
        rate = sign * np.array([getattr(found[k], name) for k in segment])[:, None]
        assert np.abs(accelerations * u**2 + speeds * rate).max() <= 10.0 * (1.0 + 2e-3)


def test_a_stop_from_a_constant_speed_takes_half_of_v_over_a():
    """d(u^2)/d tau = -2 a / v from 1 to the start-stop speed's square; the device's rule takes a little more."""
    v, a, start_stop = 2.0, 10.0, 0.1

    def stop_s(segment_s):
        count = int(1.0 / segment_s)
        each = Slices.of([round(segment_s * TICKS_HZ)] * count)
        ticks = np.arange(0.0, TICKS_HZ, 1000.0)
        return path_ticks_to_rest(each, np.full(count, a / v), ticks, np.full(len(ticks), v / start_stop))[0] / TICKS_HZ

    ideal = v / (2.0 * a) * (1.0 - (start_stop / v) ** 2)
    assert ideal < stop_s(1e-4) < 1.1 * ideal
    assert stop_s(1e-4) < stop_s(4.1e-3) < 1.5 * ideal


def test_messages_share_the_least_of_their_segments():
    rates = np.array([5.0, 4.0, 9.0, 9.0, 9.0, 9.0, 1.0, 9.0])
    assert least_of_neighbours(rates).tolist() == [4.0, 4.0, 4.0, 9.0, 9.0, 1.0, 1.0, 1.0]


def scheduled(seed, one=ONE):
    scene = replace(make_scene(), joints=(one, one))
    path = tip_path(tip_points(np.random.default_rng(seed), 5))
    timed = []

    def timing(limit):
        timed.append(time_path(path, scene.joints, speed_cap=limit))
        return timed[-1]

    return scene, timed, *schedule(scene, timing)


def test_a_motion_is_slowed_down_until_every_stop_fits():
    scene, timed, trajectory, _, plan = scheduled(1, joint(speed=4.0, acceleration=4.0))
    assert trajectory.duration_s > 1.01 * timed[0].duration_s
    table = table_of(plan)
    assert shortfall_ticks(plan, table).max() <= 0.0
    checks = check_stop(plan, table, Planned.of(trajectory), scene)
    assert [check.name for check in checks if check.verdict == "red"] == []
    fit = next(check for check in checks if check.name == "road left after a stop")
    assert 0.0 <= fit.value < 0.1


@pytest.mark.parametrize(("joints", "wiring"), [(3, "own"), (4, "own"), (2, "cnc_shield"), (4, "cnc_shield")])
def test_a_small_queue_gets_slower_motions_with_all_stops_in_it(joints, wiring):
    rng = np.random.default_rng(joints)
    one = joint(speed=1.5, acceleration=8.0, usteps_per_rev=8_000)
    scene = replace(make_scene(), joints=(one,) * joints, coupling=tuple(map(tuple, np.eye(joints))), wiring=wiring)
    scene = replace(scene, arm=replace(scene.arm, link_lengths_cm=(10.0,) * joints))
    scene = replace(scene, mechanics=MechanicsSpec.usual(scene.arm.link_lengths_cm))
    path = joint_waves(rng, joints)
    fastest = time_path(path, scene.joints)
    trajectory, _, plan = schedule(scene, lambda limit: time_path(path, scene.joints, speed_cap=limit))
    table = table_of(plan)
    assert table.board == board_of(joints, wiring)
    assert {len(segment.moves) for segment in plan.segments} == {table.board.joints}
    assert shortfall_ticks(plan, table).max() <= 0.0
    assert fastest.duration_s <= trajectory.duration_s < 3.5 * fastest.duration_s
    fit = next(
        check
        for check in check_stop(plan, table, Planned.of(trajectory), scene)
        if check.name == "road left after a stop"
    )
    assert fit.verdict == "green"


def test_a_motion_whose_stops_fit_is_left_alone():
    _, timed, trajectory, _, _ = scheduled(1, joint(speed=0.5, acceleration=20.0))
    assert len(timed) == 1
    assert trajectory is timed[0]


def test_where_no_speed_helps_the_certificate_tells():
    scene = replace(SCENE, joints=(joint(4.0, 2.1), joint(4.0, 2.1)))  # braking with 2 of 2.1: stops are long
    planned = joint(4.0, 2.5)
    path = tip_path(tip_points(np.random.default_rng(1), 5))
    trajectory, _, plan = schedule(scene, lambda _limit: time_path(path, (planned, planned)))
    checks = check_stop(plan, table_of(plan), Planned.of(trajectory), scene)
    road = next(check for check in checks if check.name == "road left after a stop")
    assert road.value < 0.0
    assert road.verdict == "amber"
    assert "max_speed_deg_s" in road.setting


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda one: replace(one, slow_per_s=1.2 * one.slow_per_s), "allowed slowing"),
        (lambda one: replace(one, fast_per_s=1.2 * one.fast_per_s), "allowed speeding up"),
        (lambda one: replace(one, need_ticks=0.5 * one.need_ticks), "beyond what is told"),
        (None, "without allowance"),
    ],
)
def test_changed_allowances_turn_the_certificate_red(change, name):
    scene, _, trajectory, _, plan = scheduled(1)
    told = tuple(change(one) for one in plan.allowances) if change else ()
    checks = check_stop(replace(plan, allowances=told), table_of(plan), Planned.of(trajectory), scene)
    red = [check.name for check in checks if check.verdict == "red"]
    assert any(name in one for one in red), red
