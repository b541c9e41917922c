"""Proofs in joint space: what is proved is free by dense samples and shapely, for two and for more links."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host_scenes import make_scene, oracle_clearance_cm, random_obstacles
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.scene import Obstacle
from planarm.workspace.joint_proof import (
    joint_world,
    pose_spare_cm,
    prove_joint_line,
    prove_pieces,
    turning_points,
)
from planarm.workspace.proof import BLOCKED, PROVED


def world_with(links, obstacles, **more):
    scene = make_scene(obstacles, links=links, limits=((-4.0, 4.0),) * len(links), **more)
    return scene, Arm.from_spec(scene.arm), joint_world(scene)


def angles(coefficients, s):
    return sum(coefficients[k] * s[:, None] ** k for k in range(4))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), links=st.sampled_from([(30.0, 20.0), (20.0, 15.0, 10.0), (12.0, 10.0, 10.0, 8.0)]))
def test_a_verdict_agrees_with_dense_samples_by_shapely(seed, links):
    rng = np.random.default_rng(seed)
    scene, arm, world = world_with(links, random_obstacles(rng, 2, size=9.0, keep_off=20.0), floor=bool(seed % 2))
    coefficients = rng.uniform(-1.0, 1.0, (1, 4, len(links))) * np.array([1.2, 0.8, 0.5, 0.3])[:, None]
    coefficients[0, 0, 0] += pi / 2
    verdict, place = prove_pieces(world, np.array([0.0, 1.0]), coefficients)
    if verdict == PROVED:
        q = angles(coefficients[0], np.linspace(0.0, 1.0, 80))
        assert (np.abs(q) <= 4.0).all()
        assert min(oracle_clearance_cm(scene, arm, pose) for pose in q) > scene.margin_cm
        assert not scene.arm.floor or forward(arm, q)[:, 1:, 1].min() > scene.margin_cm
    elif verdict == BLOCKED:
        q = angles(coefficients[0], np.array([place]))
        hit = oracle_clearance_cm(scene, arm, q[0]) <= scene.margin_cm + 1e-9
        low = scene.arm.floor and forward(arm, q)[0, 1:, 1].min() <= scene.margin_cm + 1e-9
        assert hit or low or (np.abs(q) > 4.0).any()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 5))
def test_the_spare_of_a_pose_is_shapely_s_clearance_less_the_margin(seed, count):
    rng = np.random.default_rng(seed)
    scene, arm, world = world_with(tuple(rng.uniform(5.0, 20.0, count)), random_obstacles(rng, 3))
    q = rng.uniform(-pi, pi, count)
    assert pose_spare_cm(world, q) == pytest.approx(oracle_clearance_cm(scene, arm, q) - scene.margin_cm, abs=1e-9)


def test_a_move_through_full_stretch_is_proved():
    _, _, world = world_with((30.0, 20.0), [Obstacle("circle", (0.0, 40.0), 10.0)])
    assert prove_joint_line(world, np.array([0.0, 0.5]), np.array([0.0, -0.5]))[0] == PROVED


def test_a_pin_in_the_way_is_found_and_placed():
    # Link 2 passes the pin at (45, 0) when the arm is straight along x, in the middle of the move.
    _, _, world = world_with((30.0, 20.0), [Obstacle("circle", (45.0, 0.0), 0.01)])
    verdict, share = prove_joint_line(world, np.array([-0.3, 0.0]), np.array([0.3, 0.0]))
    assert verdict == BLOCKED
    assert share == pytest.approx(0.5, abs=0.05)


def test_a_pin_between_samples_is_never_jumped_over():
    # A hair in the way of a long move, at a place that no halving hits.
    _, _, world = world_with((30.0, 20.0), [Obstacle("circle", (45.0, 0.0), 1e-4)], width=2e-3)
    assert prove_joint_line(world, np.array([-0.7317, 0.0]), np.array([1.911, 0.0]))[0] != PROVED


def test_joint_limits_are_held_at_turning_points_too():
    _, _, world = world_with((30.0, 20.0), [])
    over = np.zeros((1, 4, 2))
    over[0, :3, 0] = 3.9, 1.0, -1.0  # 3.9 at both ends, 4.15 in between
    verdict, place = prove_pieces(world, np.array([0.0, 1.0]), over)
    assert (verdict, place) == (BLOCKED, pytest.approx(0.5))
    over[0, 0, 0] = 3.75  # 4.0 in between: just inside
    assert prove_pieces(world, np.array([0.0, 1.0]), over)[0] == PROVED


@settings(max_examples=100, deadline=None)
@given(roots=st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)), scale=st.floats(0.1, 10.0))
def test_turning_points_are_the_roots_of_the_rate(roots, scale):
    r1, r2 = roots
    found = turning_points(scale * r1 * r2, -0.5 * scale * (r1 + r2), scale / 3.0)
    if abs(r1 - r2) > 1e-3:
        assert sorted(found) == pytest.approx(sorted(roots), abs=1e-6)
