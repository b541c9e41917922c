"""Planning on a graph that changes while the start moves: A*, D* Lite and MPD* Lite behind one contract.

`solve` gives the best path for what is known; `change` tells new costs, `move_start` where the start is now; the next
`solve` goes on from there. Costs that are not known are asked for, node by node, and kept.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from planarm.search.ahead import BEGIN, GAVE_UP, answer_ahead, new_ahead
from planarm.search.at_once import FELL, UNCUT, plan_anew, replan_ahead
from planarm.search.digraph import Bounds, Digraph, Floats, Ints
from planarm.search.lifelong import (
    COUNTERS,
    DONE,
    EXPANDED,
    GOAL,
    LOOKED,
    RESCANNED,
    START,
    UPDATED,
    best_first,
    change,
    mark_stored,
    new_lifelong,
    repair,
    start_over,
)
from planarm.search.read_off import gradient_path, stored_path
from planarm.search.result import SearchStatus
from planarm.search.stored_tree import TOO_MANY, change_costs, cut_off

GraphAlgorithm = Literal["mpd_star_lite", "d_star_lite", "roadmap_a_star"]

Costing = Callable[[int], None]
"""Told a node; fills in the costs of all edges into it that are not known."""

REPAIR_SHARE = 0.7
"""A change is repaired when it cuts off fewer nodes than this share of what a search anew expanded last.

A node that is cut off is found, compares its successors and is expanded again, for about the price of one and a half
expansions of A*; and a way that has become longer takes nodes that no way led through before."""

AHEAD_SHARE = 0.04
LEAST_AHEAD = 50
"""Share of all nodes, and their number, that a search from the start may expand before it gives up."""


NO_EDGES = np.empty(0, np.int64)

NOWHERE = -1
"""A start that is never reached, so that all distances are found."""


class Changes(NamedTuple):
    """New costs of edges, both of shape (k,)."""

    edges: Ints
    costs: Floats


class Work(NamedTuple):
    """What one `solve` did."""

    expanded: int
    updated: int
    looked: int
    """Edges looked at while searching."""
    rescanned: int
    """Nodes all of whose successors were compared."""
    read_off: int
    """Edges (D* Lite) or nodes (MPD* Lite, A*) looked at to tell the path."""


@dataclass(frozen=True, slots=True, eq=False)
class GraphAnswer:
    """The answer of one `solve`."""

    status: SearchStatus
    nodes: Ints
    """From start to goal; empty when there is no path."""
    cost: float
    work: Work
    anew: bool
    """True when the search began from nothing."""


class GraphPlanner:
    """One of the three algorithms on a graph; the state that it keeps between two calls."""

    def __init__(
        self,
        graph: Digraph,
        bounds: Bounds,
        ends: tuple[int, int],
        algorithm: GraphAlgorithm,
        costing: Costing | None = None,
        *,
        always_repair: bool = False,
    ) -> None:
        """Prepare; nothing is searched yet.

        Args:
            graph: its costs are changed by `change` and by `costing` only.
            bounds: lower bounds of distances, consistent whatever the costs become.
            ends: start and goal.
            algorithm: A* searches anew each time.
            costing: needed when costs are not known.
            always_repair: MPD* Lite then never starts anew, even where that is cheaper.

        Raises:
            ValueError: the algorithm is D* Lite, and an edge costs nothing; `change` raises it, too.
        """
        if algorithm == "d_star_lite":
            _require_positive(np.arange(len(graph.cost)), graph.cost)
        self._graph, self._bounds, self._algorithm, self._costing = graph, bounds, algorithm, costing
        self._always_repair = always_repair
        self._last_anew = 0
        self._fresh = True
        self._branch = np.zeros(graph.nodes, np.int64)
        self._roots = 0
        self._fell = False
        self._spent = 0
        self._ahead = new_ahead(graph)
        self._path = np.zeros(graph.nodes, np.int64)
        self._state = new_lifelong(graph, *ends, stores=algorithm != "d_star_lite")
        self._most_ahead = max(LEAST_AHEAD, int(AHEAD_SHARE * graph.nodes))

    @property
    def start(self) -> int:
        """The node at which paths begin."""
        return int(self._state.ends[START])

    def solve(self) -> GraphAnswer:
        """Return the best path from the start as it is now."""
        if self._algorithm == "roadmap_a_star":
            self._start_over()
        if self._roots and self._spent < self._most_ahead and (answer := self._go_on_ahead(BEGIN)) is not None:
            return answer
        self._settle()
        anew, before = self._fresh, self._state.counted.copy()
        # A first plan has nothing to repair; D* Lite is left as it is published.
        search = best_first if self._fresh and self._state.stores else repair
        while (needing := search(self._graph, self._bounds, self._state)) != DONE:
            self._ask_for(needing)
        self._fresh = False
        self._ahead.limit[0], self._ahead.limit_start[0] = self._state.rhs[self.start], self.start
        counted = self._state.counted - before
        if anew and self._algorithm == "mpd_star_lite":
            mark_stored(self._state)
            self._last_anew = int(counted[EXPANDED])
        return self._answer(counted, anew)

    def change(self, changes: Changes) -> None:
        """Tell new costs of edges, known ones; MPD* Lite starts anew where that is cheaper than a repair."""
        edges, costs = changes
        if not self._state.stores:
            _require_positive(edges, costs)
            change(self._graph, self._bounds, self._state, edges, costs)
        elif self._algorithm == "roadmap_a_star":
            self._graph.cost[edges] = costs
        elif self._fresh:  # no way is stored that could be cut; which edges are closed is kept for the flood
            change_costs(self._graph, self._state, edges, costs, self._branch, 0)
        else:
            self._roots, falls = change_costs(self._graph, self._state, edges, costs, self._branch, self._roots)
            self._spent = 0
            self._fell = self._fell or falls
            if self._fell or self._always_repair:  # old distances are no bounds any more, or nobody wants them
                self._settle(edges if falls else edges[:0])

    def replan(self, changes: Changes) -> GraphAnswer:
        """Do what `change` and `solve` do, in one call of a kernel where that can be."""
        graph, bounds, state, path = self._graph, self._bounds, self._state, self._path
        edges, costs = changes
        if self._algorithm == "roadmap_a_star":
            before = int(state.counted[EXPANDED]), int(state.counted[LOOKED])
            needing, count, cost = plan_anew(graph, bounds, state, edges, costs, path)
            if needing != DONE:
                return self.solve()
            expanded, looked = int(state.counted[EXPANDED]) - before[0], int(state.counted[LOOKED]) - before[1]
            return self._told(count, cost, Work(expanded, 0, looked, 0, count), anew=True)
        if not state.stores or self._fresh or self._fell or self._always_repair:
            self.change(changes)
            return self.solve()
        outcome, count, cost, self._roots = replan_ahead(
            graph, bounds, state, self._ahead, edges, costs, self._branch, self._roots, self._most_ahead, path
        )
        self._spent = 0
        if outcome == DONE:
            return self._told_ahead(count, cost)
        if outcome == FELL:
            self._fell = True
            self._settle(edges)
        elif outcome != UNCUT and (answer := self._go_on_ahead(outcome)) is not None:
            return answer
        return self.solve()

    def solve_from(self, nodes: Ints, steps: Floats) -> GraphAnswer:
        """Return the best of the ways that begin at some nodes; its cost is that of the step to the first one, too.

        MPD* Lite asks one search for all of them where it can; else each node is asked.

        Args:
            nodes: shape (k,), k at least 1, each once.
            steps: what it costs to come to each, shape (k,), at least 0.
        """
        if (together := self._solve_together(nodes, steps)) is not None:
            return together
        best: GraphAnswer | None = None
        for node, step in zip(nodes.tolist(), steps.tolist(), strict=True):
            self.move_start(node)
            answer = self.solve()
            answer = replace(answer, cost=answer.cost + step)
            best = answer if best is None or answer.cost < best.cost else best
        assert best is not None, "there is a node"
        return best

    def _solve_together(self, nodes: Ints, steps: Floats) -> GraphAnswer | None:
        """Return what `solve_from` does, by one search; None where old distances are no bounds, or much was asked."""
        repairs = self._state.stores and self._algorithm != "roadmap_a_star" and not self._always_repair
        if not repairs or self._fresh or self._fell or self._spent >= self._most_ahead:
            return None
        ahead, count = self._ahead, len(nodes)
        ahead.starts[:count], ahead.steps[:count], ahead.many[0] = nodes, steps, count
        try:
            return self._go_on_ahead(BEGIN)
        finally:
            ahead.many[0] = 0

    def _settle(self, fallen: Ints = NO_EDGES) -> None:
        """Make the state ready for a repair, after all changes that were told; or begin anew where that is cheaper."""
        if not self._roots and not len(fallen):
            return
        most = self._graph.nodes if self._always_repair else int(REPAIR_SHARE * self._last_anew)
        count = cut_off(self._graph, self._bounds, self._state, fallen, most, self._branch, self._roots)
        self._roots = 0
        if count == TOO_MANY:
            self._start_over()

    def _go_on_ahead(self, needing: int) -> GraphAnswer | None:
        """Return the best path by a search from the start; None where that is too much work.

        It goes on from what `answer_ahead` returned last, or from BEGIN. Distances are settled later.
        """
        most = self._most_ahead - self._spent
        while needing != GAVE_UP:
            if needing >= 0:
                self._ask_for(needing)
            needing, count, cost = answer_ahead(
                self._graph, self._bounds, self._state, self._ahead, most, needing, self._path
            )
            if needing == DONE:
                return self._told_ahead(count, cost)
        self._spent = self._most_ahead
        return None

    def _told_ahead(self, count: int, cost: float) -> GraphAnswer:
        expanded, updated, looked, _ = self._ahead.counted[1:].tolist()
        self._spent += expanded
        return self._told(count, cost, Work(expanded, updated, looked, 0, count), anew=False)

    def _told(self, count: int, cost: float, work: Work, *, anew: bool) -> GraphAnswer:
        """Return the answer whose path, of so many nodes, a kernel has filled in."""
        status = SearchStatus.FOUND if count else SearchStatus.NO_PATH
        return GraphAnswer(status, self._path[:count].copy(), cost, work, anew)

    def _ask_for(self, node: int) -> None:
        if self._costing is None:
            raise ValueError(f"the cost of an edge into node {node} is not known, and nothing tells it")
        self._costing(node)

    def move_start(self, node: int) -> None:
        """Tell that paths begin at another node from now on."""
        self._state.ends[START] = node

    def _start_over(self) -> None:
        start_over(self._state)
        self._fresh, self._fell, self._roots = True, False, 0

    def _answer(self, counted: Ints, anew: bool) -> GraphAnswer:
        assert len(counted) == COUNTERS
        cost = float(self._state.rhs[self.start])
        if cost == np.inf:
            nodes, read_off = np.empty(0, np.int64), 0
        elif self._state.stores:
            nodes, read_off = stored_path(self._state)
        else:
            nodes, read_off = gradient_path(self._graph, self._state)
        assert not len(nodes) or nodes[-1] == self._state.ends[GOAL], "every node on the way stores a successor"
        expanded, updated, looked, rescanned = (int(counted[k]) for k in (EXPANDED, UPDATED, LOOKED, RESCANNED))
        status = SearchStatus.FOUND if len(nodes) else SearchStatus.NO_PATH
        return GraphAnswer(status, nodes, cost, Work(expanded, updated, looked, rescanned, read_off), anew)


def _require_positive(edges: Ints, costs: Floats) -> None:
    """D* Lite takes two nodes for near that are only near each other, where going to and fro costs nothing."""
    if (costs <= 0.0).any():
        raise ValueError(
            f"edge {edges[costs <= 0.0][0]} costs {costs[costs <= 0.0][0]}; D* Lite needs costs above 0; "
            "mpd_star_lite and roadmap_a_star take moves that cost nothing"
        )


def landmarks(graph: Digraph, nodes: Ints) -> Floats:
    """Return potentials from and to each of the nodes given, shape (2 k, n), for `Bounds`; all costs must be known.

    The distance from s to u is at least d(L, u) - d(L, s) and d(s, L) - d(u, L); a node that is not reached keeps the
    largest distance that is, which leaves the bound consistent. They hold while no cost falls below what it is now.
    """
    tables = []
    for node in nodes:
        for forwards in (True, False):
            away = _all_distances(graph, int(node), forwards)
            away[~np.isfinite(away)] = np.nanmax(np.where(np.isfinite(away), away, 0.0))
            tables.append(away if forwards else -away)
    return np.array(tables).reshape(-1, graph.nodes)


def _all_distances(graph: Digraph, node: int, forwards: bool) -> Floats:
    """Return every node's distance from a node, or to it, shape (n,); infinite where there is no way."""
    state = new_lifelong(graph, NOWHERE, node, stores=True)
    if best_first(graph.turned() if forwards else graph, Bounds.none(graph.nodes), state) != DONE:
        raise ValueError("landmarks need the costs of all edges")
    return state.g
