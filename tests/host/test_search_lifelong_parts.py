"""What the incremental planners are made of: the tree of stored ways, the bounds, the heap."""

import math
import random

import numpy as np
import pytest

from lifelong_graphs import RandomGraph, dijkstra, path_cost
from planarm.search.digraph import BELOW_ONE, Bounds, bound, digraph
from planarm.search.incremental import landmarks
from planarm.search.indexed_heap import new_heap, put, take_out
from planarm.search.lifelong import DONE, best_first, mark_stored, new_lifelong, repair
from planarm.search.read_off import gradient_path, stored_path
from planarm.search.stored_tree import TOO_MANY, change_stored


@pytest.mark.parametrize("seed", range(20))
def test_the_stored_path_is_the_one_that_the_gradient_gives(seed):
    """And is read off with one look a node, where the gradient takes one for each of their successors."""
    rng = random.Random(seed)
    made = RandomGraph(rng, parallel=False)
    graph, start = made.graph(), rng.randrange(made.count)
    state = new_lifelong(graph, start, made.goal, stores=True)
    bounds = made.bounds()
    for _ in range(6):
        assert repair(graph, bounds, state) == DONE
        if state.rhs[start] < math.inf:
            stored, looks = stored_path(state)
            steep, edges = gradient_path(graph, state)
            assert path_cost(graph, stored.tolist()) == pytest.approx(path_cost(graph, steep.tolist()), rel=1e-12)
            assert looks == len(stored)
            assert edges == sum(graph.out_first[u + 1] - graph.out_first[u] for u in steep[:-1])
        change_stored(graph, bounds, state, made.edit()[:], made.count, np.empty(made.count, np.int64))


def behind(state, goal, cut_edges):
    """Nodes whose stored ways lead over one of these edges, by following each."""
    found = set()
    for node in np.flatnonzero(state.best >= 0).tolist():
        at = node
        while at != goal:
            successor = int(state.best[at])
            if (at, successor) in cut_edges:
                found.add(node)
                break
            at = successor
    return found


@pytest.mark.parametrize("seed", range(30))
def test_what_rises_cuts_off_the_branch_behind_it_and_nothing_else(seed):
    rng = random.Random(seed)
    made = RandomGraph(rng, parallel=False)
    graph, bounds, start = made.graph(), made.bounds(), rng.randrange(made.count)
    state, room = new_lifelong(graph, start, made.goal, stores=True), np.empty(made.count, np.int64)
    assert best_first(graph, bounds, state) == DONE
    mark_stored(state)
    for _ in range(6):
        before, edited = state.g.copy(), made.edit()
        rises = edited.costs > graph.cost[edited.edges]
        ends = {(int(graph.tail[e]), int(graph.head[e])) for e in edited.edges[rises]}
        cut = behind(state, made.goal, ends)
        assert change_stored(graph, bounds, state, edited[:], made.count, room) == len(cut)
        assert set(room[: len(cut)].tolist()) == cut
        kept = [node for node in range(made.count) if node not in cut]
        assert (state.g[kept] == before[kept]).all()
        assert not np.isfinite(state.g[list(cut)]).any()
        for node in cut:  # the best of the successors that are left
            ways = [graph.cost[e] + state.g[graph.head[e]] for e in range(len(graph.cost)) if graph.tail[e] == node]
            assert state.rhs[node] == min(ways, default=np.inf)
        assert repair(graph, bounds, state) == DONE
        wanted = dijkstra(graph, made.goal)
        assert state.rhs[start] == pytest.approx(wanted.get(start, math.inf), rel=1e-9)


def test_a_branch_that_is_too_large_is_left_and_told():
    graph = digraph(5, [1, 2, 3, 4], [0, 1, 2, 3], [1.0, 1.0, 1.0, 1.0])
    room = np.empty(5, np.int64)
    for most, wanted in ((4, 4), (3, TOO_MANY), (0, TOO_MANY)):
        graph.cost[:] = 1.0
        state = new_lifelong(graph, 4, 0, stores=True)
        assert best_first(graph, Bounds.none(5), state) == DONE
        mark_stored(state)
        changed = (np.array([0]), np.array([2.0]))
        assert change_stored(graph, Bounds.none(5), state, changed, most, room) == wanted
        assert graph.cost[0] == 2.0  # told in either case


def test_bounds_never_exceed_distances_and_fall_short_of_them_by_no_edge_s_worth():
    rng = random.Random(9)
    for _ in range(30):
        made = RandomGraph(rng)
        graph, bounds = made.graph(), made.bounds()
        for node in range(made.count):
            distance = dijkstra(graph, node)
            for start in range(made.count):
                assert bound(bounds, start, node) <= distance.get(start, math.inf)
        landmark = Bounds(landmarks(graph, np.array([made.goal])), np.empty((made.count, 0)))
        for start, value in dijkstra(graph, made.goal).items():
            assert bound(landmark, start, made.goal) == pytest.approx(BELOW_ONE * value)


def test_the_heap_is_a_sorted_list():
    rng = random.Random(4)
    heap, plain = new_heap(50), {}
    for _ in range(3000):
        node = rng.randrange(50)
        if rng.random() < 0.3:
            take_out(heap, node)
            plain.pop(node, None)
        else:
            key = (float(rng.randrange(8)), float(rng.randrange(8)))
            put(heap, node, *key)
            plain[node] = key
        assert heap.size[0] == len(plain)
        if plain:
            top = int(heap.nodes[0])
            assert plain[top] == min(plain.values())
        assert {int(n) for n in heap.nodes[: heap.size[0]]} == set(plain)
