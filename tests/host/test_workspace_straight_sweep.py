"""What links are said to sweep on a straight way holds under dense sampling, and little that is true stays unproved."""

from math import cos, hypot, pi, sin

import numpy as np
import pytest
import shapely

from host_scenes import make_scene
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.scene import Obstacle
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import PROVED
from planarm.workspace.straight_sweep import (
    keeps_off_polygon,
    link1_keeps_off,
    link2_keeps_off,
    lowest,
    sweep_between,
)
from planarm.workspace.world import build_world, elbow_at

SAMPLES = np.linspace(0.0, 1.0, 601)
ROUNDING_CM = 1e-5
"""What rounding does to an elbow near singular poses, here and in the kernels: a square root of 1e-12."""
SHARES = (0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0)


def random_way(rng):
    """An arm and the ends of a straight way of its tip within reach; often there are singular ends, or turns on it."""
    while True:
        links = tuple(float(v) for v in rng.uniform(5.0, 40.0, 2))
        if rng.random() < 0.1:
            links = (links[0], links[0])
        scene = make_scene(links=links, elbow=str(rng.choice(["up", "down"])))
        world = build_world(scene)
        length = 10.0 ** rng.uniform(-2.5, 0.7)
        low, high = abs(links[0] - links[1]), sum(links)
        r = rng.choice([rng.uniform(low, high), low, high, high - 1e-3, np.sqrt(abs(links[0] ** 2 - links[1] ** 2))])
        phi, heading = rng.uniform(-pi, pi), rng.uniform(-pi, pi)
        if rng.random() < 0.3:  # across the foot of the base's perpendicular, where turns are
            heading = phi + pi / 2
        a = np.array([r * cos(phi), r * sin(phi)])
        a, b = a - rng.uniform() * length * _unit(heading), a + rng.uniform() * length * _unit(heading)
        aside = abs(a[0] * b[1] - a[1] * b[0]) / np.hypot(*(b - a))
        nearest = aside if a @ (b - a) < 0.0 < b @ (b - a) else min(np.hypot(*a), np.hypot(*b))
        inside = max(nearest, 1e-3) >= world.arm.r_min_cm and max(np.hypot(*a), np.hypot(*b)) <= world.arm.r_max_cm
        if inside and nearest > 1e-3:
            return scene, a, b


def _unit(heading):
    return np.array([cos(heading), sin(heading)])


def swept(scene, a, b):
    """What the module says, and elbow and tip on the way by the house's inverse kinematics, shape (n, 2) each."""
    arm = build_world(scene).arm
    ends = [(*elbow_at(arm, *tip, float(np.hypot(*tip))), *tip) for tip in (a, b)]
    known, sweep = sweep_between(arm, *ends, *((b - a) / np.hypot(*(b - a))))
    tips = a + SAMPLES[:, None] * (b - a)
    joints = forward(Arm.from_spec(scene.arm), inverse_2r(Arm.from_spec(scene.arm), tips, scene.arm.elbow))
    return arm, known, sweep, joints[:, 1], tips


def distances(a, b, c):
    """Of the point c from segments between a and b, shape (n, 2) each, by projection."""
    along = np.clip(((c - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(a + along[:, None] * (b - a) - c, axis=1)


@pytest.mark.parametrize("seed", range(3))
def test_the_elbow_stays_on_the_arc_between_its_known_places(seed, sized):
    """1,200 ways for each seed, 3,000 with --full: angle, distance from the places' hull, how far any point moves."""
    rng = np.random.default_rng(seed)
    seen = {"known": 0, "turned": 0, "overshoots": 0, "tight": 0.0}
    tried = sized(1200, 3000)
    for _ in range(tried):
        scene, a, b = random_way(rng)
        _, known, sweep, elbow, tips = swept(scene, a, b)
        if not known:
            continue
        places = np.array([[sweep.eax, sweep.eay], [sweep.ebx, sweep.eby], [sweep.tx, sweep.ty]])
        angles = np.arctan2(*places.T[::-1]) - np.arctan2(places[0, 1], places[0, 0])
        angles = (angles + pi) % (2 * pi) - pi
        theta = np.arctan2(*elbow.T[::-1]) - np.arctan2(places[0, 1], places[0, 0])
        theta = (theta + pi) % (2 * pi) - pi
        assert angles.min() - 1e-6 <= theta.min() and theta.max() <= angles.max() + 1e-6
        hull = shapely.convex_hull(shapely.multipoints(places))
        assert shapely.distance(shapely.points(elbow), hull).max() <= sweep.sag_cm + ROUNDING_CM
        moved = max(np.linalg.norm(v - v[0], axis=1).max() for v in (elbow, tips))
        assert moved <= sweep.moves_cm + ROUNDING_CM
        assert lowest(sweep) <= min(elbow[:, 1].min(), tips[:, 1].min()) + ROUNDING_CM
        seen["known"] += 1
        seen["turned"] += sweep.turned
        ends = angles[:2]
        seen["overshoots"] += bool(theta.max() > ends.max() + 1e-6 or theta.min() < ends.min() - 1e-6)
        seen["tight"] = max(seen["tight"], moved / sweep.moves_cm)
    assert seen["known"] > tried // 1.5 and seen["turned"] > tried // 30 and seen["overshoots"] > tried // 60
    assert seen["tight"] > 0.999


@pytest.mark.parametrize("seed", range(3))
def test_no_link_comes_nearer_than_certified(seed):
    """1,500 ways for each seed, a point near each; the largest distance that is certified is held against samples."""
    rng = np.random.default_rng(seed)
    tightest, shown, tried = np.zeros(2), np.zeros(2), 0
    for _ in range(1500):
        scene, a, b = random_way(rng)
        arm, known, sweep, elbow, tips = swept(scene, a, b)
        c = tips[300] * rng.uniform(0.0, 1.2) + rng.normal(size=2) * 3.0
        seen = [distances(p, q, c) for p, q in ((np.zeros_like(elbow), elbow), (elbow, tips))]
        if not known:
            continue
        tried += 1
        for link, (keeps_off, apart) in enumerate(zip((link1_keeps_off, link2_keeps_off), seen, strict=True)):
            for share in SHARES:
                keep = float(apart.min()) * share
                if keeps_off(arm, sweep, *c, keep):
                    tightest[link] = max(tightest[link], share)
                    shown[link] += share == 0.95
                    assert share < 1.0, "what is touched was certified"
            assert not keeps_off(arm, sweep, *c, float(apart.min()) + 1e-6)
    assert tried > 1000
    assert np.all(tightest == 0.999)
    assert shown[0] > 0.95 * tried, "link 1 sweeps just its sector"
    assert shown[1] > 0.6 * tried


@pytest.mark.parametrize("seed", range(3))
def test_no_link_comes_nearer_to_a_polygon_than_certified(seed):
    """500 ways for each seed beside a triangle or a notched polygon, distances by shapely."""
    rng = np.random.default_rng(seed)
    shown, tried = np.zeros(2), 0
    for _ in range(500):
        scene, a, b = random_way(rng)
        arm, known, sweep, elbow, tips = swept(scene, a, b)
        if not known:
            continue
        corners = np.array([(0, 0), (4, 0), (0.5, 0.5), (0, 4)] if rng.random() < 0.5 else [(0, 0), (3, 0), (0, 2)])
        turn = rng.uniform(-pi, pi)
        corners = corners @ np.array([_unit(turn), _unit(turn + pi / 2)]) + tips[300] * rng.uniform(0.2, 1.2)
        corners = corners + rng.normal(size=2) * 3.0
        polygon = shapely.Polygon(corners)
        links = [np.stack([np.zeros_like(elbow), elbow], axis=1), np.stack([elbow, tips], axis=1)]
        tried += 1
        for link, segments in enumerate(links):
            apart = float(shapely.distance(shapely.linestrings(segments), polygon).min())
            for share in SHARES:
                keep = apart * share
                certified = keeps_off_polygon(arm, sweep, link + 1, corners, 0, len(corners), keep)
                shown[link] += certified and share == 0.8
                assert not (certified and share == 1.0), "what is touched was certified"
            assert not keeps_off_polygon(arm, sweep, link + 1, corners, 0, len(corners), apart + 1e-6)
    assert np.all(shown > 0.3 * tried)


def test_a_line_that_begins_close_to_a_circle_is_proved():
    """Link 2 leaves a circle from 1e-6 cm beside it: discs would have to be smaller than that."""
    arm = Arm.from_spec(make_scene().arm)
    q = inverse_2r(arm, (38.0, 12.0), "up")
    joints = forward(arm, q)
    along = (joints[2] - joints[1]) / hypot(*(joints[2] - joints[1]))
    normal = np.array([along[1], -along[0]])
    for gap_cm, is_free in ((1e-6, True), (-1e-12, False)):
        center = 0.5 * (joints[1] + joints[2]) + (3.0 + gap_cm) * normal
        world = build_world(make_scene([Obstacle("circle", tuple(center), 6.0)]), 0.0)
        assert (prove_line(world, *joints[2], *(joints[2] - 1.5 * normal))[0] == PROVED) == is_free
