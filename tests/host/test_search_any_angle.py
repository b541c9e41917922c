"""Any-angle paths: what is in sight, paths pulled taut, and the bound, on maps drawn in text and on maps of an arm."""

from dataclasses import replace
from math import hypot

import numpy as np
import pytest
from scipy.sparse.csgraph import shortest_path

from planarm.routes.route import find_route
from planarm.search import optimum as optimum_search
from planarm.search.costs import move_costs, norm, norm_planes
from planarm.search.grid_search import find_path
from planarm.search.lattice import make_lattice, near_room
from planarm.search.legal import CELLS, PROOF
from planarm.search.optimum import excess, lower_bound_cells
from planarm.search.sight import in_sight
from planarm.search.stencils import cover, stencil
from planarm.workspace.free_map import build_free_map
from search_maps import drawn_map, grid_map, planner, table1_scene

ALGORITHMS = [("taut", 56), ("theta_star", 8), ("lazy_theta_star", 8), ("any_angle", 56)]


def test_cells_on_a_leg_are_those_of_the_stencils_covers():
    """A leg is in sight, cells checked, exactly when the cells that `cover` lists for it are free."""
    rng = np.random.default_rng(0)
    for _ in range(60):
        free = rng.random((12, 12)) < 0.85
        free_map = grid_map(free)
        lattice = make_lattice(free_map, 1)
        for _ in range(60):
            (ax, ay), (bx, by) = rng.integers(0, 12, (2, 2)).tolist()
            if (ax, ay) == (bx, by):
                continue
            expected = all(free[ay + y, ax + x] for x, y in cover(bx - ax, by - ay))
            for a, b in (((ax, ay), (bx, by)), ((bx, by), (ax, ay))):
                ends = [float(value + 1) for point in (a, b) for value in point]
                assert in_sight(lattice, free_map.world, CELLS, *ends) == expected


def test_a_leg_that_is_proved_is_in_sight_both_ways_and_a_blocked_one_is_not():
    free_map = build_free_map(table1_scene(1))
    lattice = make_lattice(free_map, 1)
    rng, seen = np.random.default_rng(1), [0, 0]
    iy, ix = np.nonzero(free_map.region == 0)
    for a, b in rng.integers(len(ix), size=(400, 2)).tolist():
        ends = [float(v + 1) for v in (ix[a], iy[a], ix[b], iy[b])]
        there = in_sight(lattice, free_map.world, PROOF, *ends)
        assert there == in_sight(lattice, free_map.world, PROOF, *ends[2:], *ends[:2])
        seen[there] += 1
    assert min(seen) > 20


def optimum_cm(free, start, goal):
    """Dijkstra over all pairs of free nodes (x, y) whose straight move crosses cells with free nodes only."""
    nodes = [(int(x), int(y)) for y, x in np.argwhere(free)]
    legs = np.full((len(nodes), len(nodes)), np.inf)
    for i, (ax, ay) in enumerate(nodes):
        for j, (bx, by) in enumerate(nodes[:i]):
            if all(free[ay + y, ax + x] for x, y in cover(bx - ax, by - ay)):
                legs[i, j] = legs[j, i] = hypot(bx - ax, by - ay)
    return shortest_path(legs, method="D", indices=nodes.index(start))[nodes.index(goal)]


@pytest.mark.parametrize("seed", range(8))
def test_the_optimum_is_dijkstras_over_all_pairs_in_sight_and_none_is_shorter(seed):
    free = np.random.default_rng(seed).random((11, 13)) < 0.8
    free[0, 0] = free[10, 12] = True
    free_map, expected = grid_map(free), optimum_cm(free, (0, 0), (12, 10))
    for algorithm, neighbours in ALGORITHMS:
        result = find_path(free_map, (0.0, 0.0), (12.0, 10.0), planner(algorithm, neighbours, moves="cells"))
        found = result.path.length_cm if result.path else np.inf
        assert found == pytest.approx(expected, rel=1e-9) if algorithm == "any_angle" else found >= expected - 1e-9
        assert result.bound_cm <= expected + 1e-9
        if algorithm == "taut" and result.path:
            assert result.bound_cm == pytest.approx(expected, rel=1e-9) and found <= 1.01 * expected


@pytest.mark.parametrize(("algorithm", "neighbours"), ALGORITHMS)
@pytest.mark.parametrize("moves", ["nodes", "cells", "proved"])
def test_any_angle_planners_answer_when_there_is_no_path_and_when_there_is_nothing_to_do(algorithm, neighbours, moves):
    free_map, start_cm, goal_cm = drawn_map("S.#.G\n..#..\n..#..") if moves == "cells" else drawn_map("S#####G")
    result = find_path(free_map, start_cm, goal_cm, planner(algorithm, neighbours, moves=moves))
    assert result.path is None and result.bound_cm == 0.0 and result.gap == 0.0 and "No path" in result.reason
    rest = find_path(free_map, start_cm, start_cm, planner(algorithm, neighbours, moves=moves))
    assert rest.path.length_cm == rest.bound_cm == 0.0


@pytest.mark.parametrize("case", [1, 2])
@pytest.mark.parametrize("neighbours", [12, 28, 48, 56, 80])
def test_pulling_taut_never_lengthens_and_ends_stay_where_they_are(case, neighbours):
    scene = table1_scene(case)
    free_map = build_free_map(scene)
    for start, goal in (((49.0, 2.0), (1.0, 45.0)), ((48.7, 2.3), (1.2, 44.6))):
        chs, taut = (
            find_path(free_map, start, goal, planner(algorithm, neighbours, moves="proved"))
            for algorithm in ("chs", "taut")
        )
        assert taut.path.length_cm <= chs.path.length_cm
        assert tuple(taut.path.points_cm[0]) == start and tuple(taut.path.points_cm[-1]) == goal
        assert 0.0 < taut.bound_cm <= taut.path.length_cm + 1e-9


def test_the_excess_is_the_worst_ratio_of_the_norm_to_the_straight_line():
    offsets = stencil("chs", 80)
    planes, unit = norm_planes(offsets), float(move_costs(np.array([[1, 0]], np.int16))[0])
    ratios = [norm(planes, x, y) / (unit * hypot(x, y)) for x in range(1, 200) for y in range(x + 1)]
    assert max(ratios) <= excess() and max(ratios) == pytest.approx(excess(), abs=1e-4)


def test_open_nodes_are_those_next_to_one_with_room():
    free = np.zeros((9, 11), bool)
    free[4, 5] = True
    lattice = make_lattice(grid_map(free), 6)
    rows, columns = np.nonzero(near_room(lattice, 2).room.reshape(-1, lattice.width))
    assert sorted(set(rows - 6)) == [2, 3, 4, 5, 6] and sorted(set(columns - 6)) == [3, 4, 5, 6, 7] and len(rows) == 25


def test_the_bound_is_infinite_only_without_any_chain():
    free_map, _, _ = drawn_map("S......G")
    lattice = make_lattice(free_map, 6)
    row = 6 * lattice.width + 6
    assert lower_bound_cells(lattice, free_map.world, row, row + 7) == pytest.approx(7.0)
    sealed, _, _ = drawn_map("S" + "#" * 12 + "G")
    lattice = make_lattice(sealed, 6)
    row = 6 * lattice.width + 6
    assert lower_bound_cells(lattice, sealed.world, row, row + 13) == np.inf


def test_a_search_for_the_optimum_that_takes_long_tells_how_far_it_is(monkeypatch):
    scene = table1_scene(1)
    scene = replace(scene, planner=planner("any_angle", 56, moves="proved"))
    known = find_route(scene, scene.margin_cm)
    told = []
    monkeypatch.setattr(optimum_search, "LOOKS_A_TURN", 0)  # after each node that is settled
    route = find_route(scene, scene.margin_cm, lambda stage, share: told.append((stage, share)))
    assert route.path.points_cm.tolist() == known.path.points_cm.tolist()
    shares = [share for _, share in told]
    assert {stage for stage, _ in told} == {"optimum"}
    assert len(shares) > 10
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < shares[-2] < shares[-1] == 1.0


def test_where_the_optimum_is_not_known_the_answer_says_so():
    """Points beside the nodes, moves checked at nodes alone, a map where too many nodes may lie on a shorter way."""
    exact = planner("any_angle", 56, moves="proved")
    scene = table1_scene(1)
    free_map = build_free_map(scene)
    optimum = find_path(free_map, (49.0, 2.0), (1.0, 45.0), exact)
    assert (optimum.note, optimum.gap, optimum.bound_cm) == ("", 0.0, optimum.path.length_cm)
    assert "no node" in find_path(free_map, (48.9, 2.3), (1.0, 45.0), exact).note
    assert "CHS" in find_path(free_map, (49.0, 2.0), (1.0, 45.0), planner("any_angle", 56, moves="nodes")).note
    fine = build_free_map(replace(scene, workspace=replace(scene.workspace, cell_cm=0.1)))
    found = find_path(fine, (49.0, 2.0), (1.0, 45.0), exact)
    assert "20,000 nodes" in found.note
    assert f"No path is shorter than {found.bound_cm:.4f} cm" in found.note
    assert f"at most {found.gap:.2%} longer" in found.note and 0.0 < found.gap < 0.02
    assert "workspace.cell_cm" in found.note
    assert found.gap > 0.0
