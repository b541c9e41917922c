"""The search on grids of free and blocked nodes, only nodes checked: Dijkstra on the same explicit graph as oracle."""

import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import combinations, pairwise
from math import hypot, inf, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from planarm.search import best_first
from planarm.search.draw import draw_subset
from planarm.search.grid_search import find_path
from planarm.search.lattice import make_lattice, node_at
from planarm.search.result import SearchStatus
from planarm.search.scratch import FIRST_ENTRIES, borrow, give_back
from planarm.search.stencils import DRAWN, cover, stencil
from search_maps import EXACT, PLANNERS, drawn_map, grid_map, planner


def random_free(seed, shape=(23, 31), share=0.68):
    free = np.random.default_rng(seed).random(shape) < share
    free[0, 0] = free[-1, -1] = True
    return free


def dijkstra_cm(free, offsets_at, cell_cm=1.0):
    """Shortest length from node [0, 0] to node [-1, -1] when node (ix, iy) has the moves `offsets_at(ix, iy)`."""
    rows, columns = free.shape
    heads, tails, lengths = [], [], []
    for iy, ix in np.argwhere(free):
        for dx, dy in offsets_at(ix, iy):
            x, y = ix + dx, iy + dy
            if 0 <= x < columns and 0 <= y < rows and free[y, x]:
                heads.append(iy * columns + ix)
                tails.append(y * columns + x)
                lengths.append(cell_cm * hypot(dx, dy))
    graph = csr_matrix((lengths, (heads, tails)), shape=(free.size, free.size))
    return dijkstra(graph, indices=0)[free.size - 1]


def search(free, algorithm, neighbours, cell_cm=1.0, **settings):
    free_map = grid_map(free, cell_cm)
    goal_cm = (float(free_map.x_cm[-1]), float(free_map.y_cm[-1]))
    return find_path(free_map, (0.0, 0.0), goal_cm, planner(algorithm, neighbours, **settings))


def assert_walk(result, free, offsets, cell_cm=1.0):
    """Every way-point is a free node and every move one of the offsets."""
    nodes = np.rint(result.path.points_cm / cell_cm).astype(int)
    assert np.abs(nodes * cell_cm - result.path.points_cm).max() < 1e-9
    assert free[nodes[:, 1], nodes[:, 0]].all()
    allowed = set(map(tuple, offsets.tolist()))
    assert all(tuple((b - a).tolist()) in allowed for a, b in pairwise(nodes))


def assert_same_length(result, expected_cm):
    if expected_cm == inf:
        assert result.status is SearchStatus.NO_PATH
    else:
        assert result.status is SearchStatus.FOUND
        assert result.path.length_cm == pytest.approx(expected_cm, rel=1e-12)


@pytest.mark.parametrize(("algorithm", "neighbours"), EXACT)
@pytest.mark.parametrize("seed", range(6))
def test_the_length_is_dijkstras_on_the_same_graph(algorithm, neighbours, seed):
    share, cell_cm = (0.55, 0.7, 0.9)[seed % 3], (1.0, 0.1)[seed % 2]
    free = random_free(seed, share=share)
    offsets = stencil(algorithm, neighbours)
    result = search(free, algorithm, neighbours, cell_cm)
    assert_same_length(result, dijkstra_cm(free, lambda ix, iy: offsets, cell_cm))
    if result.path:
        assert_walk(result, free, offsets, cell_cm)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32), st.integers(2, 12), st.integers(2, 12), st.floats(0.3, 1.0))
def test_small_maps_of_any_shape_and_density(seed, rows, columns, share):
    free = random_free(seed, (rows, columns), share)
    offsets = stencil("modified_a_star", 24)
    assert_same_length(search(free, "modified_a_star", 24), dijkstra_cm(free, lambda ix, iy: offsets))


@pytest.mark.parametrize("neighbours", DRAWN)
@pytest.mark.parametrize("seed", range(4))
def test_chaos_with_one_subset_is_shortest_with_that_subset(neighbours, seed):
    free = random_free(100 + seed, share=0.8)
    order = np.empty(neighbours, np.int64)
    draw_subset(order, DRAWN[neighbours], seed, 0)
    offsets = stencil("chaos_a_star", neighbours)[np.sort(order[: DRAWN[neighbours]])]
    result = search(free, "chaos_a_star", neighbours, seed=seed)
    assert_same_length(result, dijkstra_cm(free, lambda ix, iy: offsets))
    if result.path:
        assert_walk(result, free, offsets)


@pytest.mark.parametrize("neighbours", DRAWN)
@pytest.mark.parametrize("seed", range(4))
def test_chaos_with_a_subset_at_each_expansion_is_shortest_on_the_graph_of_those_draws(neighbours, seed):
    free = random_free(200 + seed, share=0.8)
    offsets = stencil("chaos_a_star", neighbours)
    lattice = make_lattice(grid_map(free), int(offsets.max()))

    def drawn_at(ix, iy):
        order = np.empty(neighbours, np.int64)
        draw_subset(order, DRAWN[neighbours], seed, 1 + node_at(lattice, ix, iy))
        return offsets[order[: DRAWN[neighbours]]]

    result = search(free, "chaos_a_star", neighbours, seed=seed, subset="expansion")
    assert_same_length(result, dijkstra_cm(free, drawn_at))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.sampled_from(list(DRAWN)), st.sampled_from(["run", "expansion"]))
def test_chaos_is_never_shorter_than_its_whole_octagon_and_repeats_itself(seed, neighbours, subset):
    free = random_free(seed, share=0.85)
    whole_cm = dijkstra_cm(free, lambda ix, iy: stencil("chaos_a_star", neighbours))
    first, second = (search(free, "chaos_a_star", neighbours, seed=seed, subset=subset) for _ in range(2))
    assert first.status is second.status
    assert (first.expanded, first.generated) == (second.expanded, second.generated)
    if first.path:
        assert first.path.length_cm >= whole_cm * (1.0 - 1e-12)
        assert first.path.points_cm.tolist() == second.path.points_cm.tolist()


def test_seed_and_subset_mode_of_chaos_matter():
    """On an open map the paths of 12 runs are not all the same, in either mode, and the modes differ."""
    free = np.ones((40, 60), bool)
    lengths = {
        subset: [search(free, "chaos_a_star", 44, seed=seed, subset=subset).path.length_cm for seed in range(12)]
        for subset in ("run", "expansion")
    }
    assert len(set(lengths["run"])) > 1 and len(set(lengths["expansion"])) > 1
    assert lengths["run"] != lengths["expansion"]


@pytest.mark.parametrize(
    ("algorithm", "neighbours", "worst_percent"),
    [("a_star", 8, 8.24), ("modified_a_star", 24, 2.75), ("modified_a_star", 48, 1.31), ("chs", 56, 0.75)],
)
def test_the_worst_excess_in_the_open_is_what_the_widest_gap_between_directions_gives(
    algorithm, neighbours, worst_percent
):
    """Between two neighbouring directions an angle a apart the excess is at most 1 / cos(a / 2) - 1.

    That is reached where the straight line halves the angle: 22.5 degrees for 8 neighbours, 1 / cos = 1.0824.
    """
    angles = np.unique(np.round(np.arctan2(*stencil(algorithm, neighbours).T[::-1].astype(float)), 12))
    theory = 1.0 / np.cos(0.5 * np.diff(angles).max()) - 1.0
    assert 100.0 * theory == pytest.approx(worst_percent, abs=0.006)
    span = 60
    free_map = grid_map(np.ones((span + 1, span + 1), bool))
    excess = []
    for goal_y in range(span + 1):
        goal_cm = (float(span), float(goal_y))
        result = find_path(free_map, (0.0, 0.0), goal_cm, planner(algorithm, neighbours))
        excess.append(result.path.length_cm / hypot(*goal_cm) - 1.0)
    assert max(excess) <= theory + 1e-12
    assert max(excess) > 0.97 * theory


def test_a_wide_move_that_checks_its_end_only_hops_over_a_wall():
    """What the papers' reading allows: CHS crosses a wall of one node's thickness, A* with 8 neighbours cannot."""
    free_map, start, goal = drawn_map("""
        ...#...
        S..#..G
        ...#...
    """)
    hopped = find_path(free_map, start, goal, planner("chs", 12))
    assert hopped.path.length_cm == 6.0
    assert find_path(free_map, start, goal, planner("a_star", 8)).status is SearchStatus.NO_PATH


def test_a_path_of_known_length_around_a_wall():
    free_map, start, goal = drawn_map("""
        ..S#G..
        ...#...
        .......
    """)
    result = find_path(free_map, start, goal, planner("a_star", 8))
    assert result.path.length_cm == pytest.approx(2.0 * sqrt(2.0) + 2.0 * 1.0, rel=1e-15)
    assert result.path.points_cm.tolist() in (
        [[2, 2], [2, 1], [3, 0], [4, 1], [4, 2]],
        [[2, 2], [2, 1], [3, 0], [4, 1], [4, 2]][::-1],
    )


@pytest.mark.parametrize(("algorithm", "neighbours"), PLANNERS)
def test_there_and_back_are_equally_long_for_whole_neighbourhoods(algorithm, neighbours):
    """Moves are symmetric, so lengths are; a drawn subset need not be."""
    free = random_free(5, share=0.9)
    free_map = grid_map(free)
    goal_cm = (float(free_map.x_cm[-1]), float(free_map.y_cm[-1]))
    there = find_path(free_map, (0.0, 0.0), goal_cm, planner(algorithm, neighbours))
    back = find_path(free_map, goal_cm, (0.0, 0.0), planner(algorithm, neighbours))
    assert there.path and back.path
    if algorithm != "chaos_a_star":
        assert there.path.length_cm == pytest.approx(back.path.length_cm, rel=1e-13)


def test_a_search_that_outgrows_its_first_open_list_is_still_exact():
    free = random_free(11, (150, 160), 0.8)
    kept = borrow(free.size)
    give_back(kept._replace(entry_node=kept.entry_node[:FIRST_ENTRIES], entry_below=kept.entry_below[:FIRST_ENTRIES]))
    result = search(free, "chs", 80)
    assert result.generated > 2 * FIRST_ENTRIES
    offsets = stencil("chs", 80)
    assert_same_length(result, dijkstra_cm(free, lambda ix, iy: offsets))


@pytest.mark.parametrize(
    ("seed", "shape", "share", "neighbours"), [(12, (150, 160), 0.8, 80), (106, (127, 197), 0.8, 48)]
)
def test_an_open_list_that_fills_up_beside_the_goal_changes_nothing(seed, shape, share, neighbours):
    """The goal is reached, but its bucket is not done with, when the first open list is full."""
    free = random_free(seed, shape, share)
    found = []
    for entries in (FIRST_ENTRIES, 1 << 20):
        kept = borrow(free.size)
        give_back(kept._replace(entry_node=np.empty(entries, np.int32), entry_below=np.empty(entries, np.int32)))
        found.append(search(free, "chs" if neighbours == 80 else "modified_a_star", neighbours))
    little, ample = found
    assert ample.generated > FIRST_ENTRIES - neighbours
    assert little.status is SearchStatus.FOUND
    assert np.array_equal(little.path.points_cm, ample.path.points_cm)
    assert (little.expanded, little.generated) == (ample.expanded, ample.generated)


@pytest.mark.parametrize(("algorithm", "neighbours"), EXACT)
def test_few_nodes_are_expanded_again(algorithm, neighbours):
    """Only those that a better way turns up for within a bucket."""
    free = random_free(3, (60, 60), 0.8)
    result = search(free, algorithm, neighbours)
    assert result.expanded <= 1.1 * free.sum() and result.expanded <= result.generated


@pytest.mark.parametrize("neighbours", [24, 48])
def test_leaving_out_turns_in_the_open_changes_no_length(neighbours):
    """Wide open maps with few posts, where most nodes look at three moves only."""
    for seed in range(4):
        free = random_free(seed, (50, 60), 0.995)
        offsets = stencil("modified_a_star", neighbours)
        assert_same_length(
            search(free, "modified_a_star", neighbours), dijkstra_cm(free, lambda ix, iy, moves=offsets: moves)
        )


def test_what_an_earlier_search_left_in_memory_does_not_matter():
    free = random_free(7, (40, 50), 0.8)
    before = search(free, "chs", 56)
    search(random_free(8, (90, 70), 0.9), "chs", 56)
    kept = borrow(1)
    kept.state[:], kept.g[:], kept.entry_node[:], kept.entry_below[:] = 131, 1, 3, 3
    give_back(kept)
    after = search(free, "chs", 56)
    assert np.array_equal(before.path.points_cm, after.path.points_cm) and before.expanded == after.expanded


def test_threads_that_search_at_once_search_as_each_would_alone(monkeypatch):
    """Kernels let go of the interpreter, so what they write to must be their thread's own while it searches.

    The searches meet: each has its memory before any begins, and none gives it back before all have ended.
    """
    maps = [random_free(seed, (150, 160), 0.8) for seed in (11, 12, 13)]
    alone = [search(free, "chs", 80) for free in maps]
    all_there, kernel, lent = threading.Barrier(len(maps)), best_first._search, []

    def meet(*arguments):
        if arguments[0].room.size < maps[0].size:  # the small one that loads the kernels
            return kernel(*arguments)
        lent.append(arguments[-1])
        all_there.wait(30.0)
        found = kernel(*arguments)
        all_there.wait(30.0)
        return found

    kept = borrow(maps[0].size)
    give_back(kept)  # this thread's, who searched alone
    monkeypatch.setattr(best_first, "_search", meet)
    with ThreadPoolExecutor(len(maps)) as threads:
        together = list(threads.map(lambda free: search(free, "chs", 80), maps))
    assert len(lent) == len(maps)
    for one, other in combinations([kept, *lent], 2):
        assert not any(np.shares_memory(mine, yours) for mine in one for yours in other)
    for one, other in zip(alone, together, strict=True):
        assert np.array_equal(one.path.points_cm, other.path.points_cm)
        assert (one.expanded, one.generated) == (other.expanded, other.generated)


def test_an_unknown_neighbourhood_is_refused():
    with pytest.raises(ValueError, match=r"planner\.neighbours = 5 is not defined for a_star; choose 8"):
        search(np.ones((3, 3), bool), "a_star", 5)


@pytest.mark.parametrize(("algorithm", "neighbours"), EXACT)
@pytest.mark.parametrize("seed", range(3))
def test_moves_through_free_cells_are_dijkstras_on_those_moves(algorithm, neighbours, seed):
    """`moves = "cells"`: a move is legal when the nodes of all cells that it crosses are free."""
    free = random_free(seed, (18, 24), 0.8)
    offsets = stencil(algorithm, neighbours)
    rows, columns = free.shape

    def legal(ix, iy):
        for dx, dy in offsets.tolist():
            cells = [(ix + x, iy + y) for x, y in cover(dx, dy)]
            if all(0 <= x < columns and 0 <= y < rows and free[y, x] for x, y in cells):
                yield dx, dy

    assert_same_length(search(free, algorithm, neighbours, moves="cells"), dijkstra_cm(free, legal))
