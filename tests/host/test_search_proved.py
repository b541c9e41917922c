"""Proved moves: the arm never comes nearer than the margin, judged by kinematics and geometry of the tests' own."""

from functools import cache
from math import hypot, inf

import numpy as np
import pytest
from scipy.ndimage import label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from dense_check import least_clearance_cm
from host_scenes import make_scene, random_obstacles
from planarm.scene import Obstacle
from planarm.search.draw import draw_subset
from planarm.search.grid_search import find_path
from planarm.search.lattice import make_lattice, node_at
from planarm.search.legal import line_is_free
from planarm.search.result import SearchStatus
from planarm.search.stencils import DRAWN, cover, stencil
from planarm.workspace.free_map import build_free_map
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import PROVED
from planarm.workspace.world import FREE
from search_maps import EXACT, PLANNERS, planner, table1_scene

CASES = range(14)


def lattice_node(lattice, free_map, ix, iy):
    """The lattice's node of the map's node [iy, ix]."""
    column, row = (round(value / free_map.cell_cm) for value in (free_map.x_cm[ix], free_map.y_cm[iy]))
    return node_at(lattice, column, row)


@cache
def random_case(seed):
    """A random scene with its map, and two nodes far apart in the largest connected part of its free space."""
    rng = np.random.default_rng(seed)
    elbow = ("up", "down")[seed % 2]
    scene = make_scene(random_obstacles(rng, int(rng.integers(2, 7))), elbow=elbow, cell=(1.0, 2.0)[seed % 2])
    free_map = build_free_map(scene)
    parts, _ = label(free_map.region == FREE, np.ones((3, 3)))
    iy, ix = np.nonzero(parts == np.argmax(np.bincount(parts[parts > 0])))
    nodes = np.column_stack([free_map.x_cm[ix], free_map.y_cm[iy]])
    start = nodes[rng.integers(len(nodes))]
    goal = nodes[np.argsort(np.hypot(*(nodes - start).T))[int(0.8 * len(nodes))]]
    return scene, free_map, tuple(map(float, start)), tuple(map(float, goal))


@pytest.mark.parametrize(("algorithm", "neighbours"), PLANNERS)
@pytest.mark.parametrize("seed", CASES)
def test_a_proved_path_keeps_more_than_the_margin_everywhere(algorithm, neighbours, seed):
    scene, free_map, start_cm, goal_cm = random_case(seed)
    result = find_path(free_map, start_cm, goal_cm, planner(algorithm, neighbours, moves="proved"))
    if result.status is SearchStatus.NO_PATH:
        assert "No path" in result.reason
        return
    assert least_clearance_cm(scene, result.path.points_cm) > free_map.margin_cm


def test_most_random_cases_have_a_path_and_the_oracle_sees_node_checked_ones_collide():
    """The test above is not empty: with nodes checked only, some of the very same searches come too near."""
    found = collided = 0
    for seed in CASES:
        scene, free_map, start_cm, goal_cm = random_case(seed)
        found += find_path(free_map, start_cm, goal_cm, planner("chs", 56, moves="proved")).path is not None
        hopped = find_path(free_map, start_cm, goal_cm, planner("chs", 56)).path
        collided += hopped is not None and least_clearance_cm(scene, hopped.points_cm) <= free_map.margin_cm
    assert found >= 5 and collided >= 5


def test_table_1_case_2_with_chs_is_free_when_proved_and_not_when_nodes_are_checked():
    scene = table1_scene(2)
    free_map = build_free_map(scene)
    clearances = {
        moves: least_clearance_cm(
            scene,
            find_path(
                free_map, scene.task.start_cm, scene.task.goal_cm, planner("chs", 56, moves=moves)
            ).path.points_cm,
        )
        for moves in ("nodes", "proved")
    }
    assert clearances["nodes"] < 0.2 < free_map.margin_cm < clearances["proved"]


@cache
def map_with_posts(seed):
    """Thin posts far out: nearly every node is free, but no move may sweep a link over a post."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 14))
    distance, direction = rng.uniform(33.0, 49.5, count), rng.uniform(-1.4, 4.6, count)
    centers = np.column_stack([distance * np.cos(direction), distance * np.sin(direction)])
    posts = [Obstacle("circle", (float(x), float(y)), 0.02) for x, y in centers]
    return build_free_map(make_scene(posts, width=0.002, cell=2.0))


def random_tasks(seed, count=8):
    """Starts and goals among the free nodes of the map with posts."""
    free_map = map_with_posts(seed)
    nodes = np.argwhere(free_map.region == FREE)
    picked = np.random.default_rng(1000 + seed).integers(len(nodes), size=(count, 2))
    return [[(float(free_map.x_cm[ix]), float(free_map.y_cm[iy])) for iy, ix in nodes[pair]] for pair in picked]


@cache
def proved_moves(seed, algorithm, neighbours):
    """All moves of the neighbourhood between free nodes, as {((ix, iy), (dx, dy)): proved or not}, both ways."""
    free_map = map_with_posts(seed)
    rows, columns = free_map.region.shape
    verdicts = {}
    for iy, ix in np.argwhere(free_map.region == FREE).tolist():
        for dx, dy in stencil(algorithm, neighbours).tolist():
            x, y = ix + dx, iy + dy
            forward = dy > 0 or (dy == 0 and dx > 0)
            if forward and 0 <= x < columns and y < rows and free_map.region[y, x] == FREE:
                line = free_map.x_cm[ix], free_map.y_cm[iy], free_map.x_cm[x], free_map.y_cm[y]
                proved = prove_line(free_map.world, *line)[0] == PROVED
                verdicts[(ix, iy), (dx, dy)] = verdicts[(x, y), (-dx, -dy)] = proved
    assert 0.02 < 1.0 - np.mean(list(verdicts.values())) < 0.2, "so the search has to fall back on second best ways"
    return verdicts


def assert_as_short_as_dijkstra(seed, algorithm, neighbours, settings, offered):
    """Compare with Dijkstra over the proved moves that `offered((ix, iy), (dx, dy))` lets a node have."""
    free_map = map_with_posts(seed)
    rows, columns = free_map.region.shape
    edges = [
        (iy * columns + ix, (iy + dy) * columns + ix + dx, free_map.cell_cm * hypot(dx, dy))
        for ((ix, iy), (dx, dy)), proved in proved_moves(seed, algorithm, neighbours).items()
        if proved and offered((ix, iy), (dx, dy))
    ]
    tails, heads, lengths = zip(*edges, strict=True)
    graph = csr_matrix((lengths, (tails, heads)), shape=(rows * columns,) * 2)
    for start_cm, goal_cm in random_tasks(seed):
        start, goal = (
            int(np.argmin(np.abs(free_map.y_cm - y))) * columns + int(np.argmin(np.abs(free_map.x_cm - x)))
            for x, y in (start_cm, goal_cm)
        )
        expected_cm = dijkstra(graph, indices=start)[goal]
        result = find_path(free_map, start_cm, goal_cm, settings)
        if expected_cm == inf:
            assert result.status is SearchStatus.NO_PATH
        else:
            assert result.path.length_cm == pytest.approx(expected_cm, rel=1e-12)


@pytest.mark.parametrize(("algorithm", "neighbours"), [("a_star", 8), ("modified_a_star", 24), ("chs", 12)])
@pytest.mark.parametrize("seed", range(6))
def test_the_length_is_dijkstras_on_the_graph_of_all_proved_moves(algorithm, neighbours, seed):
    """The search proves few moves, uses primitive ones only, and accepts whole cells unseen; none of it shows."""
    settings = planner(algorithm, neighbours, moves="proved")
    assert_as_short_as_dijkstra(seed, algorithm, neighbours, settings, lambda node, move: True)


@pytest.mark.parametrize("seed", range(6))
def test_chaos_with_a_subset_at_each_expansion_is_dijkstras_on_the_drawn_and_proved_moves(seed):
    free_map = map_with_posts(seed)
    offsets = stencil("chaos_a_star", 44)
    lattice = make_lattice(free_map, int(offsets.max()))
    order = np.empty(44, np.int64)
    draws = {}

    def offered(node, move):
        if node not in draws:
            draw_subset(order, DRAWN[44], seed, 1 + lattice_node(lattice, free_map, *node))
            draws[node] = set(map(tuple, offsets[order[: DRAWN[44]]].tolist()))
        return move in draws[node]

    settings = planner("chaos_a_star", 44, moves="proved", subset="expansion", seed=seed)
    assert_as_short_as_dijkstra(seed, "chaos_a_star", 44, settings, offered)


@pytest.mark.parametrize(("algorithm", "neighbours"), [("a_star", 8), ("chs", 80)])
def test_a_move_is_as_free_one_way_as_the_other(algorithm, neighbours):
    _, free_map, _, _ = random_case(0)
    offsets = stencil(algorithm, neighbours).tolist()
    lattice = make_lattice(free_map, 5)
    rng = np.random.default_rng(1)
    nodes = rng.permutation(np.argwhere(free_map.region == FREE))[:60]
    verdicts = []
    for iy, ix in nodes.tolist():
        a = lattice_node(lattice, free_map, ix, iy)
        for dx, dy in offsets:
            b = a + dx + dy * lattice.width
            verdicts.append(line_is_free(lattice, free_map.world, a, b))
            assert verdicts[-1] == line_is_free(lattice, free_map.world, b, a)
    assert 0.1 < np.mean(verdicts) < 1.0


def test_a_move_through_cells_that_are_free_as_a_whole_can_always_be_proved():
    """So accepting it unseen changes nothing."""
    _, free_map, _, _ = random_case(2)
    rng = np.random.default_rng(2)
    checked = 0
    for iy, ix in rng.permutation(np.argwhere(free_map.whole))[:150].tolist():
        for dx, dy in stencil("chs", 56).tolist():
            cells = [(iy + y, ix + x) for x, y in cover(dx, dy)]
            rows, columns = free_map.whole.shape
            if all(0 <= y < rows and 0 <= x < columns and free_map.whole[y, x] for y, x in cells):
                line = free_map.x_cm[ix], free_map.y_cm[iy], free_map.x_cm[ix + dx], free_map.y_cm[iy + dy]
                assert prove_line(free_map.world, *line)[0] == PROVED
                checked += 1
    assert checked > 1000


@pytest.mark.parametrize(("algorithm", "neighbours"), EXACT)
def test_proving_moves_never_shortens_a_path(algorithm, neighbours):
    _, free_map, start_cm, goal_cm = random_case(4)
    nodes, proved = (
        find_path(free_map, start_cm, goal_cm, planner(algorithm, neighbours, moves=moves))
        for moves in ("nodes", "proved")
    )
    if proved.path:
        assert nodes.path.length_cm <= proved.path.length_cm * (1.0 + 1e-12)
