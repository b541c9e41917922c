"""Graphs that change, walks over grids, and a plain Dijkstra: what the incremental planners are held against."""

import heapq
import math
import random
from itertools import pairwise

import numpy as np

from planarm.search.digraph import Bounds, digraph
from planarm.search.incremental import Changes, landmarks
from planarm.search.lifelong import change, new_lifelong, repair
from planarm.search.read_off import gradient_path, stored_path
from planarm.search.stored_tree import change_stored


def dijkstra(graph, goal):
    """Every node's distance to the goal."""
    into = {}
    for tail, head, cost in zip(graph.tail.tolist(), graph.head.tolist(), graph.cost.tolist(), strict=True):
        into.setdefault(head, []).append((tail, cost))
    distance, waiting = {}, [(0.0, goal)]
    while waiting:
        value, node = heapq.heappop(waiting)
        if node not in distance:
            distance[node] = value
            for tail, cost in into.get(node, ()):
                if cost < math.inf:
                    heapq.heappush(waiting, (value + cost, tail))
    return distance


def path_cost(graph, nodes):
    """What a path costs; the cheapest of parallel edges."""
    total = 0.0
    for a, b in pairwise(nodes):
        total += min(graph.cost[e] for e in range(len(graph.cost)) if graph.tail[e] == a and graph.head[e] == b)
    return total


class RandomGraph:
    """A random directed graph, costs never below a floor, so that landmarks of the floor stay valid."""

    def __init__(self, rng, *, parallel=True):
        self.rng = rng
        self.count = rng.randrange(4, 40)
        wanted = self.count * rng.choice([2, 3, 5])
        ends = [(rng.randrange(self.count), rng.randrange(self.count)) for _ in range(wanted)]
        if not parallel:
            ends = sorted(set(ends))
        self.tail, self.head = np.array(ends).T
        self.floor = np.array([float(rng.choice([0.5, 1, 1, 2, 3.7, 8])) for _ in ends])
        self.goal = rng.randrange(self.count)

    def cost(self, edge):
        rng = self.rng
        return math.inf if rng.random() < 0.15 else float(self.floor[edge]) * rng.choice([1.0, 1.0, 1.5, 3.0])

    def graph(self):
        return digraph(self.count, self.tail, self.head, [self.cost(e) for e in range(len(self.tail))])

    def edit(self):
        """Edges raised and lowered, or a node removed."""
        rng = self.rng
        if rng.random() < 0.25:
            node = rng.randrange(self.count)
            edges = np.flatnonzero((self.tail == node) | (self.head == node))
            return Changes(edges, np.full(len(edges), np.inf))
        edges = np.array(rng.sample(range(len(self.tail)), rng.randrange(1, 5)))
        return Changes(edges, np.array([self.cost(e) for e in edges]))

    def bounds(self):
        if self.rng.random() < 0.3:
            return Bounds.none(self.count)
        base = digraph(self.count, self.tail, self.head, self.floor)
        return Bounds(landmarks(base, np.array([0, self.count - 1])), np.empty((self.count, 0)))


class Walk:
    """A robot on a grid that sees only its eight neighbours' cells, and learns of obstacles on its way."""

    def __init__(self, seed, size=16, share=0.3):
        rng = random.Random(seed)
        self.size = size
        self.blocked = np.array([rng.random() < share for _ in range(size * size)])
        self.blocked[[0, size * size - 1]] = False
        cells = [(x, y) for y in range(size) for x in range(size)]
        ends = [
            (y * size + x, (y + j) * size + x + i)
            for x, y in cells
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
            if (i or j) and 0 <= x + i < size and 0 <= y + j < size
        ]
        self.tail, self.head = np.array(ends).T
        length = np.hypot(self.tail % size - self.head % size, self.tail // size - self.head // size)
        self.graph = digraph(size * size, self.tail, self.head, length)
        self.bounds = Bounds(np.empty((0, size * size)), np.array(cells, np.float64))

    def seen(self, node):
        x, y = node % self.size, node // self.size
        near = (abs(self.head % self.size - x) <= 1) & (abs(self.head // self.size - y) <= 1)
        return np.flatnonzero(near & self.blocked[self.head] & (self.graph.cost < np.inf))

    def run(self, *, stores, keep_modifier):
        """Walk until the goal is reached or known to be out of reach; return replans and wrong distances."""
        goal = self.size**2 - 1
        state = new_lifelong(self.graph, 0, goal, stores=stores)
        at, replans, wrong = 0, 0, 0
        for _ in range(6 * self.size**2):
            if at == goal:
                break
            edges = self.seen(at)
            state.ends[0] = at
            raised = edges, np.full(len(edges), np.inf)
            if stores:
                change_stored(self.graph, self.bounds, state, raised, self.size**2, np.empty(self.size**2, np.int64))
            else:
                change(self.graph, self.bounds, state, *raised)
            if not keep_modifier:
                state.key_modifier[0] = 0.0
            repair(self.graph, self.bounds, state)
            replans += 1
            wanted = dijkstra(self.graph, goal).get(at, math.inf)
            wrong += not math.isclose(min(state.rhs[at], 1e9), min(wanted, 1e9), rel_tol=1e-9)
            path, _ = stored_path(state) if stores else gradient_path(self.graph, state)
            if len(path) < 2:
                break
            at = int(path[1])
        return replans, wrong


class Doors:
    """A grid of some hundred nodes; whole columns are closed and opened, so that the way is lost and found again."""

    def __init__(self, seed):
        self.rng, self.size = random.Random(seed), random.Random(seed).randrange(14, 22)
        walk = Walk(seed, self.size, share=0.0)
        self.tail, self.head, self.floor = walk.tail, walk.head, walk.graph.cost.copy()
        self.graph = walk.graph
        self.start = self.rng.randrange(self.size) * self.size + self.rng.randrange(4)
        self.goal = self.rng.randrange(self.size) * self.size + self.rng.randrange(self.size - 4, self.size)

    def edges_at(self, nodes):
        return np.flatnonzero(np.isin(self.tail, nodes) | np.isin(self.head, nodes))

    def column(self, gaps):
        """Edges at a column but for some of its nodes."""
        column = self.rng.randrange(5, self.size - 5)
        rows = [row for row in range(self.size) if row not in gaps]
        return self.edges_at(np.array(rows) * self.size + column)

    def change(self):
        """A wall appears, with a gap or without; part of what is closed opens; or most ways are cut near the goal."""
        rng, cost = self.rng, self.graph.cost
        closed, kind = np.flatnonzero(cost == np.inf), rng.random()
        if len(closed) and kind < 0.45:
            part = closed if rng.random() < 0.5 else np.array(rng.sample(closed.tolist(), 1 + len(closed) // 2))
            return Changes(part, self.floor[part])
        if kind < 0.75:
            edges = self.column(set(rng.sample(range(self.size), rng.randrange(3))))
            return Changes(edges, np.full(len(edges), np.inf))
        edges = self.edges_at(np.array([self.goal]))
        return Changes(edges, self.floor[edges] * rng.choice([1.0, 1.5, 3.0]))
