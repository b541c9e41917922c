"""Every planner on random scenes of an arm: scipy's Dijkstra on the same graph, and shapely on the arm along the path.

The default run takes a slice, `--full` at least 1,000 scenes. What is shown for each scene and each rule for moves:
planners that use a whole neighbourhood are exactly as short as Dijkstra on that graph, Chaos A* and any-angle paths are
not shorter than the bound, pulling taut never lengthens, the optimum is no longer than any, and proved paths keep more
than the margin.
"""

from collections import Counter
from functools import cache, lru_cache
from itertools import pairwise
from math import inf

import numpy as np
import pytest
from scipy.ndimage import label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from dense_check import least_clearance_cm
from host_scenes import make_scene, random_obstacles
from planarm.search.grid_search import find_path
from planarm.search.stencils import cover, stencil
from planarm.workspace.free_map import build_free_map
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import PROVED
from planarm.workspace.world import FREE
from search_maps import planner

STENCILS = [("a_star", 8), ("modified_a_star", 24), ("modified_a_star", 48), ("chs", 12), ("chs", 28), ("chs", 48)]
STENCILS += [("chs", 56), ("chs", 80)]
CHAOS = [("chaos_a_star", n, subset) for n in (8, 20, 44, 68) for subset in ("run", "expansion")]
ANY_ANGLE = [("taut", 56), ("theta_star", 8), ("lazy_theta_star", 8)]
SAME = 1e-9


@cache
def scene_of(seed):
    """A random scene with its map, and two nodes far apart in the largest connected part of its free space."""
    rng = np.random.default_rng(seed)
    links = tuple(float(v) for v in rng.uniform(15.0, 32.0, 2))
    obstacles = random_obstacles(rng, int(rng.integers(1, 6)), size=7.0, keep_off=20.0)
    scene = make_scene(
        obstacles, links=links, elbow=str(rng.choice(["up", "down"])), cell=float(rng.choice([1.0, 2.0]))
    )
    free_map = build_free_map(scene)
    parts, count = label(free_map.region == FREE, np.ones((3, 3)))
    if count == 0:
        return scene, free_map, (0.0, 0.0), (0.0, 0.0)
    iy, ix = np.nonzero(parts == 1 + np.argmax(np.bincount(parts.ravel())[1:]))
    nodes = np.column_stack([free_map.x_cm[ix], free_map.y_cm[iy]])
    start = nodes[rng.integers(len(nodes))]
    goal = nodes[np.argsort(np.hypot(*(nodes - start).T))[int(rng.uniform(0.3, 0.95) * (len(nodes) - 1))]]
    return scene, free_map, tuple(map(float, start)), tuple(map(float, goal))


def shifted(array, dx, dy, nothing):
    """What `array` holds at (x + dx, y + dy), for each [y, x]."""
    rows, columns = array.shape
    reach = max(abs(dx), abs(dy))
    padded = np.pad(array, reach, constant_values=nothing)
    return padded[reach + dy : reach + dy + rows, reach + dx : reach + dx + columns]


@lru_cache(maxsize=256)
def legal_moves(seed, dx, dy, moves):
    """Where the move (dx, dy) may be made, for each [y, x]; those of one scene are shared by all stencils."""
    _, free_map, _, _ = scene_of(seed)
    if (dy, dx) < (0, 0):  # a move is as legal one way as the other
        return shifted(legal_moves(seed, -dx, -dy, moves), dx, dy, False)
    free = free_map.region == FREE
    legal = free & shifted(free, dx, dy, False)
    if moves == "cells":
        legal &= np.logical_and.reduce([shifted(free, x, y, False) for x, y in cover(dx, dy)])
    elif moves == "proved":
        whole = np.logical_and.reduce([shifted(free_map.whole, x, y, False) for x, y in cover(dx, dy)])
        iy, ix = np.nonzero(legal & ~whole)
        ends = (free_map.x_cm[ix], free_map.y_cm[iy], free_map.x_cm[ix + dx], free_map.y_cm[iy + dy])
        verdicts = [prove_line(free_map.world, *line)[0] for line in zip(*(end.tolist() for end in ends), strict=True)]
        legal[iy, ix] = np.array(verdicts, int) == PROVED
    return legal


def dijkstra_cm(seed, offsets, moves):
    """Shortest length on all legal moves of the whole neighbourhood."""
    _, free_map, start_cm, goal_cm = scene_of(seed)
    columns, size = free_map.region.shape[1], free_map.region.size
    tails, heads, lengths = [], [], []
    for dx, dy in offsets.tolist():
        at = np.flatnonzero(legal_moves(seed, dx, dy, moves))
        tails.append(at)
        heads.append(at + dy * columns + dx)
        lengths.append(np.full(at.size, free_map.cell_cm * np.hypot(dx, dy)))
    graph = csr_matrix((np.concatenate(lengths), (np.concatenate(tails), np.concatenate(heads))), shape=(size, size))
    start, goal = (
        int(np.argmin(np.abs(free_map.y_cm - y))) * columns + int(np.argmin(np.abs(free_map.x_cm - x)))
        for x, y in (start_cm, goal_cm)
    )
    return float(dijkstra(graph, indices=start)[goal])


def check_path(seed, result, moves):
    """What holds for every path that is found."""
    scene, free_map, start_cm, goal_cm = scene_of(seed)
    points = result.path.points_cm
    assert tuple(points[0]) == start_cm and tuple(points[-1]) == goal_cm
    assert result.path.length_cm == pytest.approx(sum(np.hypot(*(b - a)) for a, b in pairwise(points)), rel=1e-12)
    assert 0.0 < result.bound_cm <= result.path.length_cm + SAME
    if moves == "proved":
        assert least_clearance_cm(scene, points) > free_map.margin_cm


@pytest.mark.parametrize("moves", ["nodes", "cells", "proved"])
def test_planners_on_random_scenes(moves, sized):
    seen = Counter()
    for seed in range(sized(8, 1000)):
        _, free_map, start_cm, goal_cm = scene_of(seed)
        if start_cm == goal_cm:
            continue
        lengths = {}
        for algorithm, neighbours in STENCILS if sized(0, 1) else STENCILS[seed % 2 :: 2]:
            result = find_path(free_map, start_cm, goal_cm, planner(algorithm, neighbours, moves=moves))
            expected_cm = dijkstra_cm(seed, stencil(algorithm, neighbours), moves)
            found_cm = result.path.length_cm if result.path else inf
            assert found_cm == pytest.approx(expected_cm, rel=1e-12), f"seed {seed}: {algorithm} {neighbours} {moves}"
            lengths[algorithm, neighbours] = found_cm
            seen["exact"] += result.path is not None
            if result.path:
                check_path(seed, result, moves)
        for algorithm, neighbours, subset in CHAOS:
            spec = planner(algorithm, neighbours, moves=moves, subset=subset, seed=seed)
            result = find_path(free_map, start_cm, goal_cm, spec)
            if result.path:
                seen["chaos"] += 1
                check_path(seed, result, moves)
        if moves != "nodes":
            seen += any_angle_on(seed, moves)
    assert min(seen.values()) >= 0.5 * sized(8, 1000), f"most scenes have paths: {seen}"


@cache
def any_angle_on(seed, moves):
    """Check the any-angle planners on one scene; count what was seen."""
    _, free_map, start_cm, goal_cm = scene_of(seed)
    chs = find_path(free_map, start_cm, goal_cm, planner("chs", 56, moves=moves)).path
    best = find_path(free_map, start_cm, goal_cm, planner("any_angle", 56, moves=moves))
    if chs is None:
        assert best.path is None
        return Counter()
    check_path(seed, best, moves)
    for algorithm, neighbours in ANY_ANGLE:
        result = find_path(free_map, start_cm, goal_cm, planner(algorithm, neighbours, moves=moves))
        if result.path is None:
            assert algorithm != "taut"
            continue
        check_path(seed, result, moves)
        assert result.path.length_cm >= best.path.length_cm - 1e-6, f"seed {seed}: {algorithm} beats the optimum"
        if algorithm == "taut":
            assert result.path.length_cm <= chs.length_cm
            taut_cm = result.path.length_cm
    return Counter({"taut": 1, "near": int(taut_cm <= best.path.length_cm * 1.001)})


def test_the_default_is_within_a_thousandth_of_the_optimum(sized):
    """Of the random scenes' paths at 1 and 2 cm cells, 99 % at least."""
    seen = sum((any_angle_on(seed, "proved") for seed in range(sized(25, 1000))), Counter())
    assert seen["taut"] >= 0.6 * sized(25, 1000)
    assert seen["near"] >= (0.99 if sized(0, 1) else 0.95) * seen["taut"], seen
