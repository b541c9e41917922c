"""The scene's physical data: defaults, units, and errors of `[joints.motor]`, `[mechanics]` and `[transmission]`."""

from math import pi, sqrt

import pytest

from host_scenes import least_scene
from planarm.errors import SceneError
from planarm.scene import MotorSpec, parse_scene


def scene_with(first="", second="", rest=""):
    return parse_scene(least_scene(first, second) + rest, "arm.toml")


def test_a_scene_without_physical_data_is_an_aluminium_arm_on_a_table_with_common_motors():
    scene = scene_with()
    assert scene.joints[0].motor == scene.joints[1].motor == MotorSpec()
    mechanics = scene.mechanics
    assert mechanics.gravity is False
    assert mechanics.link_masses_kg == pytest.approx((0.12, 0.08))
    assert mechanics.link_inertias_kg_m2 == pytest.approx((0.12 * 0.09 / 12, 0.08 * 0.04 / 12))
    assert mechanics.end_masses_kg == (0.0, 0.0)
    assert scene.coupling == ((1.0, 0.0), (0.0, 1.0))
    assert scene.joints[0].reversed is False


def test_units_become_si():
    motor = scene_with("[joints.motor]\ninductance_mh = 3.2\nrotor_inertia_g_cm2 = 68").joints[0].motor
    assert motor.inductance_h == pytest.approx(3.2e-3)
    assert motor.rotor_inertia_kg_m2 == pytest.approx(68 * 1e-3 * 1e-4)
    scene = scene_with("zero_offset_deg = 90\nreversed = true", rest="[mechanics]\nbacklash_deg = [0.5, 0]")
    assert scene.joints[0].zero_offset_rad == pytest.approx(pi / 2)
    assert scene.joints[0].reversed is True
    assert scene.mechanics.backlash_rad == pytest.approx((pi / 360, 0.0))


def test_the_peak_torque_is_the_holding_torque_at_rated_current_in_both_phases():
    """Both phases at the rated current make a vector of sqrt(2) times it, and so do micro-steps of that peak."""
    assert MotorSpec(current_a=1.7 * sqrt(2)).peak_torque_nm == pytest.approx(0.40)


@pytest.mark.parametrize(
    ("first", "rest", "key", "words"),
    [
        ("[joints.motor]\ninductance_h = 0.003", "", "joints[1].motor.inductance_h", "wrong unit: 'inductance_mh'"),
        ("[joints.motor]\nsupply_v = 1", "", "joints[1].motor.supply_v", "raise it above 1.8 V, or lower current_a"),
        ("motor = 3", "", "joints[1].motor", "a table expected"),
        ("", "[mechanics]\nlink_masses_kg = [1]", "mechanics.link_masses_kg", "2 numbers, one for each link"),
        ("", "[mechanics]\nlink_masses_g = [1, 2]", "mechanics.link_masses_g", "'link_masses_kg' expected"),
        ("", "[mechanics]\nend_masses_kg = [0, -1]", "mechanics.end_masses_kg", "at least 0"),
        ("", "[transmission]\ncoupling = [[1, 0]]", "transmission.coupling", "2 rows of 2 numbers"),
        ("", "[transmission]\ncoupling = [[1, 0], [1, true]]", "transmission.coupling", "true given"),
        ("", "[transmission]\ncoupling = [[1, 1], [2, 2]]", "transmission.coupling", "has no inverse"),
    ],
)
def test_what_is_wrong_is_named(first, rest, key, words):
    with pytest.raises(SceneError) as caught:
        scene_with(first, rest=rest)
    assert caught.value.key == key
    assert words in str(caught.value)
