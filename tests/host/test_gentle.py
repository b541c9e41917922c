"""A motion with a limit of jerk through the paper's first case: kept, free, and told where it cannot be."""

from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest

from planarm.errors import SceneError, TimingError
from planarm.motions.margin import planning_margin_cm
from planarm.routes.gentle import ROOM_CM, gentle_motion, jerk_limits
from planarm.routes.route import find_route
from planarm.scene import load_scene, parse_scene
from planarm.trajectory.check import limit_use
from planarm.trajectory.jerk import largest_jerks
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.warm_up import SMALL_SCENE
from planarm.workspace.world import build_world, clearances_cm

CASE_1 = load_scene(Path(__file__).resolve().parents[2] / "examples" / "table1_case1.toml")


def with_jerk(scene, *jerks):
    return replace(
        scene, joints=tuple(replace(j, max_jerk_rad_s3=one) for j, one in zip(scene.joints, jerks, strict=True))
    )


def made_of(scene):
    margin_cm = planning_margin_cm(scene)
    limits = Limits.of(scene)
    fastest = fastest_motion(find_route(scene, margin_cm).smooth, limits)
    return fastest, gentle_motion(scene, margin_cm - ROOM_CM, fastest, limits, jerk_limits(scene)).trajectory, limits


def test_jerk_limits_and_room_are_kept():
    scene = with_jerk(CASE_1, 150.0, 250.0)
    fastest, made, limits = made_of(scene)
    assert (largest_jerks(made)[0] <= [150.0, 250.0]).all()
    assert limit_use(made, limits).largest <= 1.0 + 1e-6
    assert fastest.duration_s < made.duration_s < 2.0 * fastest.duration_s
    poses = made.sample(np.linspace(0.0, made.duration_s, 20_000))[0]
    world = build_world(scene, planning_margin_cm(scene) - ROOM_CM, "up")
    assert clearances_cm(world, poses).min() > world.arm.margin_cm


def test_less_jerk_takes_longer():
    durations = [made_of(with_jerk(CASE_1, jerk, jerk))[1].duration_s for jerk in (400.0, 100.0, 25.0)]
    assert durations[0] < durations[1] < durations[2]


def test_what_cannot_be_kept_says_where():
    scene = with_jerk(CASE_1, 100.0, 100.0)
    margin_cm = planning_margin_cm(scene)
    limits = Limits.of(scene)
    fastest = fastest_motion(find_route(scene, margin_cm).smooth, limits)
    with pytest.raises(TimingError, match=r"not free at path .* tip .*max_jerk_deg_s3"):
        gentle_motion(scene, margin_cm + 0.5, fastest, limits, jerk_limits(scene))


def test_the_scene_s_key():
    assert jerk_limits(parse_scene(SMALL_SCENE, "a.toml")) is None
    text = SMALL_SCENE.replace("max_speed_deg_s = 200", "max_speed_deg_s = 200\nmax_jerk_deg_s3 = 9000", 1)
    limits = jerk_limits(parse_scene(text, "a.toml"))
    assert limits is not None
    assert limits.tolist() == [radians(9000.0), np.inf]
    with pytest.raises(SceneError, match="max_jerk_deg_s3"):
        parse_scene(text.replace("9000", "-1"), "a.toml")
