"""Search in space and time against plain Dijkstra on the time-expanded graph; D* against Dijkstra on each map."""

import heapq
from dataclasses import replace
from itertools import pairwise
from math import dist, inf, sqrt

import numpy as np
import pytest

from host_scenes import make_scene
from moving_scenes import QUARTER, SAMPLE_S, clearance_at, random_moving_scene, replace_moving
from planarm.experiments.moving_random import random_scene
from planarm.scene import MovingSpec, Obstacle, ObstacleMotion
from planarm.search.moving.bits import move_planes
from planarm.search.moving.dstar import run_plain
from planarm.search.moving.rules import first_contact, run_rule
from planarm.search.moving.space_time import MovingStatus, forward, hold_sample, search_space_time, world_of
from planarm.search.moving.timed_path import TimedPath
from planarm.workspace.cell_poses import DX, DY
from planarm.workspace.moving_map import build_moving_map, unpacked
from planarm.workspace.moving_proof import fill_move, prove_moving_piece
from planarm.workspace.proof import PROVED


def edges_from(moving, n, k):
    """Every edge out of a state that the proof shows free, judged one by one, without the map's planes."""
    poses, clock = moving.poses, moving.clock
    world, piece = world_of(moving), np.empty((4, 2))
    for d in range(9):
        if d < 8 and not (poses.moves[n] >> d) & 1:
            continue
        m = n if d == 8 else int(poses.place[poses.cell[n] + DY[d] * poses.columns + DX[d]])
        fill_move(poses.q_rad[n], poses.q_rad[m], clock.sample_s, piece)
        verdict, _, _ = prove_moving_piece(world, piece, k * clock.sample_s, clock.sample_s, clock.delay_s)
        if verdict == PROVED:
            yield m, 0.0 if d == 8 else 1.0 if d < 4 else sqrt(2.0)


def dijkstra(moving, start, goal):
    """Least (arrival, length) by plain Dijkstra over states (sample, node); (inf, inf) when there is none."""
    first, last = int(moving.poses.place[start]), int(moving.poses.place[goal])
    hold = hold_sample(moving, goal)
    best, heap = {(0, first): 0.0}, [(0, 0.0, first)]
    while heap:
        k, length, n = heapq.heappop(heap)
        if length > best[k, n]:
            continue
        if n == last and k >= hold >= 0:
            return k, length
        if k == moving.clock.samples:
            continue
        for m, cost in edges_from(moving, n, k):
            if length + cost < best.get((k + 1, m), inf):
                best[k + 1, m] = length + cost
                heapq.heappush(heap, (k + 1, length + cost, m))
    return inf, inf


def task_of(scene, moving):
    return moving.cell_at(scene.task.start_cm), moving.cell_at(scene.task.goal_cm)


def cases(wanted, first, /, **settings):
    """Random scenes whose start and goal are poses free at the beginning, with their maps."""
    seed, found = first, 0
    while found < wanted:
        scene = random_moving_scene(np.random.default_rng(seed), **settings)
        moving = build_moving_map(scene, "up")
        start, goal = task_of(scene, moving)
        nodes = moving.nodes(0).ravel()
        if start != goal and nodes[start] and nodes[goal]:
            found += 1
            yield seed, scene, moving, start, goal
        seed += 1


def test_the_exact_search_is_dijkstras_on_the_time_expanded_graph(sized):
    outcomes = []
    for seed, _scene, moving, start, goal in cases(sized(6, 60), 0, count=3, samples=26, cell=3.0, delay_s=0.1):
        arrival, length = dijkstra(moving, start, goal)
        result = search_space_time(moving, start, goal)
        outcomes.append(result.status)
        if result.path is None:
            assert arrival == inf, f"seed {seed}"
        else:
            assert result.path.arrival == arrival, f"seed {seed}"
            assert result.path.length_cm == pytest.approx(3.0 * length), f"seed {seed}"
    assert MovingStatus.FOUND in outcomes


def test_every_edge_of_a_path_keeps_clear_between_samples_and_for_the_delay(sized):
    looked = 0
    for seed, scene, moving, start, goal in cases(sized(4, 40), 100, count=5, samples=30, delay_s=0.2):
        result = search_space_time(moving, start, goal)
        if result.path is None:
            continue
        q = result.path.q_rad
        for k in range(result.path.arrival):
            for share in (0.13, 0.5, 0.81, 1.0):
                pose = q[k] + (q[k + 1] - q[k]) * (3 * share**2 - 2 * share**3)
                for late in (0.0, 0.1, 0.2):
                    assert clearance_at(scene, pose, (k + share) * SAMPLE_S + late) > scene.margin_cm, f"seed {seed}"
                    looked += 1
        for later in np.arange(result.path.arrival, scene.moving.samples, 0.7):
            assert clearance_at(scene, q[-1], later * SAMPLE_S) > scene.margin_cm, f"seed {seed}"
    assert looked > 0


def promised_arrival(moving, start, goal):
    """The arrival that the nodes alone promise: moves between free nodes, waits where the map has them proved."""
    reach = np.zeros(moving.free.shape, np.uint64)
    iy, ix = divmod(start, moving.poses.columns)
    reach[0, iy, ix // 64] = np.uint64(1) << np.uint64(ix % 64)
    at_goal = divmod(goal, moving.poses.columns)
    planes = moving.free, moving.stay, moving.room, move_planes(moving.poses)
    return forward(*planes, reach, *at_goal, max(0, hold_sample(moving, goal)), False)


@pytest.mark.parametrize("draw", [(1, 261), (1, 3)])
def test_every_path_is_made_of_proved_edges_also_where_the_nodes_promise_an_earlier_arrival(draw):
    """Of 500 random scenes the 261st is one in which the edges between nodes' promise and proof decide."""
    scene, side = random_scene(np.random.default_rng(draw))
    moving = build_moving_map(scene, side)
    start, goal = task_of(scene, moving)
    result = search_space_time(moving, start, goal)
    assert result.path is not None
    places = moving.poses.place[result.path.cells].tolist()
    for k, (a, b) in enumerate(pairwise(places)):
        assert b in dict(edges_from(moving, a, k)), f"sample {k}"
    assert (result.path.cells[0], result.path.cells[-1]) == (start, goal)
    if draw == (1, 261):
        assert promised_arrival(moving, start, goal) < result.path.arrival


def crossing_scene(width_cm, samples=16):
    """A wall that leaves no way round and a start that it drives over, or a goal that it ends on."""
    motion = ObstacleMotion((0.0, 8.0), ((0.0, 0.0), (0.0, width_cm)), False)
    wall = Obstacle("polygon", vertices_cm=((2.0, -40.0), (40.0, -40.0), (40.0, -30.0), (2.0, -30.0)), motion=motion)
    scene = make_scene(
        [wall], links=(15.0, 15.0), limits=QUARTER, x=(-32.0, 32.0), y=(-32.0, 32.0), cell=2.0,
        start=(26.0, 0.0), goal=(24.0, 12.0),
    )  # fmt: skip
    return replace_moving(scene, MovingSpec(SAMPLE_S, samples, 0.0))


def test_a_goal_that_an_obstacle_ends_on_is_told():
    scene = crossing_scene(42.0)
    moving = build_moving_map(scene, "up")
    start, goal = task_of(scene, moving)
    assert search_space_time(moving, start, goal).status is MovingStatus.GOAL_TAKEN
    assert search_space_time(moving, start, start).status is MovingStatus.GOAL_TAKEN


def test_an_arm_that_cannot_leave_is_trapped_at_a_told_sample():
    scene = crossing_scene(42.0)
    narrow = replace(scene, arm=replace(scene.arm, joint_limits_rad=((-0.8, 0.2), (-0.6, 0.0))))
    moving = build_moving_map(narrow, "up")
    nodes = np.flatnonzero(moving.nodes(0).ravel())
    start, goal = int(nodes[len(nodes) // 2]), int(nodes[-1])
    result = search_space_time(moving, start, goal)
    assert result.status is MovingStatus.IMPOSSIBLE
    reached = [{int(moving.poses.place[start])}]
    for k in range(result.trapped_at):
        reached.append({m for n in reached[-1] for m, _ in edges_from(moving, n, k)})
    assert not reached[-1]
    assert len(reached[1]) > 1  # at first it can run


def test_a_search_that_begins_later_is_the_search_of_what_is_left():
    for _seed, _scene, moving, start, goal in cases(2, 300, count=4, samples=30):
        whole = search_space_time(moving, start, goal)
        if whole.path is None or whole.path.arrival < 4:
            continue
        rest = search_space_time(moving, int(whole.path.cells[3]), goal, since=3)
        assert rest.path is not None
        assert rest.path.arrival + 3 == whole.path.arrival


def grid_distances(moving, k, goal, standing):
    """Distances to the goal over the nodes free at one sample, by plain Dijkstra; the arm's own node counts."""
    poses = moving.poses
    free = moving.nodes(k).ravel()[poses.cell]
    distance, heap = np.full(len(poses.cell), inf), [(0.0, goal)]
    distance[goal] = 0.0
    while heap:
        length, n = heapq.heappop(heap)
        if length > distance[n] or (not free[n] and n != standing):
            continue
        if not free[n]:
            continue
        for d in range(8):
            if (poses.moves[n] >> d) & 1:
                m = int(poses.place[poses.cell[n] + DY[d] * poses.columns + DX[d]])
                cost = length + (1.0 if d < 4 else sqrt(2.0))
                if cost < distance[m] and (free[m] or m == standing):
                    distance[m] = cost
                    heapq.heappush(heap, (cost, m))
    return distance


def test_plain_d_star_goes_along_a_shortest_path_of_every_samples_map(sized):
    moves = replans = 0
    for seed, _scene, moving, start, goal in cases(sized(6, 60), 500, count=5, samples=40):
        poses = moving.poses
        first, last = int(poses.place[start]), int(poses.place[goal])
        places = np.full(moving.clock.samples + 1, -1, np.int64)
        _, end, expanded = run_plain(poses, moving.free, first, last, places)
        for k in range(end):
            here, after = int(places[k]), int(places[k + 1])
            distance = grid_distances(moving, k, last, here)
            replans += (moving.free[k] != moving.free[max(0, k - 1)]).any()
            if distance[here] == inf:
                assert after == here, f"seed {seed}, sample {k}"
                continue
            ends = [divmod(int(poses.cell[n]), poses.columns) for n in (here, after)]
            step = dist(*ends)
            assert distance[after] + step == pytest.approx(distance[here]), f"seed {seed}, sample {k}"
            moves += 1
        assert expanded < (end + 1) * len(poses.cell)
    assert moves > 20
    assert replans > 20


def test_the_modified_rule_goes_on_stops_or_goes_back_by_what_is_free_next():
    kinds = set()
    for seed, _scene, moving, start, goal in cases(25, 900, count=5, samples=40):
        run = run_rule("modified", moving, start, goal)
        if run.path is None:
            continue
        cells = run.path.cells.tolist()
        free = [unpacked(plane, moving.poses.columns).ravel() for plane in moving.free]
        way = list(dict.fromkeys(cells))
        for k in range(len(cells) - 1):
            here, after = way.index(cells[k]), way.index(cells[k + 1])
            if after == here + 1:
                kinds.add("on")
            elif after == here:
                kinds.add("stop")
                assert here + 1 == len(way) or not free[k + 1][way[here + 1]], f"seed {seed}, sample {k}"
            else:
                kinds.add("back")
                assert after == here - 1
                assert not free[k + 1][cells[k]], f"seed {seed}, sample {k}"
    assert kinds == {"on", "stop", "back"}


def test_contacts_of_a_rule_are_contacts_and_runs_without_are_clear():
    found = {"contact": 0, "clear": 0, "between": 0}
    for seed, scene, moving, start, goal in cases(30, 1500, count=6, samples=40):
        run = run_rule("plain", moving, start, goal)
        assert run.path is not None
        q = run.path.q_rad

        def pose_at(time_s, q=q):
            k = min(int(time_s / SAMPLE_S), len(q) - 2)
            u = min(1.0, time_s / SAMPLE_S - k)  # at the end it rests
            return q[k] + (q[k + 1] - q[k]) * (3 * u**2 - 2 * u**3)

        if run.contact is None:
            found["clear"] += 1
            until = moving.clock.samples if run.outcome == "reached" else run.path.arrival
            for time_s in np.linspace(0.0, until * SAMPLE_S, 90):
                assert clearance_at(scene, pose_at(time_s), time_s) > scene.margin_cm - 1e-3, f"seed {seed}"
        else:
            found["contact"] += 1
            found["between"] += run.contact.between
            assert run.outcome == "contact"
            assert not run.contact.at_goal
            at = run.contact.time_s
            assert clearance_at(scene, pose_at(at), at) <= scene.margin_cm + 1e-9, f"seed {seed}"
            assert f"obstacles[{run.contact.obstacle}]" in run.contact.words()
    assert min(found["contact"], found["clear"]) > 0


def test_a_goal_that_is_taken_after_a_rule_has_reached_it_is_the_rules_failure():
    # The arm is there after 2 samples. From sample 6 to 16 a disc comes 10 cm along link 2's line, to its end.
    comes = ObstacleMotion((0.0, 6 * SAMPLE_S, 16 * SAMPLE_S), ((0.0, 0.0), (0.0, 0.0), (-10.0, 0.0)), False)
    scene = make_scene(
        [Obstacle("circle", (38.0, 4.0), 2.0, motion=comes)],
        links=(15.0, 15.0), limits=QUARTER, x=(-32.0, 32.0), y=(-32.0, 32.0), cell=2.0,
        start=(28.0, 0.0), goal=(28.0, 4.0),
    )  # fmt: skip
    moving = build_moving_map(replace_moving(scene, MovingSpec(SAMPLE_S, 20, 0.0)), "up")
    for rule in ("plain", "modified"):
        run = run_rule(rule, moving, *task_of(scene, moving))
        assert run.outcome == "goal taken"
        assert run.path.arrival == 2
        # 9 cm between tip and disc, less the margin, at 10 cm in 10 samples.
        touched_s = (6 + 9.0 - scene.margin_cm) * SAMPLE_S
        assert touched_s - 1e-6 <= run.contact.time_s <= touched_s + SAMPLE_S
        assert clearance_at(scene, run.path.q_rad[-1], run.contact.time_s) <= scene.margin_cm + 1e-9
        assert run.words().startswith("obstacles[1] touches the arm at the goal by sample 15")
    before = build_moving_map(replace_moving(scene, MovingSpec(SAMPLE_S, 14, 0.0)), "up")
    assert run_rule("modified", before, *task_of(scene, before)).words() == "reached at sample 2"


def test_an_arm_and_an_obstacle_that_change_places_between_two_samples_are_found():
    # A small fast disc is beyond link 2 at one sample and on the other side of it at the next.
    jump = ObstacleMotion((0.0, SAMPLE_S), ((0.0, 0.0), (0.0, 12.0)), False)
    scene = make_scene(
        [Obstacle("circle", (24.0, -6.0), 1.0, motion=jump)],
        links=(15.0, 15.0), limits=QUARTER, x=(-32.0, 32.0), y=(-32.0, 32.0), cell=2.0,
        start=(28.0, 0.0), goal=(28.0, 4.0),
    )  # fmt: skip
    moving = build_moving_map(replace_moving(scene, MovingSpec(SAMPLE_S, 10, 0.0)), "up")
    start, goal = task_of(scene, moving)
    assert moving.nodes(0).ravel()[start]
    assert moving.nodes(1).ravel()[start]
    rests = TimedPath.through(moving, np.array([start, start]))
    contact = first_contact(moving, rests)
    assert contact is not None
    assert contact.between
    assert "between samples 0 and 1" in contact.words()
    assert search_space_time(moving, start, goal).status is MovingStatus.IMPOSSIBLE
