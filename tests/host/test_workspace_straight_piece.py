"""What is proved of a short straight way holds under dense sampling, and little that is true stays unproved."""

from math import cos, hypot, pi, sin, sqrt

import numpy as np
import pytest

from host_scenes import make_scene
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.scene import Obstacle
from planarm.workspace.proof import PROVED, least_sin2, prove_line
from planarm.workspace.straight_piece import link1_stays_clear, link2_stays_clear, turning_bounds
from planarm.workspace.world import build_world, elbow_at

SAMPLES = np.linspace(-1.0, 1.0, 301)


def random_piece(rng):
    """An arm, the middle and direction of a straight way of its tip, and half its length; nothing singular on it."""
    while True:
        links = tuple(float(v) for v in rng.uniform(5.0, 40.0, 2))
        scene = make_scene(links=links, elbow=str(rng.choice(["up", "down"])))
        r, phi, heading = rng.uniform(abs(links[0] - links[1]), sum(links)), rng.uniform(-pi, pi), rng.uniform(-pi, pi)
        half = float(10.0 ** rng.uniform(-2.5, 0.7))
        tip, direction = (r * cos(phi), r * sin(phi)), (cos(heading), sin(heading))
        if least_sin2(build_world(scene).arm, r, half) > 0.01 and r > half:
            return scene, np.array(tip), np.array(direction), half


def distances(a, b, c):
    """Of the point c from segments between a and b, shape (n, 2) each, by projection."""
    along = np.clip(((c - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(a + along[:, None] * (b - a) - c, axis=1)


def judged(scene, tip, direction, half, c, keep):
    """What both certificates say, one for each link."""
    arm = build_world(scene).arm
    r = float(np.hypot(*tip))
    e = np.array(elbow_at(arm, *tip, r))
    f = tip - e
    cross = e[0] * f[1] - e[1] * f[0]
    turns = float(f @ direction / cross), float(-(e @ direction) / cross)
    least = arm.l1_cm * arm.l2_cm * sqrt(least_sin2(arm, r, half))
    bounds = (
        turning_bounds(arm.l1_cm, arm.l2_cm, least, r + half),
        turning_bounds(arm.l2_cm, arm.l1_cm, least, r + half),
    )
    first = link1_stays_clear(*c, keep, *e, turns[0], bounds[0], half)
    return first, link2_stays_clear(*c, keep, *e, *tip, *direction, turns, *bounds, half)


def moved(scene, tip, direction, half):
    """Elbow and tip on the way, shape (n, 2) each, and headings of both links, shape (n, 2)."""
    arm = Arm.from_spec(scene.arm)
    q = inverse_2r(arm, tip + half * SAMPLES[:, None] * direction, scene.arm.elbow)
    joints = forward(arm, q)
    return joints[:, 1], joints[:, 2], np.unwrap(np.cumsum(q, axis=1), axis=0)


@pytest.mark.parametrize("seed", range(3))
def test_no_link_comes_nearer_than_certified(seed):
    """1,500 pieces for each seed, a point near each; the largest distance that is certified is held against samples."""
    rng = np.random.default_rng(seed)
    tightest, certified = np.zeros(2), 0
    for _ in range(1500):
        scene, tip, direction, half = random_piece(rng)
        elbow, end, _ = moved(scene, tip, direction, half)
        c = end[150] * rng.uniform(0.0, 1.2) + rng.normal(size=2) * 3.0
        seen = [distances(a, b, c) for a, b in ((np.zeros_like(elbow), elbow), (elbow, end))]
        for link, apart in enumerate(seen):
            for share in (0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0):
                keep = float(apart.min()) * share
                if judged(scene, tip, direction, half, c, keep)[link]:
                    certified += 1
                    tightest[link] = max(tightest[link], share)
                    assert share < 1.0, "what is touched was certified"
            assert not judged(scene, tip, direction, half, c, float(apart.min()) + 1e-6)[link]
    assert certified > 1000
    assert np.all(tightest > 0.98)


def test_headings_turn_no_faster_than_bounded():
    """First and second differences over 300 samples of 500 pieces."""
    rng = np.random.default_rng(11)
    for _ in range(500):
        scene, tip, direction, half = random_piece(rng)
        arm = build_world(scene).arm
        r = float(np.hypot(*tip))
        least = arm.l1_cm * arm.l2_cm * sqrt(least_sin2(arm, r, half))
        _, _, headings = moved(scene, tip, direction, half)
        step = half * (SAMPLES[1] - SAMPLES[0])
        for k, (near, far) in enumerate([(arm.l1_cm, arm.l2_cm), (arm.l2_cm, arm.l1_cm)]):
            first, second = turning_bounds(near, far, least, r + half)
            assert np.abs(np.diff(headings[:, k]) / step).max() <= first * (1 + 1e-6) + 1e-9
            assert np.abs(np.diff(headings[:, k], n=2) / step**2).max() <= second * (1 + 1e-6) + 1e-14 / step**2


def test_a_line_that_begins_close_to_a_circle_is_proved():
    """Link 2 leaves a circle from 1e-6 cm beside it: discs alone would have to be smaller than that."""
    arm = Arm.from_spec(make_scene().arm)
    q = inverse_2r(arm, (38.0, 12.0), "up")
    joints = forward(arm, q)
    along = (joints[2] - joints[1]) / hypot(*(joints[2] - joints[1]))
    normal = np.array([along[1], -along[0]])
    for gap_cm, is_free in ((1e-6, True), (-1e-12, False)):
        center = 0.5 * (joints[1] + joints[2]) + (3.0 + gap_cm) * normal
        world = build_world(make_scene([Obstacle("circle", tuple(center), 6.0)]), 0.0)
        assert (prove_line(world, *joints[2], *(joints[2] - 1.5 * normal))[0] == PROVED) == is_free
