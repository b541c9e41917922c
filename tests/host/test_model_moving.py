"""Distances to obstacles in a span of time, against dense sampling by shapely."""

import numpy as np
import pytest

from host_scenes import make_scene, oracle_distance_cm, star_polygon
from moving_scenes import replace_moving
from planarm.model.moving import gap_in_span, moving_set, offset_cm, sampled_offsets_cm, shape_at
from planarm.scene import MovingSpec, Obstacle, ObstacleMotion

MOTION = ObstacleMotion((0.0, 2.0, 3.0, 5.0), ((0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (-4.0, 1.0)), False)
LOOP = ObstacleMotion((0.0, 1.0, 2.0), ((0.0, 0.0), (3.0, 4.0), (0.0, 0.0)), True)


def scene_with(obstacles):
    return replace_moving(make_scene(obstacles), MovingSpec(0.5, 20))


def test_offsets_are_linear_between_waypoints_rest_after_them_and_repeat():
    assert offset_cm(MOTION, 1.0) == (4.0, 0.0)
    assert offset_cm(MOTION, 2.5) == (8.0, 3.0)
    assert offset_cm(MOTION, 99.0) == (-4.0, 1.0)
    assert offset_cm(LOOP, 6.5) == pytest.approx((1.5, 2.0))
    assert offset_cm(None, 3.0) == (0.0, 0.0)
    assert LOOP.fastest_cm_s == pytest.approx(5.0)


def test_the_flat_arrays_say_the_same_as_the_descriptions():
    scene = scene_with([Obstacle("circle", (1.0, 2.0), 3.0, motion=m) for m in (MOTION, None, LOOP)])
    times = np.linspace(0.0, 10.0, 173)
    offsets = sampled_offsets_cm(moving_set(scene, 10.0), times)
    for i, obstacle in enumerate(scene.obstacles):
        assert offsets[i] == pytest.approx(np.array([offset_cm(obstacle.motion, t) for t in times]), abs=1e-12)


@pytest.mark.parametrize("kind", ["circle", "square", "polygon"])
def test_the_least_distance_in_a_span_is_that_of_dense_sampling(kind):
    rng = np.random.default_rng(["circle", "square", "polygon"].index(kind))
    touched = 0
    for _ in range(40):
        place = tuple(rng.uniform(-8.0, 8.0, 2))
        if kind == "polygon":
            obstacle = Obstacle(kind, vertices_cm=star_polygon(rng, place, 1.0, 4.0, 7), motion=MOTION)
        else:
            obstacle = Obstacle(kind, place, float(rng.uniform(1.0, 6.0)), motion=[MOTION, LOOP][rng.integers(0, 2)])
        moving = moving_set(scene_with([obstacle]), 10.0)
        links = rng.uniform(-12.0, 12.0, (3, 2))
        since = float(rng.uniform(0.0, 6.0))
        until = since + float(rng.uniform(0.0, 3.0))
        gap = gap_in_span(moving, 0, since, until, *links.ravel(), np.inf)
        times = np.linspace(since, until, 300)
        dense = min(oracle_distance_cm(link, shape_at(obstacle, t)) for t in times for link in (links[:2], links[1:]))
        touched += dense == 0.0
        # The obstacle moves at most 6.5 cm/s, so it comes at most that much nearer between two looks.
        assert max(0.0, gap) <= dense + 1e-9
        assert max(0.0, gap) >= dense - 6.5 * (until - since) / 299
    assert 0 < touched < 40


def test_a_bound_is_enough_where_it_is_asked_for():
    obstacle = Obstacle("square", (20.0, 0.0), 4.0, motion=MOTION)
    moving = moving_set(scene_with([obstacle]), 10.0)
    ends = (0.0, 0.0, 1.0, 0.0, 2.0, 0.0)
    exact = gap_in_span(moving, 0, 0.0, 1.0, *ends, np.inf)
    bound = gap_in_span(moving, 0, 0.0, 1.0, *ends, 3.0)
    assert 3.0 < bound <= exact
