"""The search in joint space: exact on its lattice, free all along, and with the elbow on either side."""

import json
from dataclasses import replace
from itertools import pairwise
from math import hypot, inf, pi, radians
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from host_scenes import make_scene, oracle_clearance_cm, random_obstacles
from planarm.cli.main import main
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.pipeline import plan_scene
from planarm.scene import JointSpaceSpec, Obstacle, load_scene
from planarm.search.joint_lattice import JOIN_CELLS, TIE_S_PER_RAD
from planarm.search.joint_space import find_joint_route, tip_points_cm
from planarm.search.result import SearchStatus
from planarm.search.stencils import primitive, stencil
from planarm.workspace.joint_proof import joint_world, prove_joint_line
from planarm.workspace.proof import PROVED

ROOT = Path(__file__).resolve().parents[2]
OBJECTIVES = ("time", "joint_travel", "tip_length")


def random_scene(rng, count=5):
    points = [
        tuple(map(float, rng.uniform(15, 48) * np.array([np.cos(a), np.sin(a)]))) for a in rng.uniform(0, 2 * pi, 2)
    ]
    scene = make_scene(random_obstacles(rng, count), elbow="either", start=points[0], goal=points[1], width=1.0)
    limits = ((radians(-170), radians(170)), (radians(-150), radians(140)))
    return replace(scene, arm=replace(scene.arm, joint_limits_rad=limits))


def cost_by_hand(scene, spec, a, b):
    """Of one straight move; the tip's way by 2,000 chords."""
    turn = abs(b - a)
    change = spec.elbow_change_cost * ((a[1] < 0) != (b[1] < 0))
    if spec.objective == "joint_travel":
        return hypot(*turn) + change
    if spec.objective == "time":
        seconds = max(t / joint.max_speed_rad_s for t, joint in zip(turn, scene.joints, strict=True))
        return seconds + TIE_S_PER_RAD * hypot(*turn) + change
    tips = forward(Arm.from_spec(scene.arm), a + np.linspace(0, 1, 2001)[:, None] * (b - a))[:, -1]
    return float(np.hypot(*np.diff(tips, axis=0).T).sum()) + change


def graph_by_hand(scene, spec):
    """Nodes, given poses, and the cheapest cost between any start and any goal, by proofs of all moves and scipy."""
    world, (low, high) = joint_world(scene), np.array(scene.arm.joint_limits_rad).T
    cells = [
        np.arange(np.ceil(lo / spec.cell_rad), np.floor(hi / spec.cell_rad) + 1)
        for lo, hi in zip(low, high, strict=True)
    ]
    index = {(int(i), int(j)): k for k, (i, j) in enumerate((i, j) for j in cells[1] for i in cells[0])}
    poses = [np.array(place) * spec.cell_rad for place in index]
    arm = Arm.from_spec(scene.arm)
    given = {}
    for name, point in (("start", scene.task.start_cm), ("goal", scene.task.goal_cm)):
        for side in ("up", "down"):
            q = inverse_2r(arm, point, side)
            if np.isfinite(q).all() and (low <= q).all() and (q <= high).all():
                given[name, side] = len(poses)
                poses.append(q)
    edges = {}
    moves = [tuple(map(int, move)) for move in primitive(stencil("chs", 28))]
    for (i, j), k in index.items():
        for di, dj in moves:
            if (i + di, j + dj) in index:
                edges[k, index[i + di, j + dj]] = None
    for k in given.values():
        nearest = np.round(poses[k] / spec.cell_rad)
        for (i, j), m in index.items():
            if max(abs(i - nearest[0]), abs(j - nearest[1])) <= JOIN_CELLS:
                edges[k, m] = None
            if (abs(poses[m] - poses[k]) <= (JOIN_CELLS + 0.5) * spec.cell_rad).all():
                edges[m, k] = None
    starts = [k for (name, _), k in given.items() if name == "start"]
    goals = [k for (name, _), k in given.items() if name == "goal"]
    near = (JOIN_CELLS + 0.5) * spec.cell_rad
    edges.update({(s, g): None for s in starts for g in goals if (abs(poses[s] - poses[g]) <= near).all()})
    free = [(a, b) for a, b in edges if prove_joint_line(world, poses[a], poses[b])[0] == PROVED]
    costs = [cost_by_hand(scene, spec, poses[a], poses[b]) for a, b in free]
    if not starts or not goals:
        return inf
    rows, columns = zip(*free, strict=True) if free else ((), ())
    graph = coo_array((costs, (rows, columns)), (len(poses), len(poses))).tocsr()
    return float(np.min(dijkstra(graph, indices=starts)[:, goals]))


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_the_search_is_exact_on_its_lattice_and_pulling_never_costs_more(objective, sized, monkeypatch):
    """Against Dijkstra over all proved moves; the tip's way is measured by 8 chords a move here, by 2,000 there."""
    rng = np.random.default_rng(5)
    spec = JointSpaceSpec(radians(15.0), objective, elbow_change_cost=0.3)
    found = 0
    for number in range(sized(3, 40)):
        scene = random_scene(rng)
        exact = graph_by_hand(scene, spec)
        pulled = find_joint_route(scene, scene.margin_cm, spec).route
        with monkeypatch.context() as patch:
            patch.setattr("planarm.search.joint_space.pull", lambda _w, _c, poses, _s: np.arange(len(poses)))
            route = find_joint_route(scene, scene.margin_cm, spec).route
        assert (route is None) == (exact == inf), number
        if route is not None:
            found += 1
            assert route.cost == pytest.approx(exact, rel=1e-3 if objective == "tip_length" else 1e-9), number
            assert pulled.cost <= route.cost + 1e-12, number
            assert pulled.cost >= pulled.bound - 1e-9, number
    assert found


def test_every_pose_on_the_way_is_free_by_an_independent_geometry_and_within_the_limits(sized):
    rng = np.random.default_rng(8)
    looked = changes = 0
    for number in range(sized(30, 400)):
        scene = random_scene(rng, 7)
        spec = JointSpaceSpec(radians(5.0), OBJECTIVES[number % 3])
        route = find_joint_route(scene, scene.margin_cm, spec).route
        if route is None:
            continue
        looked += 1
        changes += len(route.changes_cm)
        arm = Arm.from_spec(scene.arm)
        ends = forward(arm, route.poses_rad[[0, -1]])[:, -1]
        assert ends == pytest.approx(np.array([scene.task.start_cm, scene.task.goal_cm]), abs=1e-9)
        for a, b in pairwise(route.poses_rad):
            for share in np.linspace(0.0, 1.0, 25):
                q = a + share * (b - a)
                assert oracle_clearance_cm(scene, arm, q) > scene.margin_cm, number
                for angle, (low, high) in zip(q, scene.arm.joint_limits_rad, strict=True):
                    assert low - 1e-9 <= angle <= high + 1e-9
    assert looked > 5
    assert changes > 0


def test_a_straight_way_in_the_open_is_one_move_at_its_lower_bound():
    scene = make_scene(elbow="either", start=(40.0, 10.0), goal=(20.0, 35.0))
    for objective in ("time", "joint_travel"):
        route = find_joint_route(
            scene, 0.4, JointSpaceSpec(objective=objective, start_elbow="up", goal_elbow="up")
        ).route
        assert len(route.poses_rad) == 2
        assert route.cost == pytest.approx(route.bound)


def test_what_is_told_of_a_route_is_what_its_poses_say():
    scene = make_scene((Obstacle("circle", (33.0, 22.0), 4.0),), elbow="either", start=(40.0, 5.0), goal=(20.0, 35.0))
    route = find_joint_route(scene, scene.margin_cm, JointSpaceSpec(objective="tip_length")).route
    assert len(route.poses_rad) > 2
    turns = abs(np.diff(route.poses_rad, axis=0))
    assert route.joint_travel_rad == pytest.approx(sum(hypot(*turn) for turn in turns))
    assert route.time_s == pytest.approx(sum(max(turn) / 2.0 for turn in turns))
    spec = JointSpaceSpec(objective="tip_length")
    by_hand = sum(cost_by_hand(scene, spec, a, b) for a, b in pairwise(route.poses_rad))
    assert route.tip_length_cm == pytest.approx(by_hand, rel=1e-4)
    assert np.hypot(*np.diff(tip_points_cm(scene, route.poses_rad), axis=0).T).max() <= 0.25 + 1e-9


def elbow_change():
    return load_scene(ROOT / "examples" / "elbow_change.toml")


def test_the_elbow_changes_where_it_has_to_through_the_straight_pose():
    scene = elbow_change()
    route = find_joint_route(scene, 1.015).route
    assert route.sides == ("up", "down")
    (straight,) = route.changes_cm
    assert hypot(*straight) == pytest.approx(50.0)


def test_a_dear_change_is_left_out_where_another_way_exists():
    """The goal can be held either way; straight on with a change is shorter, without one costs no extra."""
    wall = Obstacle("circle", (15.0, 22.0), 8.0)
    scene = make_scene((wall,), elbow="either", start=(48.0, -6.0), goal=(48.0, 8.0))
    free = JointSpaceSpec(start_elbow="up", goal_elbow="either", objective="joint_travel")
    routes = [find_joint_route(scene, 0.4, replace(free, elbow_change_cost=cost)).route for cost in (0.0, 100.0)]
    assert len(routes[0].changes_cm) >= len(routes[1].changes_cm) == 0
    forced = find_joint_route(scene, 0.4, replace(free, goal_elbow="down", elbow_change_cost=100.0)).route
    assert len(forced.changes_cm) == 1
    assert forced.cost > 100.0


def test_limits_cut_the_way_and_turns_are_told_apart():
    """Straight down is both ends of a full turn of joint 1: the way from one end to the other goes all round."""
    scene = make_scene(elbow="down", start=(3.0, -40.0), goal=(-3.0, -40.0))
    q = [inverse_2r(Arm.from_spec(scene.arm), point, "down")[0] for point in (scene.task.start_cm, scene.task.goal_cm)]
    route = find_joint_route(scene, 0.4, JointSpaceSpec(start_elbow="down", goal_elbow="down")).route
    if abs(q[0] - q[1]) > pi:
        assert route.joint_travel_rad > pi
    assert abs(route.poses_rad[-1][0] - route.poses_rad[0][0]) == pytest.approx(abs(q[1] - q[0]))


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"start": (70.0, 0.0)}, SearchStatus.START_BLOCKED),
        ({"goal": (30.0, 15.0)}, SearchStatus.GOAL_BLOCKED),
        ({"limits": ((radians(-90), radians(20)), (radians(-150), radians(150)))}, SearchStatus.GOAL_BLOCKED),
    ],
)
def test_no_way_is_an_answer(changes, status):
    scene = make_scene((Obstacle("circle", (30.0, 15.0), 8.0),), **changes)
    result = find_joint_route(scene, 0.4)
    assert (result.status, result.route) == (status, None)
    assert result.reason


def test_a_ring_of_obstacles_leaves_no_way_and_the_reason_tells_how_far_it_came():
    ring = tuple(Obstacle("circle", (45 * np.cos(a), 45 * np.sin(a)), 10.0) for a in np.arange(0, 2 * pi, pi / 12))
    scene = make_scene(ring, start=(30.0, 0.0), goal=(-49.9, 0.0), width=0.4)
    result = find_joint_route(scene, 0.2)
    assert result.status in (SearchStatus.NO_PATH, SearchStatus.GOAL_BLOCKED)
    assert result.route is None


def test_a_plan_through_full_stretch_is_certified_and_passes_it_at_speed():
    plan = plan_scene(elbow_change(), lambda _stage, _share: None)
    assert plan.certificate.ok, plan.certificate.explain()
    t_s = np.linspace(0.0, plan.trajectory.duration_s, 5000)
    q, dq, _ = plan.trajectory.sample(t_s)
    crossing = int(np.argmax(q[:, 1] > 0.0))
    assert q[crossing - 1, 1] <= 0.0 < q[crossing, 1]
    assert abs(dq[crossing, 1]) > 0.5
    assert forward(Arm.from_spec(plan.scene.arm), q[-1])[-1] == pytest.approx(plan.scene.task.goal_cm, abs=1e-6)


def test_the_command_plans_in_the_space_that_it_is_told(capsys, tmp_path):
    scene, target = ROOT / "examples" / "elbow_change.toml", tmp_path / "x.plan"
    with pytest.raises(SystemExit) as left:
        main(["plan", str(scene), "-o", str(target), "--space", "tip", "--json"])
    error = json.loads(capsys.readouterr().out)["error"]
    assert left.value.code == error["exit_code"] == 2
    assert any("--space joint" in sentence for sentence in error["advice"])
    with pytest.raises(SystemExit) as left:
        main(["plan", str(scene), "-o", str(target), "--json"])
    assert left.value.code == 0
    assert json.loads(capsys.readouterr().out)["motion_s"] > 1.0
