"""Way-points: exact length, and no way to change them."""

from math import sqrt

import numpy as np
import pytest

from planarm.search.path import Path


def test_the_length_is_the_sum_of_the_straight_moves():
    path = Path.through(np.array([(0.0, 0.0), (1.0, 1.0), (3.0, 1.0), (3.0, -4.0)]), "up")
    assert path.length_cm == pytest.approx(sqrt(2.0) + 7.0, rel=1e-15)
    assert path.elbow == "up"


def test_a_single_point_has_no_length():
    path = Path.through(np.array([(3.0, 4.0)]), "down")
    assert path.length_cm == 0.0


def test_way_points_cannot_be_changed():
    points = np.zeros((2, 2))
    path = Path.through(points, "up")
    points[1] = 1.0
    assert path.points_cm[1].tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match="read-only"):
        path.points_cm[0, 0] = 1.0
