"""Distances between links and obstacles, with shapely as the oracle."""

from math import inf, pi

import numpy as np
import pytest

from host_scenes import make_scene, oracle_clearance_cm, oracle_distance_cm, random_obstacles, star_polygon
from planarm.model.arm import Arm
from planarm.model.collision import chain_clearance, pose_clearance_cm, segment_clearance, segment_distance2
from planarm.model.kinematics import forward
from planarm.model.shapes import Circle, Polygon, obstacle_set, shape_of

L_SHAPE = Polygon(((0.0, 0.0), (10.0, 0.0), (10.0, 2.0), (2.0, 2.0), (2.0, 10.0), (0.0, 10.0)))
SQUARE = Polygon(((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)))


def distance_cm(a, b, shape):
    return segment_clearance(*map(float, (*a, *b)), obstacle_set([shape]), inf)[0]


@pytest.mark.parametrize(
    ("shape", "a", "b", "expected"),
    [
        (SQUARE, (1, 1), (2, 3), 0.0),  # inside
        (SQUARE, (-1, 2), (9, 2), 0.0),  # right through
        (SQUARE, (-1, 4), (9, 4), 0.0),  # along an edge
        (SQUARE, (4, 4), (6, 9), 0.0),  # touches a corner
        (SQUARE, (-3, 5), (5, -3), 0.0),  # cuts a corner off
        (SQUARE, (6, 0), (6, 4), 2.0),
        (SQUARE, (7, 8), (7, 8), 5.0),  # a point
        (SQUARE, (5, 0), (9, 0), 1.0),  # on the line of an edge, apart from it
        (L_SHAPE, (3, 3), (9, 9), 1.0),  # in the notch of the L
        (L_SHAPE, (12, -1), (-1, 12), 0.0),  # over both legs
        (L_SHAPE, (8, 4), (4, 8), 2.0),
        (Circle((0.0, 0.0), 5.0), (1, 1), (2, 2), 0.0),  # inside, not touching the line
        (Circle((0.0, 0.0), 5.0), (-9, 5), (9, 5), 0.0),  # tangent
        (Circle((0.0, 0.0), 5.0), (8, 0), (20, 3), 3.0),
    ],
)
def test_known_distances(shape, a, b, expected):
    assert distance_cm(a, b, shape) == pytest.approx(expected, abs=1e-12)
    assert distance_cm(b, a, shape) == pytest.approx(expected, abs=1e-12)


def test_segments_of_one_slanted_line_are_as_far_apart_as_their_ends():
    """Their straddle tests see rounding only; about one in 200 such pairs would seem to cross."""
    rng = np.random.default_rng(0)
    for _ in range(2000):
        angle, origin = rng.uniform(0.0, pi), rng.uniform(-50, 50, 2)
        along = np.sort(rng.uniform(0.0, 60.0, 4)) + np.array([0.0, 0.0, 1.0, 1.0])
        ends = origin + along[:, None] * np.array([np.cos(angle), np.sin(angle)])
        assert segment_distance2(*ends.ravel()) == pytest.approx((along[2] - along[1]) ** 2, rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_random_shapes_against_shapely(seed):
    rng = np.random.default_rng(seed)
    touched = 0
    for _ in range(250):
        shape = Polygon(star_polygon(rng, rng.uniform(-10, 10, 2), 1.0, 12.0, int(rng.integers(3, 12))))
        if rng.random() < 0.2:
            shape = Circle(tuple(rng.uniform(-10, 10, 2)), float(rng.uniform(0.5, 10)))
        a, b = rng.uniform(-25, 25, (2, 2))
        expected = oracle_distance_cm((a, b), shape)
        touched += expected == 0.0
        assert distance_cm(a, b, shape) == pytest.approx(expected, abs=1e-9)
    assert 20 < touched < 230  # both verdicts were met


@pytest.mark.parametrize("links", [1, 2, 3, 6])
def test_clearance_of_chains_against_shapely(links):
    rng = np.random.default_rng(links)
    for _ in range(60):
        scene = make_scene(random_obstacles(rng, int(rng.integers(1, 6))))
        arm = Arm(tuple(rng.uniform(5, 30, links)), (0.0, 0.0), ((-pi, pi),) * links)
        q = rng.uniform(-pi, pi, links)
        obstacles = obstacle_set([shape_of(o) for o in scene.obstacles])
        assert pose_clearance_cm(arm, q, obstacles) == pytest.approx(oracle_clearance_cm(scene, arm, q), abs=1e-9)


def test_the_nearest_obstacle_is_named():
    shapes = [Circle((30.0, 9.0), 2.0), Circle((10.0, 3.0), 2.0), SQUARE]
    joints = np.array([[5.0, 0.0], [40.0, 0.0]])
    assert chain_clearance(joints, obstacle_set(shapes)) == (1.0, 1)
    assert chain_clearance(joints, obstacle_set(shapes[:1])) == (7.0, 0)


def test_without_obstacles_the_clearance_is_infinite():
    arm = Arm((1.0, 1.0), (0.0, 0.0), ((-pi, pi),) * 2)
    assert pose_clearance_cm(arm, [0.0, 0.0], obstacle_set([])) == inf
    assert chain_clearance(forward(arm, [0.0, 0.0]), obstacle_set([])) == (inf, -1)


def test_an_obstacle_no_nearer_than_the_best_so_far_is_passed_over():
    far = obstacle_set([Circle((0.0, 10.0), 2.0)])
    assert segment_clearance(-5.0, 0.0, 5.0, 0.0, far, 8.0) == (8.0, -1)
    assert segment_clearance(-5.0, 0.0, 5.0, 0.0, far, 8.1) == (8.0, 0)
