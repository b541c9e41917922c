"""The neighbourhoods of paper C (figs. 2, 4, 6 and 8) and the cells that a straight move crosses."""

from math import hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planarm.scene.load import NEIGHBOURS
from planarm.search.stencils import DRAWN, cover, neighbour_counts, primitive, stencil

ALL = [(algorithm, count) for algorithm in NEIGHBOURS for count in neighbour_counts(algorithm)]
offset = st.integers(-6, 6)


@pytest.mark.parametrize(("algorithm", "count"), ALL)
def test_a_stencil_has_the_published_number_of_nodes_and_the_symmetry_of_the_lattice(algorithm, count):
    offsets = stencil(algorithm, count)
    nodes = set(map(tuple, offsets.tolist()))
    assert offsets.shape == (count, 2) and offsets.dtype == np.int16
    assert len(nodes) == count and (0, 0) not in nodes
    assert all({(-x, y), (x, -y), (y, x)} <= nodes for x, y in nodes)


def test_the_scene_file_and_the_search_know_the_same_neighbourhoods():
    assert {a: set(counts) for a, counts in NEIGHBOURS.items()} == {a: set(neighbour_counts(a)) for a in NEIGHBOURS}


@pytest.mark.parametrize(("count", "reach", "corner"), [(8, 1, 0), (20, 2, 1), (44, 3, 1), (68, 4, 3)])
def test_octagons_are_squares_less_the_same_nodes_at_each_corner(count, reach, corner):
    """Paper C, fig. 6: squares of 8, 24, 48 and 80 nodes less 0, 1, 1 and 3 at each corner."""
    nodes = set(map(tuple, stencil("chaos_a_star", count).tolist()))
    square = {(x, y) for x in range(-reach, reach + 1) for y in range(-reach, reach + 1)} - {(0, 0)}
    missing = square - nodes
    assert nodes <= square and len(missing) == 4 * corner
    for sx, sy in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        assert sum(x * sx > 0 and y * sy > 0 for x, y in missing) == corner
    assert all(abs(x) + abs(y) > max(abs(a) + abs(b) for a, b in nodes) for x, y in missing)


def test_chaos_a_star_draws_the_published_shares():
    """Paper C, fig. 6: 5, 12, 23 and 34 random neighbours."""
    assert DRAWN == {8: 5, 20: 12, 44: 23, 68: 34}


@pytest.mark.parametrize(("count", "r2"), [(12, 4), (28, 9), (48, 16), (56, 17), (80, 25)])
def test_chs_takes_all_nodes_of_a_disc(count, r2):
    """Paper C, fig. 8: radii 2, 3, 4 and 5 cells; the 56 nodes of its results are those with r^2 <= 17."""
    nodes = set(map(tuple, stencil("chs", count).tolist()))
    assert nodes == {(x, y) for x in range(-6, 7) for y in range(-6, 7) if 0 < x * x + y * y <= r2}


def test_an_unknown_neighbourhood_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=r"planner\.neighbours = 9 is not defined for chs; choose 12, 28, 48, 56, 80"):
        stencil("chs", 9)


@pytest.mark.parametrize(("algorithm", "count"), ALL)
def test_every_offset_is_a_multiple_of_one_primitive_offset(algorithm, count):
    offsets = set(map(tuple, stencil(algorithm, count).tolist()))
    kept = set(map(tuple, primitive(stencil(algorithm, count)).tolist()))
    assert kept <= offsets
    multiples = {(k * x, k * y) for x, y in kept for k in range(1, 6)}
    assert offsets <= multiples
    assert not kept & {(k * x, k * y) for x, y in kept for k in range(2, 6)}


@given(offset, offset, st.floats(0.0, 1.0))
def test_a_cover_holds_every_point_of_the_move(dx, dy, t):
    x, y = t * dx, t * dy
    assert any(abs(x - cx) <= 0.5 + 1e-12 and abs(y - cy) <= 0.5 + 1e-12 for cx, cy in cover(dx, dy))


@given(offset, offset)
def test_a_cover_has_no_cell_whose_inside_the_move_does_not_cross(dx, dy):
    """A cell is crossed inside exactly when its corners lie strictly on both sides of the line."""
    for cx, cy in cover(dx, dy):
        sides = [dx * (cy + b) - dy * (cx + a) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]
        assert (min(sides) < 0.0 < max(sides)) or (dx, dy) == (0, 0)


@given(offset, offset)
def test_a_cover_is_the_same_from_both_ends(dx, dy):
    assert {(dx + x, dy + y) for x, y in cover(-dx, -dy)} == set(cover(dx, dy))


def test_a_diagonal_touches_its_neighbours_in_a_corner_only():
    assert cover(1, 1) == ((0, 0), (1, 1))
    assert hypot(*cover(3, 3)[-1]) == hypot(3, 3)
