"""Where a search begins and ends: nodes, points between nodes, and points that cannot be taken."""

import numpy as np
import pytest

from host_scenes import FULL_TURN, make_scene
from planarm.scene import Obstacle
from planarm.search.endpoints import JOIN_CELLS, endpoint
from planarm.search.grid_search import find_path
from planarm.search.result import SearchStatus
from planarm.workspace.free_map import build_free_map
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import PROVED
from planarm.workspace.world import FREE
from search_maps import planner, table1_scene

LIMITS1 = (np.radians(-70.0), np.radians(170.0))
OPEN = make_scene([Obstacle("circle", (30.0, 30.0), 10.0)], floor=True)
CHS = planner("chs", 56, moves="proved")


@pytest.fixture(scope="module")
def open_map():
    return build_free_map(OPEN)


@pytest.mark.parametrize(
    ("point_cm", "words"),
    [
        ((49.0, 20.0), "is beyond the arm's reach"),
        ((49.03, 20.04), "is beyond the arm's reach"),
        ((3.0, 2.0), "is nearer to the base than the links and the limits of joint 2 allow"),
        ((3.1, 2.2), "is nearer to the base than the links and the limits of joint 2 allow"),
        ((27.0, 27.0), "brings a link's centre line to within 0.4 cm of an obstacle"),
        ((27.13, 26.9), "brings a link's centre line to within 0.4 cm of an obstacle"),
        ((30.0, -10.0), "needs a joint beyond arm.joint_limits_deg or a link below the floor"),
        ((30.2, -10.1), "brings a link's centre line to within 0.4 cm of an obstacle"),
    ],
)
def test_a_blocked_start_or_goal_is_an_answer_that_says_why(open_map, point_cm, words):
    here = f"({point_cm[0]:g}, {point_cm[1]:g}) cm"
    start = find_path(open_map, point_cm, (0.0, 30.0), CHS)
    goal = find_path(open_map, (0.0, 30.0), point_cm, CHS)
    assert start.status is SearchStatus.START_BLOCKED and goal.status is SearchStatus.GOAL_BLOCKED
    assert start.reason.startswith(f"The start {here} {words}") and goal.reason.startswith(f"The goal {here} {words}")
    assert start.path is None and goal.path is None and start.expanded == goal.expanded == 0


def test_a_node_outside_the_workspace_is_named_so(open_map):
    result = find_path(open_map, (70.0, 0.0), (0.0, 30.0), CHS)
    assert result.status is SearchStatus.START_BLOCKED
    assert result.reason == "The start (70, 0) cm lies outside workspace.x_cm or workspace.y_cm."


def test_start_is_judged_before_goal(open_map):
    assert find_path(open_map, (70.0, 0.0), (70.0, 0.0), CHS).status is SearchStatus.START_BLOCKED


@pytest.mark.parametrize("moves", ["nodes", "proved"])
def test_points_between_nodes_are_joined_by_proved_moves_to_the_nearest_node(moves):
    free_map = build_free_map(make_scene())
    start_cm, goal_cm = (-29.7, 12.45), (5.5, 40.25)
    result = find_path(free_map, start_cm, goal_cm, planner("chs", 56, moves=moves))
    points = result.path.points_cm
    assert tuple(points[0]) == start_cm and tuple(points[-1]) == goal_cm
    assert points[1].tolist() == [-30.0, 12.0]
    assert points[-2].tolist() in ([5.0, 40.0], [6.0, 40.0])
    for a, b in ((points[0], points[1]), (points[-2], points[-1])):
        assert prove_line(free_map.world, *a, *b)[0] == PROVED


def test_a_point_is_joined_past_the_nearest_node_when_something_stands_between():
    """A post of 1 mm between the point and the free node (40, 10); the link passes beside it at either end."""
    free_map = build_free_map(make_scene([Obstacle("circle", (40.2, 10.2), 0.1)], width=0.02))
    point_cm = (40.4, 10.4)
    end = endpoint(free_map, "start", point_cm)
    assert free_map.region[60, 90] == FREE and (free_map.x_cm[90], free_map.y_cm[60]) == (40.0, 10.0)
    assert prove_line(free_map.world, *point_cm, 40.0, 10.0)[0] != PROVED
    assert not end.problem and (end.column, end.row) in ((41, 10), (40, 11))


def test_a_free_point_that_no_node_can_be_joined_to_is_blocked_and_says_so():
    """A tip in a slot, a post in its way out: the arm stands free, but no straight move leads to a node."""
    slot = [
        Obstacle("polygon", vertices_cm=((42.0, 2.5), (52.0, 2.5), (52.0, 3.0), (42.0, 3.0))),
        Obstacle("polygon", vertices_cm=((40.0, -1.0), (52.0, -1.0), (52.0, -0.5), (40.0, -0.5))),
        Obstacle("circle", (43.0, 0.3), 1.0),
    ]
    result = find_path(build_free_map(make_scene(slot, cell=20.0, width=0.1)), (49.5, 0.6), (-20.0, 20.0), CHS)
    assert result.status is SearchStatus.START_BLOCKED
    assert result.reason == (
        f"The start (49.5, 0.6) cm is free, but no straight move to a free node within {JOIN_CELLS} cells of 20 cm "
        "can be proved free; a smaller workspace.cell_cm may help."
    )


def test_start_at_the_goal_is_a_path_of_one_point(open_map):
    for point_cm in ((0.0, 30.0), (0.3, 30.4)):
        result = find_path(open_map, point_cm, point_cm, CHS)
        assert result.status is SearchStatus.FOUND
        assert result.path.points_cm.tolist() == [list(point_cm)] and result.path.length_cm == 0.0


def test_rounding_does_not_take_a_node_for_a_point_between_nodes():
    free_map = build_free_map(table1_scene(1, cell_cm=0.1))
    end = endpoint(free_map, "start", (0.1 * 3.0 + 30.0, 30.2))
    assert end.on_node and (end.column, end.row) == (303, 302)


def fenced_map(thickness_cm):
    """A wall along 45.5 degrees from 8 cm to beyond reach; joint 1 turns from -70 to 170 degrees only."""
    along, aside = (
        np.array([np.cos(0.794), np.sin(0.794)]),
        0.5 * thickness_cm * np.array([-np.sin(0.794), np.cos(0.794)]),
    )
    corners = (8.0 * along - aside, 60.0 * along - aside, 60.0 * along + aside, 8.0 * along + aside)
    wall = Obstacle("polygon", vertices_cm=tuple((float(x), float(y)) for x, y in corners))
    return build_free_map(make_scene([wall], cell=2.0, width=0.02, limits=(LIMITS1, FULL_TURN[1])))


def test_no_path_tells_nodes_that_connect_from_moves_that_do_not():
    result = find_path(fenced_map(0.05), (40.0, 0.0), (0.0, 40.0), CHS)
    assert result.status is SearchStatus.NO_PATH and result.path is None and result.expanded > 100
    assert result.reason.startswith("No path from (40, 0) to (0, 40) cm: the moves of chs with 56 neighbours lead to ")
    assert "at cells of 2 cm and a margin of 0.01 cm. The nodes do connect, but" in result.reason


def test_no_path_tells_that_the_free_space_is_not_connected():
    result = find_path(fenced_map(10.0), (40.0, -20.0), (-20.0, 40.0), CHS)
    assert result.status is SearchStatus.NO_PATH
    assert result.reason.endswith(" The free space around start and goal is not connected.")


def test_no_path_of_chaos_a_star_names_the_seed():
    result = find_path(fenced_map(10.0), (40.0, -20.0), (-20.0, 40.0), planner("chaos_a_star", 8, seed=3))
    assert result.status is SearchStatus.NO_PATH
    assert result.reason.endswith("try another planner.seed.")
