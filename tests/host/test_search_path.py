"""Way-points: exact length and corners."""

from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planarm.search.path import Path

steps = st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)).filter(any), min_size=1, max_size=30)


def test_the_length_is_the_sum_of_the_straight_moves():
    path = Path.through(np.array([(0.0, 0.0), (1.0, 1.0), (3.0, 1.0), (3.0, -4.0)]), "up")
    assert path.length_cm == pytest.approx(sqrt(2.0) + 7.0, rel=1e-15)
    assert path.elbow == "up"


def test_a_single_point_has_no_length_and_no_corner():
    path = Path.through(np.array([(3.0, 4.0)]), "down")
    assert path.length_cm == 0.0
    assert path.corners_cm().tolist() == [[3.0, 4.0]]


@given(steps)
def test_corners_keep_shape_and_length_and_every_corner_turns(moves):
    points = np.cumsum([(0, 0), *moves], axis=0).astype(float)
    path = Path.through(points, "up")
    corners = Path.through(path.corners_cm(), "up")
    assert corners.length_cm == pytest.approx(path.length_cm, rel=1e-14)
    assert corners.points_cm[[0, -1]].tolist() == points[[0, -1]].tolist()
    directions = np.diff(corners.points_cm, axis=0)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    assert np.all(np.linalg.norm(np.diff(directions, axis=0), axis=1) > 1e-6)


def test_turning_back_is_a_corner():
    path = Path.through(np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 0.0)]), "up")
    assert path.corners_cm().tolist() == [[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]]


def test_way_points_cannot_be_changed():
    points = np.zeros((2, 2))
    path = Path.through(points, "up")
    points[1] = 1.0
    assert path.points_cm[1].tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match="read-only"):
        path.points_cm[0, 0] = 1.0
