"""The cheapest path by joint travel and by time: SciPy's Dijkstra on the same moves as the oracle."""

from itertools import pairwise
from math import hypot, pi

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from host_scenes import make_scene
from planarm.errors import SceneError
from planarm.model.arm import Arm
from planarm.model.kinematics import inverse_2r
from planarm.scene import Obstacle, parse_scene
from planarm.search.costed import JOINT_TRAVEL, SHARE_OF_OTHER, time_price
from planarm.search.grid_search import find_path
from planarm.search.stencils import stencil
from planarm.warm_up import SMALL_SCENE
from planarm.workspace.free_map import build_free_map
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import PROVED
from planarm.workspace.world import FREE
from search_maps import planner

SPEEDS = (1.0, 2.5)
SCENE = make_scene([Obstacle("circle", (30.0, 22.0), 9.0), Obstacle("square", (-8.0, 38.0), 6.0)], cell=2.0)
MAP = build_free_map(SCENE)
START_CM, GOAL_CM = (46.0, 4.0), (-30.0, 26.0)


def travel_rad(d1, d2):
    return hypot(d1, d2)


def time_s(d1, d2):
    return max(abs(d1) / SPEEDS[0], abs(d2) / SPEEDS[1]) + SHARE_OF_OTHER * hypot(d1, d2)


def pose(x, y):
    """Angles, theta1 within its limits' turn from -90 degrees."""
    q1, q2 = inverse_2r(Arm.from_spec(SCENE.arm), (x, y), "up")
    return (q1 + 0.5 * pi) % (2.0 * pi) - 0.5 * pi, q2


def oracle(offsets, moves, cost):
    free = MAP.region == FREE
    columns = free.shape[1]
    poses = {(iy, ix): pose(MAP.x_cm[ix], MAP.y_cm[iy]) for iy, ix in np.argwhere(free).tolist()}
    edges = []
    for (iy, ix), (q1, q2) in poses.items():
        for dx, dy in offsets.tolist():
            other = poses.get((iy + dy, ix + dx))
            if other is None:
                continue
            ends = sorted([(iy, ix), (iy + dy, ix + dx)])
            line = [value for y, x in ends for value in (MAP.x_cm[x], MAP.y_cm[y])]
            if moves == "nodes" or prove_line(MAP.world, *line)[0] == PROVED:
                edges.append((iy * columns + ix, (iy + dy) * columns + ix + dx, cost(other[0] - q1, other[1] - q2)))
    tails, heads, costs = zip(*edges, strict=True)
    graph = csr_matrix((costs, (tails, heads)), shape=(free.size, free.size))
    start, goal = (
        round((y - MAP.y_cm[0]) / MAP.cell_cm) * columns + round((x - MAP.x_cm[0]) / MAP.cell_cm)
        for x, y in (START_CM, GOAL_CM)
    )
    return dijkstra(graph, indices=start)[goal]


@pytest.mark.parametrize(("price", "cost"), [(JOINT_TRAVEL, travel_rad), (time_price(SPEEDS), time_s)])
@pytest.mark.parametrize(("algorithm", "neighbours", "moves"), [("a_star", 8, "nodes"), ("chs", 28, "proved")])
def test_the_cheapest_path_is_dijkstra_s(price, cost, algorithm, neighbours, moves):
    result = find_path(MAP, START_CM, GOAL_CM, planner(algorithm, neighbours, moves=moves), price)
    assert result.path is not None
    assert result.cost == pytest.approx(oracle(stencil(algorithm, neighbours), moves, cost), rel=1e-9)
    poses = np.array([pose(x, y) for x, y in result.path.points_cm.tolist()])
    assert result.cost == pytest.approx(sum(cost(*step) for step in np.diff(poses, axis=0).tolist()), rel=1e-9)


def joint_travel_rad(points_cm):
    """What the joints turn while the tip follows the straight legs, looked at every half millimetre."""
    tips = [points_cm[:1]]
    for a, b in pairwise(points_cm):
        tips.append(a + np.linspace(0.0, 1.0, 2 + int(np.hypot(*(b - a)) / 0.05))[1:, None] * (b - a))
    poses = np.array([pose(x, y) for x, y in np.concatenate(tips).tolist()])
    return float(np.hypot(*np.diff(poses, axis=0).T).sum())


def test_by_joint_travel_the_joints_turn_less_and_the_tip_goes_farther():
    spec = planner("taut", 56, moves="proved")
    short, cheap = (find_path(MAP, START_CM, GOAL_CM, spec, price) for price in (None, JOINT_TRAVEL))
    turned = [joint_travel_rad(result.path.points_cm) for result in (short, cheap)]
    assert cheap.cost == pytest.approx(turned[1], rel=0.01)
    assert turned[1] < 0.95 * turned[0] and cheap.path.length_cm > short.path.length_cm
    assert cheap.bound_cm <= short.path.length_cm


def test_algorithms_that_cannot_say_so():
    with pytest.raises(SceneError, match="a_star"):
        parse_scene(SMALL_SCENE + '[planner]\nalgorithm = "theta_star"\nobjective = "joint_travel"\n', "a.toml")
