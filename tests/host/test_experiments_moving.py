"""The comparison with paper B: what it says of the published figures, and that it draws what it says."""

import json
from dataclasses import replace
from math import sqrt
from xml.etree import ElementTree

import numpy as np
import pytest

from planarm.experiments import moving as comparison
from planarm.experiments.moving import Moving, environment
from planarm.experiments.moving_folder import write_moving
from planarm.experiments.moving_published import PUBLISHED
from planarm.experiments.moving_random import compare_random
from planarm.experiments.moving_random import tables as random_tables
from planarm.experiments.moving_tables import as_json, as_markdown, findings
from planarm.experiments.scenes import example_file
from planarm.scene import load_scene


@pytest.fixture(scope="module")
def result():
    """Both environments, each timed once."""
    patch = pytest.MonkeyPatch()
    patch.setattr(comparison, "REPEATS", 1)
    try:
        scenes = [load_scene(example_file(f"moving_env{number}.toml")) for number in (1, 2)]
        yield Moving(tuple(environment(n, scene, 1) for n, scene in enumerate(scenes, start=1)), 1)
    finally:
        patch.undo()


def test_d_stars_paths_have_the_published_lengths(result):
    one, two = result.environments
    assert one.d_star_cm == pytest.approx(30 + 30 * sqrt(2))
    assert two.d_star_cm == pytest.approx(57 + 15 * sqrt(2))
    for env in result.environments:
        assert round(env.d_star_cm, 4) == PUBLISHED[env.number].d_star_cm
        assert len(env.scene.obstacles) == PUBLISHED[env.number].obstacles


def test_no_swarm_is_longer_than_d_stars_path_and_none_is_shorter_than_a_straight_line(result):
    for env in result.environments:
        straight = np.hypot(*np.subtract(env.scene.task.goal_cm, env.scene.task.start_cm))
        for swarm in env.swarms:
            assert straight - 1e-9 <= swarm.result.length_cm <= env.d_star_cm


def test_the_exact_plan_arrives_no_later_than_any_rule_and_touches_nothing(result):
    for env in result.environments:
        by_way = {column.way: column for column in env.columns}
        assert by_way["exact"].outcome == "found"
        assert not by_way["exact"].contact
        for rule in ("plain", "modified"):
            if not by_way[rule].contact and by_way[rule].outcome == "reached":
                assert by_way["exact"].path.arrival <= by_way[rule].path.arrival


def test_the_published_figures_are_as_printed_and_their_slip_is_told(result):
    first = PUBLISHED[1]
    assert first.d_star_cm - first.pso_cm == pytest.approx(2.7399, abs=1e-9)  # the text says 3.2846
    assert PUBLISHED[2].d_star_cm - PUBLISHED[2].pso_cm == pytest.approx(PUBLISHED[2].shorter_in_text_cm, abs=1e-9)
    assert any("3.2846" in sentence and "2.7399" in sentence for sentence in findings(result))


def test_the_folder_holds_tables_pictures_and_animations_in_real_time(result, tmp_path):
    files = write_moving(replace(result, environments=result.environments[:1]), tmp_path)
    assert all(path.stat().st_size > 500 for path in files)
    told = json.loads((tmp_path / "moving.json").read_text())
    assert told["environments"][0]["published"]["d_star_cm"] == 72.4264
    assert json.dumps(as_json(result))
    assert "| 1 | published | 3 | 72.4264 | 69.6865 | 2.7399 |" in as_markdown(result)
    svg = ElementTree.parse(tmp_path / "env1_animation.svg").getroot()
    space = {"s": "http://www.w3.org/2000/svg"}
    animations = svg.findall(".//s:animate", space) + svg.findall(".//s:animateTransform", space)
    moving = [o for o in result.environments[0].scene.obstacles if o.motion]
    assert len(animations) == len(moving) + 2  # each obstacle, the arm, and the bar of time
    arm = next(a for a in animations if a.get("attributeName") == "points")
    poses = [[tuple(map(float, p.split(","))) for p in pose.split()] for pose in arm.get("values").split(";")]
    assert poses[0][-1] == pytest.approx(result.environments[0].scene.task.start_cm, abs=0.01)
    assert poses[-1][-1] == pytest.approx(result.environments[0].scene.task.goal_cm, abs=0.01)
    env = result.environments[0]
    assert float(arm.get("dur").rstrip("s")) == pytest.approx(env.base.arrival * env.moving_map.clock.sample_s)


def test_on_random_scenes_no_executed_plan_touches_anything(sized):
    """Full size, 500 scenes: the counts are told in docs/moving.md."""
    result = compare_random(sized(25, 500))
    print(result)
    assert result.touched == ()
    assert result.executed == result.tallies[2].outcomes["found"] > 0
    plain, modified, exact = result.tallies
    assert plain.outcomes.get("contact", 0) + modified.outcomes.get("contact", 0) > 0
    assert "contact" not in exact.outcomes
    assert len(plain.late_samples) <= plain.outcomes["reached"]
    assert sum(plain.outcomes.values()) == sum(exact.outcomes.values()) == result.scenes
    assert str(result.executed) in random_tables(result)[0].rows[2][1]
