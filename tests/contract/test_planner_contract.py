"""What every planner promises on every map: statuses, legal paths, and no better length than the graph allows.

The maps are small and drawn in text; only nodes are checked on them, since no arm stands behind them. The same
promises on maps of an arm, with moves proved, end the file.
"""

from itertools import pairwise
from math import hypot, inf

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from host_scenes import make_scene
from planarm.scene import Obstacle
from planarm.search.grid_search import find_path
from planarm.search.result import SearchResult, SearchStatus
from planarm.search.stencils import stencil
from planarm.workspace.free_map import build_free_map
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import PROVED
from planarm.workspace.world import FREE
from search_maps import PLANNERS, drawn_map, planner

MAPS = {
    "open": """
        .........
        .........
        .S.....G.
        .........
        .........
    """,
    "wall": """
        ....##...
        ....##...
        .S..##.G.
        ....##...
        .........
    """,
    "maze": """
        S..######
        ##.#....#
        ##.#.##.#
        ##...##.#
        #######.G
    """,
    "pillars": """
        .#...#..#.
        ...#....#G
        S#...#....
        ...#...#.#
        .#...#....
    """,
    "corridor": """
        ##########
        S........G
        ##########
    """,
    "goal sealed by more than any move's length": """
        ...............
        ....###########
        ....###########
        ....###########
        ....###########
        ....###########
        S...#####G#####
        ....###########
        ....###########
        ....###########
        ....###########
        ....###########
        ...............
    """,
    "start blocked": """
        s...G
        .....
    """,
    "goal blocked": """
        S...g
        .....
    """,
    "start at the goal's neighbour": """
        SG
    """,
    "a single node": """
        S
        G
    """,
}
EXPECTED = {
    **dict.fromkeys(MAPS, SearchStatus.FOUND),
    "goal sealed by more than any move's length": SearchStatus.NO_PATH,
    "start blocked": SearchStatus.START_BLOCKED,
    "goal blocked": SearchStatus.GOAL_BLOCKED,
}
SUBSETS = ("run", "expansion")
ALL = [(a, n, s) for a, n in PLANNERS for s in (SUBSETS if a == "chaos_a_star" else SUBSETS[:1])]


def oracle_cm(free_map, offsets, start_cm, goal_cm):
    """Dijkstra on the graph of all moves of the whole neighbourhood between free nodes; inf when there is no path."""
    free = free_map.region == FREE
    rows, columns = free.shape
    edges = [
        (iy * columns + ix, (iy + dy) * columns + ix + dx, hypot(dx, dy) * free_map.cell_cm)
        for iy, ix in np.argwhere(free)
        for dx, dy in offsets.tolist()
        if 0 <= iy + dy < rows and 0 <= ix + dx < columns and free[iy + dy, ix + dx]
    ]
    tails, heads, lengths = zip(*edges, strict=True) if edges else ((), (), ())
    graph = csr_matrix((lengths, (tails, heads)), shape=(free.size, free.size))
    start, goal = (
        round((y - free_map.y_cm[0]) / free_map.cell_cm) * columns + round((x - free_map.x_cm[0]) / free_map.cell_cm)
        for x, y in (start_cm, goal_cm)
    )
    return dijkstra(graph, indices=start)[goal]


def check_promises(result, free_map, start_cm, goal_cm, offsets):
    """What holds for any answer to a question between two nodes."""
    assert isinstance(result, SearchResult)
    assert result.plan_s >= 0.0 and 0 <= result.expanded <= result.generated
    assert (result.status is SearchStatus.FOUND) == (result.path is not None) == (result.reason == "")
    if result.path is None:
        assert result.reason.endswith(".") and "cm" in result.reason
        return
    points = result.path.points_cm
    assert points.dtype == np.float64 and points.ndim == 2 and points.shape[1] == 2
    assert tuple(points[0]) == tuple(start_cm) and tuple(points[-1]) == tuple(goal_cm)
    assert result.path.elbow == free_map.elbow
    assert len(np.unique(points, axis=0)) == len(points), "a node is visited twice"
    moves = np.rint(np.diff(points, axis=0) / free_map.cell_cm).astype(int)
    assert set(map(tuple, moves.tolist())) <= set(map(tuple, offsets.tolist()))
    columns = np.rint((points - (free_map.x_cm[0], free_map.y_cm[0])) / free_map.cell_cm).astype(int)
    assert (free_map.region[columns[:, 1], columns[:, 0]] == FREE).all()
    assert result.path.length_cm == pytest.approx(sum(hypot(*(b - a)) for a, b in pairwise(points)), rel=1e-12)
    assert result.expanded >= len(points)


@pytest.mark.parametrize("cell_cm", [1.0, 0.1])
@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize(("algorithm", "neighbours", "subset"), ALL)
def test_every_planner_on_every_map(algorithm, neighbours, subset, name, cell_cm):
    free_map, start_cm, goal_cm = drawn_map(MAPS[name], cell_cm)
    offsets = stencil(algorithm, neighbours)
    expected_cm = oracle_cm(free_map, offsets, start_cm, goal_cm)
    settings = planner(algorithm, neighbours, subset=subset)
    result = find_path(free_map, start_cm, goal_cm, settings)
    check_promises(result, free_map, start_cm, goal_cm, offsets)
    if algorithm == "chaos_a_star":  # its subset may miss a path that there is, and it says so
        assert result.status is EXPECTED[name] or (result.status is SearchStatus.NO_PATH and "seed" in result.reason)
        assert result.path is None or result.path.length_cm >= expected_cm * (1.0 - 1e-12)
    else:
        assert result.status is EXPECTED[name]
        assert result.path is None or result.path.length_cm == pytest.approx(expected_cm, rel=1e-12)
        assert (result.status is SearchStatus.NO_PATH) <= (expected_cm == inf)
    again = find_path(free_map, start_cm, goal_cm, settings)
    assert again.status is result.status and again.reason == result.reason
    assert (again.expanded, again.generated) == (result.expanded, result.generated)
    if result.path:
        assert np.array_equal(again.path.points_cm, result.path.points_cm)


SCENES = {
    "no obstacles": make_scene(cell=2.0),
    "a disc between": make_scene([Obstacle("circle", (32.0, 22.0), 10.0)], cell=2.0),
    "a gap": make_scene([Obstacle("square", (40.0, 8.0), 8.0), Obstacle("hexagon", (12.0, 38.0), 8.0)], cell=2.0),
    "sealed": make_scene([Obstacle("circle", (24.0, 24.0), 46.0)], cell=2.0, limits=((-1.5, 2.5), (-3.0, 3.0))),
}
START_CM, GOAL_CM = (48.0, 2.0), (2.0, 46.0)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(("algorithm", "neighbours", "subset"), ALL)
def test_every_planner_on_maps_of_an_arm_with_moves_proved(algorithm, neighbours, subset, name):
    free_map = build_free_map(SCENES[name])
    offsets = stencil(algorithm, neighbours)
    result = find_path(free_map, START_CM, GOAL_CM, planner(algorithm, neighbours, subset=subset, moves="proved"))
    check_promises(result, free_map, START_CM, GOAL_CM, offsets)
    assert name != "sealed" or result.status is not SearchStatus.FOUND
    assert name != "no obstacles" or result.status is SearchStatus.FOUND or algorithm == "chaos_a_star"
    if result.path:
        for a, b in pairwise(result.path.points_cm):
            assert prove_line(free_map.world, *a, *b)[0] == PROVED
        nodes = find_path(free_map, START_CM, GOAL_CM, planner(algorithm, neighbours, subset=subset))
        assert nodes.path.length_cm <= result.path.length_cm * (1.0 + 1e-12)
