"""Kinematics: paper C, eqs. 1-9, against complex numbers, round trips and differences."""

from math import pi, radians

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r, tip_jacobian

PAPER_ARM = Arm((30.0, 20.0), (0.0, 0.0), ((radians(-90), radians(270)), (-pi, pi)))
lengths = st.floats(0.5, 60.0)
coordinates = st.floats(-50.0, 50.0)
angles = st.floats(-pi, pi)


@given(st.lists(st.tuples(lengths, angles), min_size=1, max_size=7), coordinates, coordinates)
@settings(max_examples=60, deadline=None)
def test_each_joint_is_a_sum_of_turned_links(links, base_x, base_y):
    arm = Arm(tuple(length for length, _ in links), (base_x, base_y), ((-pi, pi),) * len(links))
    place, heading, expected = complex(base_x, base_y), 0.0, [complex(base_x, base_y)]
    for length, angle in links:
        heading += angle
        place += length * np.exp(1j * heading)
        expected.append(place)
    joints = forward(arm, [angle for _, angle in links])
    assert joints[:, 0] + 1j * joints[:, 1] == pytest.approx(expected, abs=1e-10)


def test_many_poses_at_once_equal_one_at_a_time():
    q = np.random.default_rng(1).uniform(-pi, pi, (4, 5, 2))
    joints = forward(PAPER_ARM, q)
    assert joints.shape == (4, 5, 3, 2)
    assert np.array_equal(joints[2, 3], forward(PAPER_ARM, q[2, 3]))


@given(lengths, lengths, coordinates, coordinates, angles, st.floats(1e-3, pi - 1e-3), st.sampled_from(["up", "down"]))
@settings(max_examples=150, deadline=None)
def test_inverse_gives_back_the_pose_on_its_elbow_side(l1, l2, base_x, base_y, theta1, bend, elbow):
    assume(abs(l1 - l2) > 1e-2)
    arm = Arm((l1, l2), (base_x, base_y), ((-pi, pi), (-pi, pi)))
    q = np.array([theta1, -bend if elbow == "up" else bend])
    tip = forward(arm, q)[-1]
    found = inverse_2r(arm, tip, elbow)
    assert forward(arm, found)[-1] == pytest.approx(tip, abs=1e-7)
    turn = (found[0] - q[0]) / (2 * pi)
    assert found[1] == pytest.approx(q[1], abs=1e-6)
    assert turn == pytest.approx(round(turn), abs=1e-6)


@pytest.mark.parametrize(("elbow", "sign"), [("up", -1), ("down", 1)])
def test_theta1_lies_in_the_turn_around_the_middle_of_its_limits(elbow, sign):
    arm = Arm((30.0, 20.0), (0.0, 0.0), ((radians(100), radians(300)), (-pi, pi)))
    tips = 35.0 * np.column_stack([np.cos(np.linspace(0, 6.28, 200)), np.sin(np.linspace(0, 6.28, 200))])
    q = inverse_2r(arm, tips, elbow)
    assert np.all((q[:, 0] >= radians(20)) & (q[:, 0] < radians(380)))
    assert np.all(np.sign(q[:, 1]) == sign)


@pytest.mark.parametrize("tip", [(50.1, 0.0), (0.0, -9.9), (0.0, 0.0)])
def test_out_of_reach_is_nan(tip):
    assert np.all(np.isnan(inverse_2r(PAPER_ARM, tip, "up")))


@pytest.mark.parametrize("tip", [(50.0, 0.0), (30.0, 40.0), (-10.0, 0.0), (0.0, 10.0)])
def test_the_edges_of_reach_are_reached(tip):
    assert forward(PAPER_ARM, inverse_2r(PAPER_ARM, tip, "up"))[-1] == pytest.approx(tip, abs=1e-6)


def test_inverse_refuses_other_numbers_of_links():
    with pytest.raises(ValueError, match="needs 2 links, the arm has 3"):
        inverse_2r(Arm((1.0, 1.0, 1.0), (0.0, 0.0), ((-pi, pi),) * 3), (1.0, 1.0), "up")


def tips_of_the_paper():
    """The annulus 20 <= r <= 50 cm of paper C's workspace, on whole centimetres."""
    x, y = np.meshgrid(np.arange(-50.0, 51.0), np.arange(0.0, 51.0))
    r = np.hypot(x, y)
    inside = (r >= 20.0) & (r <= 50.0)
    return np.column_stack([x[inside], y[inside]])


def tip_error_cm(tips, psi_sign, direction):
    """Mean miss of paper C's inverse, with theta1 = direction + psi_sign * psi and theta2 by eq. 7."""
    l1, l2 = PAPER_ARM.link_lengths_cm
    r2 = np.sum(tips**2, axis=1)
    theta2 = np.arccos(np.clip((l1**2 + l2**2 - r2) / (2 * l1 * l2), -1, 1)) - pi  # eq. 7
    psi = np.arctan2(l2 * np.sin(theta2), l1 + l2 * np.cos(theta2))  # eq. 8
    q = np.column_stack([direction + psi_sign * psi, theta2])
    return np.mean(np.linalg.norm(forward(PAPER_ARM, q)[:, -1] - tips, axis=1))


def test_eq_9_as_printed_misses_the_point_and_the_corrected_sign_reaches_it():
    tips = tips_of_the_paper()
    with np.errstate(divide="ignore"):
        printed_direction = np.arctan(tips[:, 1] / tips[:, 0])
    direction = np.arctan2(tips[:, 1], tips[:, 0])
    assert tip_error_cm(tips, +1, printed_direction) > 40.0  # eq. 9 letter by letter
    assert tip_error_cm(tips, +1, direction) > 25.0  # with atan2, but the printed sign
    assert tip_error_cm(tips, -1, direction) < 1e-6
    by_formula = inverse_2r(PAPER_ARM, tips, "up")
    assert np.linalg.norm(forward(PAPER_ARM, by_formula)[:, -1] - tips, axis=1).max() < 1e-6


@given(st.lists(st.tuples(lengths, angles), min_size=1, max_size=5))
@settings(max_examples=40, deadline=None)
def test_jacobian_is_the_derivative_of_the_tip(links):
    arm = Arm(tuple(length for length, _ in links), (3.0, -4.0), ((-pi, pi),) * len(links))
    q = np.array([angle for _, angle in links])
    jacobian, h = tip_jacobian(arm, q), 1e-6
    for i in range(len(q)):
        shift = np.zeros_like(q)
        shift[i] = h
        difference = (forward(arm, q + shift)[-1] - forward(arm, q - shift)[-1]) / (2 * h)
        assert jacobian[:, i] == pytest.approx(difference, abs=1e-6)
