"""Proofs of moves: the bound holds under dense sampling, proved moves are free, counterexamples are real."""

from math import acos, pi, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host_scenes import FULL_TURN, make_scene, random_obstacles
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.scene import Obstacle
from planarm.workspace.line_proof import prove_line
from planarm.workspace.proof import (
    BLOCKED,
    PROVED,
    SMALLEST_CM,
    UNPROVED,
    disc_verdict,
    displacement_bound,
    motion_bound,
    next_piece,
    prove_curve,
)
from planarm.workspace.world import build_world, clearances_cm

INNER_20_CM = ((radians(-90), radians(270)), (-acos(-0.75), acos(-0.75)))
SHARES = np.linspace(0.0, 1.0, 401)


def random_arm(rng):
    links = tuple(float(v) for v in rng.uniform(5.0, 40.0, 2))
    if rng.random() < 0.1:
        links = (links[0], links[0])
    most = float(rng.uniform(1.0, pi)) if rng.random() < 0.5 else pi
    least = float(rng.uniform(0.0, 0.8)) if rng.random() < 0.3 else 0.0
    elbow = str(rng.choice(["up", "down"]))
    limits2 = (-most, -least) if elbow == "up" else (least, most)
    return make_scene(links=links, elbow=elbow, limits=(FULL_TURN[0], limits2))


def arm_and_world(scene):
    return Arm.from_spec(scene.arm), build_world(scene)


def poses(scene, tips):
    return inverse_2r(Arm.from_spec(scene.arm), tips, scene.arm.elbow)


def line_points(p0, p1, shares=SHARES):
    return np.asarray(p0) + shares[:, None] * (np.asarray(p1) - np.asarray(p0))


def curve_points(p0, p1, p2, shares=SHARES):
    u, p0, p1, p2 = shares[:, None], np.asarray(p0), np.asarray(p1), np.asarray(p2)
    return (1 - u) ** 2 * p0 + 2 * u * (1 - u) * p1 + u**2 * p2


def spare_cm(scene, world, tips):
    """Clearance beyond the margin of the poses at the tips, -inf where the arm cannot or may not be there."""
    q = poses(scene, tips)
    r = np.linalg.norm(tips - np.asarray(scene.arm.base_cm), axis=1)
    allowed = (r >= world.arm.r_min_cm - 1e-9) & (r <= world.arm.r_max_cm + 1e-9)
    allowed &= (q[:, 0] >= world.arm.theta1_min_rad) & (q[:, 0] <= world.arm.theta1_max_rad)
    spare = np.full(len(tips), -np.inf)
    spare[allowed] = clearances_cm(world, q[allowed]) - world.arm.margin_cm
    return spare


@pytest.mark.parametrize("seed", range(4))
def test_the_motion_bound_is_never_exceeded(seed):
    """500 random discs for each seed, 300 tips in each, on its rim above all: theta1 and both links' points."""
    rng = np.random.default_rng(seed)
    tightest = 0.0
    for _ in range(500):
        scene = random_arm(rng)
        arm, world = arm_and_world(scene)
        r = float(rng.uniform(world.arm.r_min_cm, world.arm.r_max_cm))
        rho = float(10.0 ** rng.uniform(-3, 1.3))
        direction = rng.uniform(0, 2 * pi)
        center = r * np.array([np.cos(direction), np.sin(direction)])
        around, out = rng.uniform(0, 2 * pi, 300), rho * np.sqrt(rng.uniform(0.9, 1.0, 300))
        tips = center + np.column_stack([out * np.cos(around), out * np.sin(around)])
        distances = np.linalg.norm(tips, axis=1)
        tips = tips[(distances >= world.arm.r_min_cm) & (distances <= world.arm.r_max_cm)]
        home = inverse_2r(arm, center, scene.arm.elbow)
        q = inverse_2r(arm, tips, scene.arm.elbow)
        turn = np.abs((q[:, 0] - home[0] + pi) % (2 * pi) - pi)
        moved = np.linalg.norm(forward(arm, q)[:, 1:] - forward(arm, home)[1:], axis=2)
        dtheta1, displacement = motion_bound(world.arm, r, rho)
        assert np.all(turn <= dtheta1 + 1e-7)
        assert np.all(moved <= displacement + 1e-6)
        bound = displacement_bound(world.arm, r, rho)
        assert np.all(moved <= bound + 1e-6) and bound <= 2.0 * displacement
        if len(moved):
            tightest = max(tightest, moved[:, 0].max() / bound)
    assert tightest > 0.9  # a bound that is far too large would pass everything above


def test_the_turn_of_joint_1_is_bounded_by_the_extremes_of_direction_and_of_beta():
    """asin(rho / r) plus the largest change of beta over the disc's distances, found here on 20,001 of them."""
    rng = np.random.default_rng(6)
    for _ in range(300):
        scene = random_arm(rng)
        world = build_world(scene)
        l1, l2 = scene.arm.link_lengths_cm
        r = float(rng.uniform(world.arm.r_min_cm, world.arm.r_max_cm))
        rho = float(rng.uniform(0.05, 0.9)) * r
        distances = np.clip(np.linspace(r - rho, r + rho, 20001), world.arm.r_min_cm, world.arm.r_max_cm)
        betas = np.arccos(np.clip((distances**2 + l1**2 - l2**2) / (2 * distances * l1), -1, 1))
        beta = np.arccos(np.clip((r**2 + l1**2 - l2**2) / (2 * r * l1), -1, 1))
        expected = min(pi, np.arcsin(rho / r) + np.abs(betas - beta).max())
        assert motion_bound(world.arm, r, rho)[0] == pytest.approx(expected, abs=2e-3)
        assert motion_bound(world.arm, r, rho)[0] >= expected - 1e-12


def test_a_disc_is_proved_exactly_when_the_spare_clearance_exceeds_the_bound():
    scene = make_scene([Obstacle("circle", (40.0, -20.0), 4.0)])
    tip, rho = np.array([30.0, 25.0]), 1.5
    displacement = displacement_bound(build_world(scene).arm, float(np.hypot(*tip)), rho)
    clearance = spare_cm(scene, build_world(scene, 0.0), tip[None])[0]
    for share, verdict in [(0.99, PROVED), (1.01, UNPROVED)]:
        assert disc_verdict(build_world(scene, clearance - displacement / share), *tip, rho) == verdict
    assert disc_verdict(build_world(scene, clearance + 1e-9), *tip, rho) == BLOCKED


def test_a_disc_that_holds_the_base_is_never_proved():
    """Joint 1's whole turn is just wide enough for it here, and nothing is near."""
    world = build_world(make_scene())
    tip = np.array([0.0, 30.0])
    theta1 = poses(make_scene(), tip)[0]
    whole_turn = world.arm._replace(theta1_min_rad=theta1 - pi, theta1_max_rad=theta1 + pi, turn_start_rad=theta1 - pi)
    world = world._replace(arm=whole_turn)
    assert disc_verdict(world, *tip, 30.1) == UNPROVED
    assert disc_verdict(world, *tip, 10.0) == PROVED


@given(st.data())
@settings(max_examples=50, deadline=None)
def test_pieces_follow_each_other_from_0_to_1_whatever_is_split(data):
    start, width, end = 0.0, 1.0, 0.0
    while start < 1.0:
        assert start == end
        assert start % width == 0.0
        if width > 1 / 64 and data.draw(st.booleans()):
            width *= 0.5
        else:
            end = start + width
            assert end <= 1.0
            start, width = next_piece(start, width)
    assert end == 1.0


def test_points_of_link_2_move_no_farther_than_its_ends():
    rng = np.random.default_rng(5)
    before, after = rng.normal(size=(2, 1000, 2, 2))
    shares = rng.uniform(0, 1, (1000, 1))
    point = (1 - shares) * (after[:, 0] - before[:, 0]) + shares * (after[:, 1] - before[:, 1])
    ends = np.linalg.norm(after - before, axis=2).max(axis=1)
    assert np.all(np.linalg.norm(point, axis=1) <= ends + 1e-12)


def random_world(rng):
    elbow = str(rng.choice(["up", "down"]))
    limits = INNER_20_CM if rng.random() < 0.5 else ((radians(-60), radians(200)), (-2.6, 2.6))
    scene = make_scene(
        random_obstacles(rng, int(rng.integers(1, 5))), elbow=elbow, limits=limits, floor=bool(rng.random() < 0.3)
    )
    return scene, build_world(scene)


def random_tip(rng):
    direction, r = rng.uniform(0, 2 * pi), rng.uniform(15.0, 52.0)
    return np.array([r * np.cos(direction), r * np.sin(direction)])


def judge(scene, world, verdict, share, points, counts):
    """What each verdict promises, against 401 poses on the move."""
    at_limit = verdict == UNPROVED and limit_is_near(scene, world, points(np.array([share])))
    counts[verdict] += not at_limit
    spare = spare_cm(scene, world, points(SHARES))
    if verdict == PROVED:
        assert spare.min() > 0.0
    elif verdict == BLOCKED:
        assert spare_cm(scene, world, points(np.array([share])))[0] <= 1e-9
    elif not at_limit:
        assert spare_cm(scene, world, points(np.array([share])))[0] < 60 * SMALLEST_CM
    if spare.min() <= 0.0:
        assert verdict != PROVED


def limit_is_near(scene, world, tip):
    """Within what the smallest disc can turn joint 1, at an edge of its limits or of reach."""
    theta1 = poses(scene, tip)[0, 0]
    r = float(np.linalg.norm(tip))
    turn, _ = motion_bound(world.arm, r, SMALLEST_CM)
    near_limit = min(theta1 - world.arm.theta1_min_rad, world.arm.theta1_max_rad - theta1) <= turn
    return near_limit or min(r - world.arm.r_min_cm, world.arm.r_max_cm - r) <= 0.05


@pytest.mark.parametrize("seed", range(4))
def test_verdicts_on_lines_are_true(seed):
    rng, counts = np.random.default_rng(seed), [0, 0, 0]
    for _ in range(60):
        scene, world = random_world(rng)
        for _ in range(8):
            p0 = random_tip(rng)
            p1 = p0 + rng.normal(size=2) * rng.choice([0.7, 4.0, 12.0])
            verdict, share = prove_line(world, *p0, *p1)
            judge(scene, world, verdict, share, lambda s, a=p0, b=p1: line_points(a, b, s), counts)
    assert counts[PROVED] > 40
    assert counts[BLOCKED] > 40
    assert counts[UNPROVED] < 10


@pytest.mark.parametrize("seed", range(4))
def test_verdicts_on_curves_are_true(seed):
    rng, counts = np.random.default_rng(100 + seed), [0, 0, 0]
    for _ in range(60):
        scene, world = random_world(rng)
        for _ in range(8):
            p0 = random_tip(rng)
            p1 = p0 + rng.normal(size=2) * rng.choice([0.7, 4.0, 12.0])
            p2 = p1 + rng.normal(size=2) * rng.choice([0.7, 4.0, 12.0])
            verdict, share = prove_curve(world, *p0, *p1, *p2)
            judge(scene, world, verdict, share, lambda s, a=p0, b=p1, c=p2: curve_points(a, b, c, s), counts)
    assert counts[PROVED] > 40
    assert counts[BLOCKED] > 40
    assert counts[UNPROVED] < 10


def test_nearly_every_line_that_is_clear_by_a_hundredth_of_a_centimetre_is_proved():
    rng = np.random.default_rng(11)
    clear = proved = 0
    for _ in range(250):
        scene = make_scene(random_obstacles(rng, 3), limits=INNER_20_CM)
        world = build_world(scene)
        for _ in range(8):
            p0 = random_tip(rng)
            p1 = p0 + rng.normal(size=2) * 3.0
            r = np.linalg.norm(line_points(p0, p1), axis=1)
            if spare_cm(scene, world, line_points(p0, p1)).min() > 0.01 and r.max() < 49.9 and r.min() > 20.01:
                q = poses(scene, line_points(p0, p1))
                if np.abs(np.diff(q[:, 0])).max() > 1.0:
                    continue  # passes from one end of joint 1's turn to the other
                clear += 1
                proved += prove_line(world, *p0, *p1)[0] == PROVED
    assert clear > 300
    assert proved >= 0.995 * clear


def test_without_obstacles_the_inner_hole_still_blocks():
    world = build_world(make_scene(limits=INNER_20_CM))
    assert prove_line(world, -25.0, 5.0, 25.0, 5.0) == (BLOCKED, 0.5)
    assert prove_line(world, -25.0, 20.0, 25.0, 20.0) == (PROVED, 1.0)
    verdict, share = prove_line(world, -3.0, 19.9, 30.0, 19.9)  # dips in far from its middle
    assert (verdict, share) == (BLOCKED, pytest.approx(3 / 33))
    assert prove_curve(world, -30.0, 5.0, 0.0, 15.0, 30.0, 5.0)[0] == BLOCKED
    assert prove_curve(world, -30.0, 5.0, 0.0, 45.0, 30.0, 5.0)[0] == PROVED


def test_without_obstacles_a_curve_around_the_base_must_not_cross_the_hole():
    """The whole curve fits in one disc with nothing near: only the triangle's own distances tell."""
    world = build_world(make_scene(limits=(FULL_TURN[0], (-pi, pi))))
    assert prove_curve(world, -12.0, -1.0, 0.0, 3.0, 12.0, -1.0)[0] == BLOCKED
    assert prove_curve(world, -12.0, -25.0, 0.0, 30.0, 12.0, -25.0)[0] == BLOCKED


def test_a_line_leaves_reach_only_at_its_ends():
    world = build_world(make_scene())
    assert prove_line(world, 30.0, 0.0, 50.5, 0.0) == (BLOCKED, 1.0)
    assert prove_line(world, 51.0, 0.0, 30.0, 0.0) == (BLOCKED, 0.0)
    assert prove_line(world, 30.0, 40.0, 40.0, 30.0) == (PROVED, 1.0)  # a chord between two poses at full stretch


def test_joint_1_does_not_jump_over_the_gap_between_its_limits():
    """Straight down is both -90 and 270 degrees: a tip cannot pass there, wherever the elbow is free."""
    scene = make_scene(limits=INNER_20_CM)
    world = build_world(scene)
    for r in (25.0, 35.0, 45.0):
        tips = r * np.column_stack([np.cos(np.linspace(0, 2 * pi, 3601)), np.sin(np.linspace(0, 2 * pi, 3601))])
        theta1 = poses(scene, tips)[:, 0]
        at = int(np.argmax(np.abs(np.diff(theta1))))
        verdict, _ = prove_line(world, *tips[at - 5], *tips[at + 6])
        assert verdict != PROVED
        assert prove_line(world, *tips[at - 40], *tips[at - 10])[0] == PROVED


def test_a_thin_obstacle_between_two_free_ends_is_found():
    """Both ends clear, the obstacle only as wide as a tenth of the move."""
    scene = make_scene([Obstacle("circle", (40.0, 10.0), 0.5)], width=0.2)
    world = build_world(scene)
    verdict, share = prove_line(world, 40.0, 15.0, 40.0, 5.0)
    assert verdict == BLOCKED
    tip = line_points((40.0, 15.0), (40.0, 5.0), np.array([share]))
    assert spare_cm(scene, world, tip)[0] <= 0.0


def test_nothing_is_looked_at_beyond_the_end_of_a_line():
    """Twice as far each line meets the base, where there is no pose; beside obstacles it takes several pieces."""
    rng, several = np.random.default_rng(3), 0
    for _ in range(400):
        scene = make_scene(random_obstacles(rng, 4), links=(26.0, 26.0), limits=(FULL_TURN[0], (-pi, pi)))
        world = build_world(scene, 0.0)
        p0 = random_tip(rng)
        verdict, _ = prove_line(world, *p0, *(0.5 * p0))
        several += verdict == PROVED and spare_cm(scene, world, line_points(p0, 0.5 * p0)).min() < 0.5
    assert several > 5


def test_a_move_that_grazes_the_margin_stays_unproved():
    """The tip slides 1e-10 cm outside the margin of a circle's lowest point: not told from touching it."""
    scene = make_scene([Obstacle("circle", (40.0, -5.0), 4.0)], elbow="up")
    world = build_world(scene)
    y = -3.0 + scene.margin_cm + 1e-10
    assert prove_line(world, 38.0, y, 42.0, y)[0] == UNPROVED
    for apart_cm in (1e-6, 0.05):
        assert prove_line(world, 38.0, y + apart_cm, 42.0, y + apart_cm)[0] == PROVED


def test_a_move_of_no_length_is_its_pose():
    world = build_world(make_scene([Obstacle("circle", (40.0, 10.0), 4.0)]))
    assert prove_line(world, 30.0, 30.0, 30.0, 30.0) == (PROVED, 1.0)
    assert prove_line(world, 40.0, 10.0, 40.0, 10.0)[0] == BLOCKED
