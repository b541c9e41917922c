"""Errors of paper B (D* with particle swarms among moving obstacles), each shown by computation; see docs/errata.md."""

from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np
import pytest
from scipy import ndimage

from planarm.experiments.as_printed import ARM_B, poses_of_table_1_rad
from planarm.experiments.printed import forward_paper_b
from planarm.model.kinematics import inverse_2r

L = 50.0  # both links, section 6


def tip_by_hand(theta1, theta2):
    return L * np.exp(1j * theta1) + L * np.exp(1j * (theta1 + theta2))


# B1: the forward kinematics.


def test_equations_1_and_2_put_a_simple_pose_50_cm_off():
    assert forward_paper_b((L, L), np.radians([[0.0, 90.0]]))[0] == pytest.approx([0.0, 50.0], abs=1e-12)
    assert tip_by_hand(0.0, np.pi / 2) == pytest.approx(50 + 50j)


def test_equations_1_and_2_are_38_5_cm_off_on_average_on_an_arm_of_100_cm():
    q = poses_of_table_1_rad()
    off = abs(forward_paper_b((L, L), q) @ [1, 1j] - tip_by_hand(*q.T))
    assert off.mean() == pytest.approx(38.5, abs=0.05)
    assert off.max() == pytest.approx(100.0)


def test_equations_3_to_6_with_atan2_are_right():
    q = poses_of_table_1_rad()
    tips = tip_by_hand(*q.T)
    back = inverse_2r(ARM_B, np.stack([tips.real, tips.imag], axis=1), "down")
    assert abs(tip_by_hand(*back.T) - tips).max() < 1e-9


# B2: the gain of the swarm.


def test_environment_1_gains_2_7399_cm_by_table_2_not_3_2846():
    d_star, swarmed = np.array([72.4264, 78.2132]), np.array([69.6865, 73.8408])
    assert d_star - swarmed == pytest.approx([2.7399, 4.3724], abs=1e-9)  # 4.3724 is the text's, 2.7399 is not


def test_both_d_star_lengths_are_8_neighbour_lengths():
    assert 30 + 30 * sqrt(2) == pytest.approx(72.4264, abs=5e-5)
    assert 57 + 15 * sqrt(2) == pytest.approx(78.2132, abs=5e-5)


# B3: the swarm's inertia.


def swarm(weight, clamp, seed, steps=100, c1=1.0, c2=3.0):
    """Eqs. 8-9 on a bowl with 50 particles, the paper's c1 and c2; return the swarm's spread after each step."""
    rng = np.random.default_rng(seed)
    place, speed = rng.uniform(-1, 1, (50, 4)), np.zeros((50, 4))
    best, spreads = place.copy(), []
    for _ in range(steps):
        leader = best[np.argmin((best**2).sum(axis=1))]
        pull = c1 * rng.random((50, 4)) * (best - place) + c2 * rng.random((50, 4)) * (leader - place)
        speed = np.clip(weight * speed + pull, -clamp, clamp)
        place = place + speed
        better = (place**2).sum(axis=1) < (best**2).sum(axis=1)
        best[better] = place[better]
        spreads.append(np.abs(place).max())
    return spreads


def test_w_1_with_c1_1_and_c2_3_diverges_unless_speeds_are_clamped(sized):
    for seed in range(sized(10, 200)):
        assert swarm(1.0, np.inf, seed)[-1] > 1e3, f"seed {seed}"
        assert swarm(1.0, 0.5, seed)[-1] < 50.0, f"seed {seed}"


def test_a_large_inertia_searches_far_and_a_small_one_near(sized):
    """The text says a large w eases the local search; it is the other way round."""
    for seed in range(sized(10, 200)):
        large, small = (swarm(weight, 0.5, seed, c1=1.0, c2=1.0)[-1] for weight in (0.9, 0.2))
        assert large > small, f"seed {seed}"


# B4: the sample time.


def test_a_step_of_1_cm_each_10_ms_asks_for_more_than_the_arm_can():
    """Joint rates of 8-neighbour moves in the 200 x 200 cm environment, and what rest to rest would take."""
    turns = moves_rad()
    rates = turns / 0.01
    assert np.median(rates) == pytest.approx(2.8, abs=0.05)
    assert np.percentile(rates, 99) > 14.0
    speed, acceleration = 2.0, 10.0
    reaches = turns > speed**2 / acceleration
    rest_to_rest = np.where(reaches, turns / speed + speed / acceleration, 2 * np.sqrt(turns / acceleration))
    assert np.median(rest_to_rest) == pytest.approx(0.106, abs=0.001)
    assert np.percentile(rest_to_rest, 99) > 0.237
    assert np.mean(rates <= speed) < 0.4


def moves_rad():
    """The larger joint's turn on every 8-neighbour move within reach, elbow down."""
    x, y = np.meshgrid(np.arange(-100, 101), np.arange(-100, 101))

    def pose(x, y):
        theta2 = np.arccos(np.clip((x * x + y * y - 2 * L * L) / (2 * L * L), -1, 1))
        return np.arctan2(y, x) - 0.5 * theta2, theta2  # equal links

    turns = []
    for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
        (a1, a2), (b1, b2) = pose(x, y), pose(x + dx, y + dy)
        r, s = np.hypot(x, y), np.hypot(x + dx, y + dy)
        within = (np.minimum(r, s) >= 1) & (np.maximum(r, s) <= 100)
        turn1 = abs((b1 - a1 + np.pi) % (2 * np.pi) - np.pi)
        turns.append(np.maximum(turn1, abs(b2 - a2))[within])
    return np.concatenate(turns)


# B5: the workspace of Table 1.


def test_90_degrees_either_way_at_joint_2_leave_an_annulus():
    r = abs(tip_by_hand(*poses_of_table_1_rad().T))
    assert r.min() == pytest.approx(50 * sqrt(2), abs=1e-9)
    assert r.max() == pytest.approx(100.0)


# B6: stop and return.

STEP_CM, HALF_CM, LAST = 5.0, 50.0, 60
X, Y = np.meshgrid(np.arange(-HALF_CM, HALF_CM + 1, STEP_CM), np.arange(-HALF_CM, HALF_CM + 1, STEP_CM))
EIGHT = np.ones((3, 3), bool)


@dataclass
class World:
    """Which nodes are free at each sample, [sample, row, column], and where the arm is to go."""

    free: np.ndarray
    start: tuple[int, int]
    goal: tuple[int, int]


def random_world(seed):
    """An arm of 2 x 25 cm among three discs that move to and fro on straight lines: a node a sample, as in paper B."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-45, 45, (2, 3, 2))
    radius, period = rng.uniform(2.5, 6, 3), rng.integers(20, 60, 3)
    samples = np.arange(LAST + 1)
    share = abs(2 * ((samples[:, None] / period) % 1.0) - 1)[:, :, None]
    centres = a + share * (b - a)
    free = np.array([free_nodes(c, radius) for c in centres])
    ends = np.argwhere(free[0])
    if len(ends) < 2:
        return None
    start, goal = (tuple(int(v) for v in ends[k]) for k in rng.choice(len(ends), 2, replace=False))
    return World(free, start, goal)


def free_nodes(centres, radius, arm=25.0, margin=1.0):
    r = np.hypot(X, Y)
    within = (r <= 2 * arm) & (r >= STEP_CM)
    theta2 = np.arccos(np.clip((r * r - 2 * arm * arm) / (2 * arm * arm), -1, 1))
    elbow = arm * np.exp(1j * (np.arctan2(Y, X) - 0.5 * theta2))
    tip = X + 1j * Y
    clear = np.ones(X.shape, bool)
    for centre, size in zip(centres @ [1, 1j], radius, strict=True):
        for p, q in ((0 * elbow, elbow), (elbow, tip)):
            along = np.clip(((centre - p) * (q - p).conj()).real / np.maximum(abs(q - p) ** 2, 1e-12), 0, 1)
            clear &= abs(centre - p - along * (q - p)) > size + margin
    return within & clear


def reachable(world):
    """Exact in space-time: the arm may wait or move to any of 8 nodes each sample; a pose must be free on arrival."""
    here = np.zeros(world.free[0].shape, bool)
    here[world.start] = world.free[0][world.start]
    for free in world.free[1:]:
        if here[world.goal]:
            return True
        here = ndimage.binary_dilation(here, EIGHT) & free
    return bool(here[world.goal])


def static_path(free, start, goal):
    """A shortest chain of 8-neighbour nodes on the first map, by growing distances; None when there is none."""
    distance = np.where(free, np.inf, np.nan)
    distance[goal] = 0.0
    front = [goal]
    while front:
        grown = []
        for j, i in front:
            for n in neighbours(j, i):
                if distance[n] > distance[j, i] + hypot(n[0] - j, n[1] - i):
                    distance[n] = distance[j, i] + hypot(n[0] - j, n[1] - i)
                    grown.append(n)
        front = grown
    if not np.isfinite(distance[start]):
        return None
    path = [start]
    while path[-1] != goal:
        path.append(min(neighbours(*path[-1]), key=lambda n: np.nan_to_num(distance[n], nan=np.inf)))
    return path


def neighbours(j, i):
    return [
        (j + dj, i + di)
        for dj in (-1, 0, 1)
        for di in (-1, 0, 1)
        if (dj or di) and 0 <= j + dj < len(X) and 0 <= i + di < len(X)
    ]


def stop_and_return(world):
    """The rule as printed: go on along the path when its next node will be free, else stop, else go back along it."""
    path = static_path(world.free[0], world.start, world.goal)
    if path is None:
        return "no path"
    at = 0
    for free in world.free[1:]:
        if path[at] == world.goal:
            return "reached"
        for then in (at + 1, at, at - 1):
            if then >= 0 and free[path[then]]:
                at = then
                break
        else:
            return "collided"
    return "reached" if path[at] == world.goal else "late"


def test_stop_and_return_as_printed_collides_where_a_way_through_space_and_time_exists(sized):
    """An obstacle can drive into an arm that waits or has gone back: the rule never leaves its path.

    How often depends on the scenes; the figure of all 500 of these stands in docs/errata.md.
    """
    outcomes = []
    for seed in range(sized(60, 500)):
        world = random_world(seed)
        if world is not None and reachable(world):
            outcomes.append(stop_and_return(world))
    collided = outcomes.count("collided") / len(outcomes)
    assert collided > 0.1, {name: outcomes.count(name) for name in set(outcomes)}
    assert outcomes.count("reached") > 0.5 * len(outcomes)
