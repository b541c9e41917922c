"""A*, D* Lite and MPD* Lite against a plain Dijkstra after every change of random graphs, and on walks over grids."""

import math
import random

import numpy as np
import pytest

from lifelong_graphs import Doors, RandomGraph, Walk, dijkstra, path_cost
from planarm.search.ahead import SOON, begin_ahead, is_lost, new_ahead
from planarm.search.digraph import Bounds, digraph
from planarm.search.incremental import Changes, GraphPlanner
from planarm.search.lifelong import DONE, best_first, mark_stored, new_lifelong
from planarm.search.result import SearchStatus
from planarm.search.stored_tree import change_costs

ALGORITHMS = ("roadmap_a_star", "d_star_lite", "mpd_star_lite")


def test_all_equal_dijkstra_after_every_change_of_random_graphs(sized):
    """Edges raised, lowered and closed, nodes removed, the start moved along its path or anywhere."""
    answers = 0
    for seed in range(sized(40, 2000)):
        rng = random.Random(seed)
        made = RandomGraph(rng)
        graphs = [made.graph()]
        graphs += [graphs[0]._replace(cost=graphs[0].cost.copy()) for _ in range(3)]
        bounds, start = made.bounds(), rng.randrange(made.count)
        names = (*ALGORITHMS, "mpd_star_lite")
        planners = [
            GraphPlanner(graph, bounds, (start, made.goal), name, always_repair=k < 3)
            for k, (graph, name) in enumerate(zip(graphs, names, strict=True))
        ]
        found = [planner.solve() for planner in planners]
        for _ in range(8):
            wanted = dijkstra(graphs[0], made.goal).get(start, math.inf)
            for name, graph, answer in zip(names, graphs, found, strict=True):
                assert answer.cost == pytest.approx(wanted, rel=1e-9), (seed, name)
                if wanted == math.inf:
                    assert answer.status is SearchStatus.NO_PATH
                else:
                    assert (answer.nodes[0], answer.nodes[-1]) == (start, made.goal), (seed, name)
                    assert path_cost(graph, answer.nodes.tolist()) == pytest.approx(wanted, rel=1e-9), (seed, name)
            answers += 1
            if rng.random() < 0.6 and len(found[-1].nodes) > 1:
                start = int(found[-1].nodes[rng.randrange(len(found[-1].nodes))])
            elif rng.random() < 0.5:
                start = rng.randrange(made.count)
            edited = made.edit() if rng.random() < 0.7 else None  # or the start has moved, and nothing else
            for planner in planners:
                planner.move_start(start)
            if edited is not None and rng.random() < 0.5:
                found = [planner.replan(edited) for planner in planners]  # in one call
                continue
            for planner in planners:
                if edited is not None:
                    planner.change(edited)
            found = [planner.solve() for planner in planners]
    assert answers == sized(40, 2000) * 8


@pytest.mark.parametrize("algorithm", ["roadmap_a_star", "mpd_star_lite"])
def test_moves_that_cost_nothing_lead_nobody_round_and_round(algorithm, sized):
    """Small graphs, most of whose edges cost 0: whole loops of nodes are as far from the goal as each other."""
    for seed in range(sized(300, 3000)):
        rng = random.Random(seed)
        count = rng.randrange(3, 9)
        tail, head = ([rng.randrange(count) for _ in range(3 * count)] for _ in range(2))
        graph = digraph(count, tail, head, [float(rng.choice([0, 0, 1, 2])) for _ in tail])
        planner = GraphPlanner(graph, Bounds.none(count), (0, count - 1), algorithm)
        for _ in range(6):
            answer, wanted = planner.solve(), dijkstra(graph, count - 1).get(planner.start, math.inf)
            assert answer.cost == pytest.approx(wanted), seed
            assert (answer.status is SearchStatus.FOUND) == (wanted < math.inf), seed
            assert path_cost(graph, answer.nodes.tolist()) == (wanted if wanted < math.inf else 0.0), seed
            assert len(set(answer.nodes.tolist())) == len(answer.nodes), seed
            edges = np.array(rng.sample(range(len(tail)), 2))
            planner.change(Changes(edges, np.array([float(rng.choice([0, 1, 2, math.inf])) for _ in edges])))
            planner.move_start(rng.randrange(count))


@pytest.mark.parametrize("stores", [True, False])
def test_walks_need_the_key_modifier_that_the_paper_leaves_out(stores, sized):
    """Paper A's Table 3 has no k_m: the same walks, the same code, k_m put back to 0."""
    right = [Walk(seed).run(stores=stores, keep_modifier=True) for seed in range(sized(6, 200))]
    assert sum(wrong for _, wrong in right) == 0
    printed = [Walk(seed).run(stores=stores, keep_modifier=False) for seed in range(sized(30, 200))]
    assert sum(wrong for _, wrong in printed) > 0


def test_costs_are_asked_for_only_where_the_search_comes():
    rng = random.Random(3)
    size = 20
    walk = Walk(3, size)
    known = walk.graph.cost.copy()
    walk.graph.cost[:] = np.nan
    asked = []

    def costing(node):
        asked.append(node)
        for k in range(walk.graph.in_first[node], walk.graph.in_first[node + 1]):
            edge = walk.graph.in_edge[k]
            if np.isnan(walk.graph.cost[edge]):
                walk.graph.cost[edge] = known[edge]

    start, goal = 8 * size + 8, 8 * size + 12
    planner = GraphPlanner(walk.graph, walk.bounds, (start, goal), "mpd_star_lite", costing)
    assert planner.solve().cost == pytest.approx(4.0)
    assert 0 < len(set(asked)) < 60
    assert np.isnan(walk.graph.cost).any()
    for _ in range(10):
        edges = np.array(rng.sample(range(len(known)), 40))
        known[edges] = np.inf
        planner.change(Changes(edges, known[edges]))
        whole = walk.graph._replace(cost=known)
        assert planner.solve().cost == pytest.approx(dijkstra(whole, goal).get(start, math.inf))


def test_answers_are_searched_from_the_start_and_distances_are_settled_when_much_was_asked():
    size = 40
    walk = Walk(1, size, share=0.0)
    planner = GraphPlanner(walk.graph, Bounds.none(size * size), (0, size * size - 1), "mpd_star_lite")
    first = planner.solve()
    node = first.nodes[1]
    edges = np.flatnonzero((walk.graph.head == node) | (walk.graph.tail == node))
    planner.change(Changes(edges, np.full(len(edges), np.inf)))
    wanted, answers = dijkstra(walk.graph, size * size - 1)[0], [planner.solve() for _ in range(100)]
    assert [answer.cost for answer in answers] == pytest.approx([wanted] * 100)
    assert not any(answer.anew for answer in answers)
    for answer in (answers[0], answers[-1]):
        assert path_cost(walk.graph, answer.nodes.tolist()) == pytest.approx(wanted)
    expanded = [answer.work.expanded for answer in answers]
    assert expanded[0] < 0.01 * first.work.expanded
    assert sum(expanded) < 0.3 * first.work.expanded
    assert expanded[-1] == 0


def test_a_flood_tells_whether_there_is_a_way_and_a_search_after_it_which(sized):
    """Walls of random width across a grid: the start is walled in, or the way leads through a gap far away."""
    lost = 0
    for seed in range(sized(60, 600)):
        rng, size = random.Random(seed), 30
        walk = Walk(seed, size, share=rng.choice([0.0, 0.15, 0.3]))
        start, goal = rng.randrange(size) * size + rng.randrange(10), rng.randrange(size) * size + rng.randrange(20, 30)
        planner = GraphPlanner(walk.graph, Bounds.none(size * size), (start, goal), "mpd_star_lite")
        planner.solve()
        gap, column = rng.choice([-9, rng.randrange(size)]), rng.randrange(10, 19)
        walled = (np.arange(size * size) % size == column) & (np.abs(np.arange(size * size) // size - gap) > 1)
        edges = np.flatnonzero(walled[walk.tail] | walled[walk.head])
        answer = planner.replan(Changes(edges, np.full(len(edges), np.inf)))
        wanted = dijkstra(walk.graph, goal).get(start, math.inf)
        assert answer.cost == pytest.approx(wanted), seed
        lost += wanted == math.inf and answer.work.expanded == SOON
    assert lost > sized(10, 100)  # told by the flood


def test_what_is_closed_and_opened_between_answers_is_no_lost_way(sized):
    """Several changes between two answers, also while the planner is to begin anew: the flood must know all of them."""
    fresh = lost = 0
    for seed in range(sized(60, 1000)):
        doors, rng = Doors(seed), random.Random(seed)
        bounds = Bounds.none(doors.graph.nodes)
        planner = GraphPlanner(doors.graph, bounds, (doors.start, doors.goal), "mpd_star_lite")
        planner.solve()
        for _ in range(10):
            for _ in range(rng.randrange(4)):
                planner.change(doors.change())
                fresh += planner._fresh
            answer = planner.replan(doors.change())
            wanted = dijkstra(doors.graph, doors.goal).get(doors.start, math.inf)
            assert answer.cost == pytest.approx(wanted, rel=1e-9), seed
            assert (answer.status is SearchStatus.NO_PATH) == (wanted == math.inf), seed
            lost += wanted == math.inf and answer.work.expanded == SOON
    assert fresh > sized(60, 1000)
    assert lost > sized(10, 200)  # told by the flood


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_several_nodes_are_asked_after_changes_alone_and_all_at_once(algorithm, sized):
    """Costs that rose are not settled in between, some that fell are; edges become known late."""
    expanded = 0
    for seed in range(sized(12, 200)):
        doors, rng = Doors(seed), random.Random(seed)
        graph, known = doors.graph, doors.graph.cost.copy()
        graph.cost[:] = np.nan

        def fill(node, graph=graph, known=known):
            into = (graph.head == node) & np.isnan(graph.cost)
            graph.cost[into] = known[into]

        bounds = Bounds.none(graph.nodes)
        planner = GraphPlanner(graph, bounds, (doors.start, doors.goal), algorithm, fill)
        planner.solve()
        for _ in range(5):
            told = doors.change()
            known[told.edges] = told.costs
            planner.change(told)
            distances = dijkstra(graph._replace(cost=known), doors.goal)
            for _ in range(3):
                nodes = np.array(rng.sample(range(graph.nodes), rng.choice([1, 3, 8])))
                if rng.random() < 0.5:  # near each other
                    nodes = np.array([node for node in nodes[0] + np.arange(len(nodes)) if node < graph.nodes])
                steps = np.array([rng.choice([0.0, 0.5, 3.0]) for _ in nodes])
                answer = planner.solve_from(nodes, steps)
                costs = [step + distances.get(node, math.inf) for node, step in zip(nodes, steps, strict=True)]
                assert answer.cost == pytest.approx(min(costs), rel=1e-9), seed
                assert (len(answer.nodes) > 0) == (min(costs) < math.inf), seed
                if len(answer.nodes):
                    first = steps[nodes.tolist().index(answer.nodes[0])]
                    assert first + path_cost(graph, answer.nodes.tolist()) == pytest.approx(answer.cost, rel=1e-9), seed
                expanded += answer.work.expanded
                planner.move_start(int(nodes[-1]))
                alone = planner.solve()
                assert alone.cost == pytest.approx(distances.get(nodes[-1], math.inf), rel=1e-9), seed
                if len(alone.nodes):
                    assert path_cost(graph, alone.nodes.tolist()) == pytest.approx(alone.cost, rel=1e-9), seed
    assert expanded > 0


def test_a_flood_comes_to_a_whole_way_or_to_all_that_can_be_reached():
    for seed in range(200):
        rng = random.Random(seed)
        made = RandomGraph(rng)
        graph, start = made.graph(), rng.randrange(made.count)
        state, ahead = new_lifelong(graph, start, made.goal, stores=True), new_ahead(graph)
        assert best_first(graph, Bounds.none(made.count), state) == DONE
        mark_stored(state)
        edges = np.array(rng.sample(range(len(made.tail)), len(made.tail) // 3))
        closed = np.full(len(edges), np.inf)
        change_costs(graph, state, edges, closed, np.empty(made.count, np.int64), 0)
        begin_ahead(Bounds.none(made.count), state, ahead)
        told = is_lost(graph, state, ahead)
        shut = set(edges.tolist())
        ways = [
            (t, h) for e, (t, h) in enumerate(zip(made.tail.tolist(), made.head.tolist(), strict=True)) if e not in shut
        ]
        came, before = {start}, 0
        while len(came) > before:
            before = len(came)
            came |= {h for t, h in ways if t in came}
        assert told == (made.goal not in came), seed
        assert not told or ahead.counted[4] == len(came)


def test_next_to_the_goal_nearly_every_stored_way_is_cut_and_the_search_begins_anew():
    count = 400
    nodes = np.arange(count)
    tail = np.concatenate([nodes[1:], nodes[1:]])
    head = np.concatenate([nodes[:-1], np.append(nodes[2:], 0)])
    cost = np.ones(len(tail))
    cost[-1] = 10.0 * count  # the long way round
    graph = digraph(count, tail, head, cost)
    planner = GraphPlanner(graph, Bounds.none(count), (count // 2, 0), "mpd_star_lite")
    assert planner.solve().cost == count // 2
    planner.change(Changes(np.array([0]), np.array([np.inf])))
    answer = planner.solve()
    assert answer.anew
    assert answer.cost == pytest.approx(10.0 * count + count // 2 - 1)


def test_where_old_distances_mislead_the_search_from_the_start_gives_up():
    """The goal's only door but a far one is closed, so everything looks near by its old distance."""
    size = 40
    walk = Walk(1, size, share=0.0)
    wall = walk.tail % size < 20  # from there into the other half there are two doors
    door = (walk.tail // size == 0) & (walk.head // size == 0)
    across = wall & (walk.head % size >= 20)
    far = (walk.tail // size == size - 1) & (walk.head // size == size - 1)
    walk.graph.cost[across & ~door & ~far] = np.inf
    planner = GraphPlanner(walk.graph, Bounds.none(size * size), (0, size - 1), "mpd_star_lite")
    assert planner.solve().cost == size - 1
    closed = np.flatnonzero(across & door)
    planner.change(Changes(closed, np.full(len(closed), np.inf)))
    answer = planner.solve()
    assert answer.cost == pytest.approx(dijkstra(walk.graph, size - 1)[0])
    assert answer.work.expanded > 0.04 * size * size  # more than a search from the start may


def test_several_rises_before_anybody_asks_and_a_fall_after_them(sized):
    """Whatever was told in between, answers are right: rises wait to be settled, a fall settles them."""
    for seed in range(sized(60, 1000)):
        rng = random.Random(seed)
        made = RandomGraph(rng)
        graph, start = made.graph(), rng.randrange(made.count)
        planner = GraphPlanner(graph, made.bounds(), (start, made.goal), "mpd_star_lite")
        planner.solve()
        for _ in range(12):
            edges = np.array(rng.sample(range(len(made.tail)), rng.randrange(1, 4)))
            if rng.random() < 0.8:
                planner.change(Changes(edges, graph.cost[edges] * rng.choice([1.5, 3.0, math.inf])))
            elif rng.random() < 0.3:
                planner.change(Changes(edges, made.floor[edges].astype(np.float64)))
            if rng.random() < 0.4:
                start = rng.randrange(made.count)
                planner.move_start(start)
            for k in range(rng.choice([0, 1, 1, 2])):
                told = np.array(rng.sample(range(len(made.tail)), 2))
                rises = Changes(told, graph.cost[told] * rng.choice([1.0, 2.0, math.inf]))
                answer = planner.replan(rises) if k == 0 and rng.random() < 0.4 else planner.solve()
                wanted = dijkstra(graph, made.goal).get(start, math.inf)
                assert answer.cost == pytest.approx(wanted, rel=1e-9), seed
                if wanted < math.inf:
                    assert path_cost(graph, answer.nodes.tolist()) == pytest.approx(wanted, rel=1e-9), seed


def test_an_unreachable_start_has_no_path_and_no_cost():
    for algorithm in ALGORITHMS:
        graph = digraph(3, [0, 1], [1, 2], [1.0, np.inf])
        planner = GraphPlanner(graph, Bounds.none(3), (0, 2), algorithm)
        answer = planner.solve()
        assert (answer.status, answer.cost, len(answer.nodes)) == (SearchStatus.NO_PATH, math.inf, 0)
        planner.change(Changes(np.array([1]), np.array([2.0])))
        assert planner.solve().cost == 3.0


@pytest.mark.parametrize(
    ("tail", "head", "cost", "words"),
    [([0], [3], [1.0], "name nodes 0 to 3"), ([0], [1], [-1.0], "at least 0"), ([0], [1], [], "have the shapes")],
)
def test_what_is_no_graph_is_refused(tail, head, cost, words):
    with pytest.raises(ValueError, match=words):
        digraph(3, tail, head, cost)


def test_d_star_lite_refuses_moves_that_cost_nothing():
    graph = digraph(3, [0, 1], [1, 2], [1.0, 1.0])
    planner = GraphPlanner(graph, Bounds.none(3), (0, 2), "d_star_lite")
    assert planner.solve().cost == 2.0
    with pytest.raises(ValueError, match=r"edge 1 costs 0\.0; D\* Lite needs costs above 0"):
        planner.change(Changes(np.array([1]), np.zeros(1)))
    graph.cost[0] = 0.0
    with pytest.raises(ValueError, match=r"edge 0 costs 0\.0"):
        GraphPlanner(graph, Bounds.none(3), (0, 2), "d_star_lite")
