"""[moving] and [obstacles.motion]: what they mean, and what is refused."""

from math import hypot

import pytest

from planarm.errors import SceneError
from planarm.scene import parse_scene

SCENE = """
[arm]
link_lengths_cm = [50, 50]
link_width_cm = 1
elbow = "up"
[workspace]
x_cm = [-100, 100]
y_cm = [-100, 100]
[moving]
sample_s = 0.4
samples = 100
[[obstacles]]
shape = "circle"
center_cm = [10, 60]
diameter_cm = 10
motion = {motion}
[task]
start_cm = [70, 20]
goal_cm = [-70, 20]
[[joints]]
max_speed_deg_s = 100
max_acceleration_deg_s2 = 500
[[joints]]
max_speed_deg_s = 100
max_acceleration_deg_s2 = 500
"""


def motion_of(text):
    return parse_scene(SCENE.replace("{motion}", text), "test").obstacles[0].motion


def test_a_straight_motion_has_the_papers_speed():
    motion = motion_of("{ path = 'straight', by_cm = [30, -40], motion_samples = 25 }")
    # paper B, section 5: v_x = dx / (MS Ts), v_y alike; 30 / (25 * 0.4) = 3 and -4 cm/s
    assert motion.times_s == (0.0, 10.0)
    assert motion.fastest_cm_s == pytest.approx(hypot(3.0, 4.0))
    assert not motion.repeat


def test_a_straight_motion_that_repeats_goes_back_the_same_way():
    motion = motion_of("{ path = 'straight', by_cm = [6, 0], motion_samples = 5, repeat = true }")
    assert motion.offsets_cm == ((0.0, 0.0), (6.0, 0.0), (0.0, 0.0))
    assert motion.times_s == (0.0, 2.0, 4.0)


@pytest.mark.parametrize(("turn", "third"), [("left", (-8.0, 8.0)), ("right", (8.0, 8.0))])
def test_a_square_motion_turns_as_told_and_closes(turn, third):
    motion = motion_of(f"{{ path = 'square', side_cm = 8, heading_deg = 90, turn = '{turn}', motion_samples = 10 }}")
    assert motion.repeat
    assert motion.times_s == pytest.approx((0.0, 4.0, 8.0, 12.0, 16.0))
    assert motion.offsets_cm[1] == pytest.approx((0.0, 8.0))
    assert motion.offsets_cm[2] == pytest.approx(third)
    assert motion.offsets_cm[4] == (0.0, 0.0)


def test_waypoints_at_samples_and_at_times_are_the_same():
    by_samples = motion_of("{ path = 'waypoints', offsets_cm = [[4, 0], [4, 9]], at_samples = [5, 10] }")
    by_times = motion_of("{ path = 'waypoints', offsets_cm = [[4, 0], [4, 9]], times_s = [2, 4] }")
    assert by_samples == by_times
    assert by_times.times_s == (0.0, 2.0, 4.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{ path = 'circle' }", "obstacles[1].motion.path: 'circle' given, one of 'straight', 'square', 'waypoints'"),
        ("{ path = 'straight', by_cm = [1, 1], motion_samples = 5, side_cm = 2 }", "motion.side_cm: unknown key"),
        ("{ path = 'straight', by_cm = [1, 1] }", "motion.motion_samples: missing"),
        ("{ path = 'waypoints', offsets_cm = [[1, 1]], times_s = [0] }", "the first is at time 0 and must be [0, 0]"),
        ("{ path = 'waypoints', offsets_cm = [[1, 1], [2, 2]], times_s = [3, 3] }", "are not ascending"),
        ("{ path = 'waypoints', offsets_cm = [[1, 1], [2, 2]], times_s = [3] }", "1 given, one for each of the 2"),
        ("{ path = 'waypoints', offsets_cm = [[1, 1]], times_s = [3], repeat = true }", "must be [0, 0] again"),
        ("{ path = 'waypoints', offsets_cm = [[1, 1]], times_s = [3], at_samples = [3] }", "is given beside times_s"),
        ("{ path = 'straight', by_mm = [1, 1], motion_samples = 5 }", "wrong unit: 'by_cm' expected"),
    ],
)
def test_what_is_no_motion_is_refused_by_name(text, words):
    with pytest.raises(SceneError) as caught:
        motion_of(text)
    assert words in str(caught.value)


def test_a_motion_needs_the_table_moving():
    text = SCENE.replace("{motion}", "{ path = 'straight', by_cm = [1, 1], motion_samples = 5 }")
    with pytest.raises(SceneError, match=r"obstacles\[1\]\.motion: needs a table \[moving\]"):
        parse_scene(text.replace("[moving]\nsample_s = 0.4\nsamples = 100\n", ""), "test")


def test_without_motion_an_obstacle_rests():
    assert parse_scene(SCENE.replace("motion = {motion}\n", ""), "test").obstacles[0].motion is None


def test_a_roadmap_knows_no_moving_obstacles():
    text = SCENE.replace("motion = {motion}\n", "") + "[planner]\nalgorithm = 'mpd_star_lite'\n"
    with pytest.raises(SceneError, match="moving: a roadmap is planned among obstacles at rest"):
        parse_scene(text, "test")


def test_the_table_moving_is_read_with_its_defaults():
    moving = parse_scene(SCENE.replace("motion = {motion}\n", ""), "test").moving
    assert moving is not None
    assert (moving.sample_s, moving.samples, moving.horizon_s) == (0.4, 100, pytest.approx(40.0))
    assert (moving.delay_margin_s, moving.smoothing, moving.via_points) == (0.02, "none", 5)
