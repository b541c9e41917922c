"""Shapes of obstacles: the meaning of a diameter, and the flat arrays."""

from math import hypot, sqrt

import numpy as np
import pytest
import shapely

from host_scenes import star_polygon
from planarm.model.shapes import Circle, Polygon, bounding_circle, obstacle_set, shape_of
from planarm.scene import Obstacle

CENTER, DIAMETER = (7.0, -3.0), 10.0


def corners(shape):
    polygon = shape_of(Obstacle(shape, CENTER, DIAMETER))
    return [(x - CENTER[0], y - CENTER[1]) for x, y in polygon.vertices_cm]


def has(points, x, y):
    return any(hypot(px - x, py - y) < 1e-12 for px, py in points)


@pytest.mark.parametrize(("shape", "count"), [("square", 4), ("diamond", 4), ("triangle", 3), ("hexagon", 6)])
def test_named_polygons_are_regular_and_inscribed_in_the_circle_of_their_diameter(shape, count):
    points = corners(shape)
    assert len(points) == count
    assert [hypot(*p) for p in points] == pytest.approx([5.0] * count)
    sides = [hypot(a[0] - b[0], a[1] - b[1]) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    assert sides == pytest.approx([sides[0]] * count)


def test_the_square_is_axis_aligned_with_side_diameter_over_root_two():
    half = DIAMETER / sqrt(2) / 2
    assert all(has(corners("square"), sx * half, sy * half) for sx in (-1, 1) for sy in (-1, 1))


def test_the_diamond_stands_on_its_corner_and_the_triangle_points_up():
    assert all(has(corners("diamond"), *p) for p in [(5, 0), (0, 5), (-5, 0), (0, -5)])
    assert has(corners("triangle"), 0, 5)


def test_the_hexagon_has_a_vertex_towards_plus_x():
    assert has(corners("hexagon"), 5, 0)


def test_a_circle_has_half_the_diameter_as_radius():
    assert shape_of(Obstacle("circle", CENTER, DIAMETER)) == Circle(CENTER, 5.0)


def test_bounding_circles_hold_their_polygons():
    rng = np.random.default_rng(2)
    for _ in range(50):
        polygon = Polygon(star_polygon(rng, rng.uniform(-20, 20, 2), 0.5, 6.0, 8))
        bound = bounding_circle(polygon)
        assert all(
            hypot(x - bound.center_cm[0], y - bound.center_cm[1]) <= bound.radius_cm for x, y in polygon.vertices_cm
        )


def test_the_flat_arrays_keep_order_and_tell_circles_from_polygons():
    square = Polygon.inscribed("square", (1.0, 2.0), 3.0)
    flat = obstacle_set([Circle((5.0, 6.0), 2.0), square, Circle((0.0, 0.0), 1.0)])
    assert flat.first_vertex.tolist() == [0, 0, 4, 4]
    assert flat.radii_cm == pytest.approx([2.0, 1.5, 1.0])
    assert shapely.Polygon(flat.vertices_cm).equals(shapely.Polygon(square.vertices_cm))
    assert obstacle_set([]).centers_cm.shape == (0, 2)


def test_an_obstacle_without_its_measures_is_refused():
    with pytest.raises(ValueError, match="a hexagon needs center_cm and diameter_cm"):
        shape_of(Obstacle("hexagon"))
