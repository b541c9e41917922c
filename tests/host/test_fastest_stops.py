"""Durations of motions that are slowed down until stops fit, and splines found with stops in mind."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from motion_paths import joint
from planarm.experiments.scenes import table1_scene
from planarm.fastest.search import Budget, find_fastest
from planarm.fastest.stops import slowed_duration_s
from planarm.fastest.task import scene_task
from planarm.stepping.schedule import encode, schedule
from planarm.stepping.slowing import LINK_MARGIN_TICKS, road_ticks
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion

ACCELERATION = np.array([10.0, 10.0])


def constant_speed(seconds, speed=2.0, steps_per_s=1000):
    """One joint at a constant speed, the other at rest; s is the time."""
    points = int(seconds * steps_per_s) + 1
    rate = np.tile([speed, 0.0], (points, 1))
    return rate, np.zeros_like(rate), np.ones(points), 1.0 / steps_per_s


def test_a_motion_whose_stops_fit_takes_its_time():
    """At v a stop takes the path time v / (2 a), 0.1 s here."""
    for road_s in (0.101, 1.0, 1e9):
        assert slowed_duration_s(*constant_speed(3.0), ACCELERATION, road_s) == pytest.approx(3.0)


def test_where_the_road_is_half_of_what_a_stop_takes_the_motion_takes_twice_the_time():
    """But for what is left when the queue holds all the rest: from there on no new stop has to fit."""
    found = slowed_duration_s(*constant_speed(3.0), ACCELERATION, 0.05)
    assert 2.0 * (3.0 - 0.05) <= found <= 2.0 * 3.0
    assert slowed_duration_s(*constant_speed(0.05), ACCELERATION, 0.05) == pytest.approx(0.05)


def test_braking_leaves_less_for_a_stop():
    """Braking with 8 of 10 rad/s^2 leaves 2: a stop takes nearly as long as the braking itself."""
    seconds = np.linspace(0.0, 1.0, 1001)
    rate = np.stack([8.0 * (1.0 - seconds), np.zeros(1001)], axis=1)
    bend = np.tile([-8.0, 0.0], (1001, 1))
    plain = slowed_duration_s(rate, bend, np.ones(1001), 1e-3, ACCELERATION, 1e9)
    assert plain == pytest.approx(1.0)
    # d(u^2)/d tau = -2 * 2 / (8 (1 - tau)): u^2 = 1 + ln(1 - tau) / 2 is 0 at tau = 1 - exp(-2).
    needed = 1.0 - np.exp(-2.0)
    road_s = 0.5
    found = slowed_duration_s(rate, bend, np.ones(1001), 1e-3, ACCELERATION, road_s)
    assert 1.0 < found < needed / road_s
    assert slowed_duration_s(rate, bend, np.ones(1001), 1e-3, ACCELERATION, needed + 1e-3) == pytest.approx(1.0)


def test_nothing_that_moves_takes_for_ever():
    assert slowed_duration_s(*constant_speed(1.0)[:2], np.zeros(1001), 1e-3, ACCELERATION, 0.1) == np.inf


def test_a_spline_found_with_stops_in_mind_is_executed_sooner():
    """Case 1 with joints fast for their acceleration; both searches may judge as many splines."""
    slow = joint(speed=4.0, acceleration=4.0)
    scene = replace(table1_scene(1), joints=(slow, slow))
    limits = Limits.of_joints(scene.joints)
    task = scene_task(scene, scene.margin_cm + 0.015, limits)

    def found(road_s):
        now = count()
        aware_of = replace(task, road_s=road_s)
        spline = find_fastest(aware_of, [], Budget(1e9, 12_000), 1, lambda: float(next(now)), lambda _share, _s: None)
        return fastest_motion(spline, limits)

    def executed_s(motion):
        return schedule(scene, lambda limit: fastest_motion(motion.path, limits, limit))[0].duration_s

    blind = found(np.inf)
    road_s = road_ticks(encode(scene, blind)[1]) / 16e6
    assert LINK_MARGIN_TICKS / 16e6 < road_s < blind.duration_s
    aware = found(road_s)
    assert aware.duration_s >= blind.duration_s * 0.98
    assert executed_s(aware) < 0.95 * executed_s(blind)
