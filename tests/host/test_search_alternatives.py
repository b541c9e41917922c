"""Distinct routes: all that there are, each through other gates, each free and timed."""

import json
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest

from host_scenes import make_scene, oracle_clearance_cm
from planarm.cli.main import main
from planarm.errors import NoPathError
from planarm.model.arm import Arm
from planarm.motions.margin import planning_margin_cm
from planarm.pipeline import plan_scene
from planarm.routes.alternatives import alternatives
from planarm.scene import JointSpaceSpec, Obstacle
from planarm.search.alternatives import crossed_gates, gates_of, ways
from planarm.search.joint_space import find_joint_route

ROOT = Path(__file__).resolve().parents[2]
DISCS = (
    Obstacle("circle", (0.0, 42.0), 8.0),
    Obstacle("square", (30.0, 34.0), 6.0),
    Obstacle("circle", (2.0, -40.0), 8.0),
)


def three_discs(**changes):
    return make_scene(DISCS, **{"elbow": "either", "start": (40.0, 12.0), "goal": (-35.0, 20.0), **changes})


@pytest.mark.parametrize("objective", ["time", "joint_travel", "tip_length"])
def test_the_ways_are_all_that_closing_gates_by_hand_leaves(objective):
    """Between start and goal lie obstacles 1 and 2: with one gate of each closed there is one way or none."""
    scene = three_discs()
    spec = JointSpaceSpec(np.radians(3.0), objective)
    found = {way.passed: way.route.cost for way in ways(scene, 0.4, spec)}
    by_hand = {}
    for sides in product(("up", "down"), repeat=2):
        kept = dict(zip((1, 2), sides, strict=True))
        closed = [gate.line for gate in gates_of(scene) if kept.get(gate.of) not in (None, gate.side)]
        route = find_joint_route(scene, 0.4, spec, closed).route
        if route is not None:
            by_hand[tuple(sorted(kept.items()))] = route.cost
    assert set(by_hand) == set(found)
    assert list(found.values()) == sorted(found.values())
    assert len(found) == 4
    for passed, cost in by_hand.items():
        assert found[passed] == pytest.approx(cost, rel=0.02), (
            "the same lattice, pulled from another way through the gates"
        )


def test_every_way_crosses_what_it_says_and_is_free_by_an_independent_geometry():
    scene = three_discs()
    arm, gates = Arm.from_spec(scene.arm), gates_of(scene)
    for way in ways(scene, 0.4, JointSpaceSpec()):
        crossed = crossed_gates(way.route.poses_rad, gates)
        assert sorted((gates[k].of, gates[k].side) for k in crossed) == list(way.passed)
        for a, b in pairwise(way.route.poses_rad):
            for share in np.linspace(0.0, 1.0, 40):
                assert oracle_clearance_cm(scene, arm, a + share * (b - a)) > 0.4


def test_to_and_fro_through_a_gate_is_not_to_pass():
    gates = gates_of(three_discs())
    up = np.array([[1.0, -0.5], [2.0, -0.5], [1.0, -0.4]])
    assert crossed_gates(up, gates) == frozenset()
    assert {(gates[k].of, gates[k].side) for k in crossed_gates(up[:2], gates)} == {(1, "up")}


def test_with_one_elbow_side_all_the_way_there_is_one_route_and_it_is_the_plan():
    scene = three_discs(elbow="up")
    (only,) = [one for one in alternatives(scene, planning_margin_cm(scene), 5) if one.elbow_changes == 0]
    plan = plan_scene(scene, lambda _stage, _share: None)
    assert only.path.length_cm == pytest.approx(plan.path.length_cm)
    assert only.motion_s <= plan.trajectory.duration_s + 1e-9  # the plan may be slowed where a stop lacks road
    assert (only.elbow, only.elbow_changes) == (("up", "up"), 0)


def test_clearance_is_what_the_motion_keeps():
    scene = three_discs(elbow="up")
    (only,) = alternatives(scene, planning_margin_cm(scene), 1)
    plan = plan_scene(scene, lambda _stage, _share: None)
    poses = plan.trajectory.sample(np.linspace(0.0, plan.trajectory.duration_s, 300))[0]
    arm = Arm.from_spec(scene.arm)
    least = min(oracle_clearance_cm(scene, arm, q) for q in poses) - 0.5 * scene.arm.link_width_cm
    assert only.clearance_cm == pytest.approx(least, abs=0.01)
    assert only.clearance_cm > 0.0


def test_at_most_so_many_are_told_and_a_closed_scene_says_why():
    scene = three_discs()
    assert len(alternatives(scene, 0.45, 2)) == 2
    wall = Obstacle("polygon", vertices_cm=((-1.0, 5.0), (1.0, 5.0), (1.0, 60.0), (-1.0, 60.0)))
    below = replace(wall, vertices_cm=tuple((x, -y) for x, y in wall.vertices_cm))
    with pytest.raises(NoPathError) as told:
        alternatives(replace(scene, obstacles=(wall, below)), 0.45, 2)
    assert told.value.advice


def test_the_command_prints_routes_as_a_table_and_as_json(capsys, tmp_path):
    scene = ROOT / "examples" / "elbow_change.toml"
    with pytest.raises(SystemExit) as left:
        main(["plan", str(scene), "--alternatives", "4", "--json"])
    assert left.value.code == 0
    routes = json.loads(capsys.readouterr().out)["routes"]
    assert routes
    for route in routes:
        assert {"elbow", "passes", "elbow_changes", "length_cm", "motion_s", "clearance_cm", "problem"} == set(route)
        assert route["elbow"] == ["up", "down"] and route["elbow_changes"] >= 1
    with pytest.raises(SystemExit) as left:
        main(["plan", str(scene), "--alternatives", "4"])
    shown = capsys.readouterr().out
    assert left.value.code == 0 and "up to down" in shown
    with pytest.raises(SystemExit) as left:
        main(["plan", str(scene)])
    assert left.value.code == 2
    assert "--alternatives" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "links"), [("four_links", 4), ("energy_two_links", 2)])
def test_scenes_on_a_roadmap_are_refused_in_words(name, links, capsys):
    with pytest.raises(SystemExit) as left:
        main(["plan", str(ROOT / "examples" / f"{name}.toml"), "--alternatives", "2"])
    assert left.value.code == 2
    told = capsys.readouterr().err
    assert f"{name}.toml has {links} links and planner.algorithm = 'mpd_star_lite'" in told
    assert "two-link arms" in told and "leave the option out" in told
