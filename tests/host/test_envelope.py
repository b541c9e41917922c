"""The envelope: maps against poses that are really taken, the lattice's best pose, bisections with a known answer."""

from dataclasses import replace
from math import hypot, radians

import numpy as np
import pytest

from host_scenes import make_scene
from planarm.envelope.largest import bisect, largest_feed, largest_payload_kg
from planarm.envelope.maps import envelope_maps
from planarm.envelope.snap import snap
from planarm.errors import SceneError, TimingError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.model.transmission import Transmission
from planarm.stepping.certificate import Certificate, at_most

SCENE = make_scene(cell=5.0)
BELT = replace(SCENE, coupling=((1.0, 0.0), (1.0, 1.0)))


def with_play(scene, *degrees):
    return replace(scene, mechanics=replace(scene.mechanics, backlash_rad=tuple(radians(d) for d in degrees)))


@pytest.mark.parametrize("scene", [SCENE, BELT, with_play(SCENE, 0.2, 0.4)])
def test_tip_errors_bound_those_of_random_poses_and_come_close(scene):
    maps = envelope_maps(scene, "up")
    arm, transmission = Arm.from_spec(scene.arm), Transmission.of(scene)
    rng = np.random.default_rng(1)
    row, column = next(zip(*np.nonzero(np.isfinite(maps.hz_per_cm_s)), strict=True))
    tip = np.array([maps.x_cm[column], maps.y_cm[row]])
    q = inverse_2r(arm, tip, "up")
    corners = rng.choice([-0.5, 0.5], (4000, 2)) @ transmission.rad_per_ustep.T
    corners += rng.choice([-0.5, 0.5], (4000, 2)) * np.array(scene.mechanics.backlash_rad)
    worst_mm = 10.0 * np.linalg.norm(forward(arm, q + corners)[:, -1] - tip, axis=1).max()
    assert 0.7 * maps.tip_error_mm[row, column] <= worst_mm <= 1.01 * maps.tip_error_mm[row, column]


def test_step_rates_are_those_of_a_tip_that_moves():
    """The busiest motor over all directions of 1 cm/s, by differences of the exact poses."""
    maps = envelope_maps(BELT, "up")
    arm, transmission = Arm.from_spec(BELT.arm), Transmission.of(BELT)
    row, column = (int(i) for i in np.argwhere(np.isfinite(maps.hz_per_cm_s))[40])
    tip = np.array([maps.x_cm[column], maps.y_cm[row]])
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    way = 1e-5 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    moved = transmission.usteps(inverse_2r(arm, tip + way, "up")) - transmission.usteps(
        inverse_2r(arm, tip - way, "up")
    )
    assert maps.hz_per_cm_s[row, column] == pytest.approx(np.abs(moved / 2e-5).max(), rel=1e-3)


def test_speed_falls_to_nothing_towards_the_straight_pose_and_stops_there():
    scene = make_scene(cell=1.0, x=(30.0, 50.0), y=(0.0, 1.0))
    maps = envelope_maps(scene, "up")
    along = maps.largest_cm_s[0]
    assert (np.diff(along[np.isfinite(along)]) < 0.0).all()
    assert along[-2] < 0.3 * along[0]
    assert np.isnan(along[-1])
    assert maps.manipulability_cm2[0, -1] == pytest.approx(0.0, abs=1e-4)


def test_nothing_is_told_of_places_out_of_reach_or_limits():
    limited = make_scene(cell=5.0, limits=((0.0, radians(90)), (-np.pi, np.pi)))
    maps = envelope_maps(limited, "up")
    grid = np.hypot(*np.meshgrid(maps.x_cm, maps.y_cm))
    assert np.isnan(maps.tip_error_mm[(grid > 50.0) | (grid < 10.0)]).all()
    assert np.isfinite(maps.tip_error_mm).sum() < np.isfinite(envelope_maps(SCENE, "up").tip_error_mm).sum()


@pytest.mark.parametrize("scene", [SCENE, BELT, with_play(SCENE, 0.0, 0.0)])
def test_the_snapped_pose_is_the_best_of_a_wide_lattice(scene):
    arm, transmission = Arm.from_spec(scene.arm), Transmission.of(scene)
    rng = np.random.default_rng(2)
    for _ in range(20):
        r, angle = rng.uniform(12.0, 49.0), rng.uniform(-1.0, 3.0)
        point = (float(r * np.cos(angle)), float(r * np.sin(angle)))
        found = snap(scene, point, "up")
        around = np.round(transmission.usteps(inverse_2r(arm, point, "up")))
        lattice = np.stack(np.meshgrid(*[np.arange(-9, 10)] * 2), axis=-1).reshape(-1, 2) + around
        best = np.hypot(*(forward(arm, transmission.q_rad(lattice))[:, -1] - point).T).min()
        assert found.error_mm == pytest.approx(10.0 * best, rel=1e-6)
        assert found.error_mm <= found.rounded_error_mm
        assert 10.0 * hypot(found.tip_cm[0] - point[0], found.tip_cm[1] - point[1]) == pytest.approx(found.error_mm)


def test_a_point_out_of_reach_is_told():
    with pytest.raises(SceneError, match="out of reach"):
        snap(SCENE, (60.0, 0.0), "up")


def certificate(value, limit):
    return Certificate((at_most("load", value, limit, "kg", setting="less"),))


def test_bisection_ends_at_the_limit():
    found = largest_payload_kg(SCENE, lambda scene: certificate(scene.mechanics.end_masses_kg[-1], 0.73), steps=10)
    assert found.value <= 0.73 < found.fails_at
    assert found.fails_at - found.value < 1e-3
    assert "load" in found.because


def test_a_feed_that_cannot_be_timed_ends_the_search():
    def certify(scene):
        if scene.joints[0].max_speed_rad_s > 5.0:
            raise TimingError("joint 1 is too fast")
        return certificate(0.0, 1.0)

    found = largest_feed(SCENE, certify, steps=8)
    assert found.value == pytest.approx(2.5, abs=0.02)  # of 2 rad/s
    assert found.because == "joint 1 is too fast"


def test_what_fails_at_once_is_searched_below_and_what_never_fails_is_open():
    assert bisect(lambda value: value, lambda value: certificate(value, 0.01), 1.0, 10).value == pytest.approx(
        0.01, rel=0.2
    )
    assert bisect(lambda value: value, lambda value: certificate(value, 1e9), 1.0, 10).fails_at == float("inf")
