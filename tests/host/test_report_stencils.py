"""The picture of stencils shows every neighbour, tells drawn from undrawn ones, and draws no other."""

import numpy as np
import pytest

from planarm.report import stencils
from planarm.report.stencils import StencilPanel, draw_stencils


@pytest.fixture
def figures(monkeypatch):
    """The figures on their way to the file."""
    seen = []
    save = stencils.save

    def spy(figure, path):
        seen.append(figure)
        save(figure, path)

    monkeypatch.setattr(stencils, "save", spy)
    return seen


OFFSETS = np.array([(1, 0), (0, 1), (-1, 0), (0, -2)])


def shown(axes):
    """The lines from the node, and all marked places beside the quiet grid."""
    lines = {tuple(line.get_xydata()[1]) for line in axes.lines if line.get_linestyle() == "-"}
    marks = [line.get_xydata() for line in axes.lines if line.get_marker() == "o"]
    return lines, [{tuple(place) for place in mark} for mark in marks]


def test_each_neighbour_has_a_line_and_a_mark(figures, tmp_path):
    draw_stencils(tmp_path / "new" / "s.png", [[StencilPanel("cross", OFFSETS, radius=2.0)]], title="One")
    (axes,) = figures[0].axes
    everything = {tuple(offset) for offset in OFFSETS.astype(float)}
    assert shown(axes) == (everything, [everything])
    assert axes.get_title() == "cross"
    assert axes.patches[0].radius == 2.0
    assert (tmp_path / "new" / "s.png").read_bytes().startswith(b"\x89PNG")


def test_neighbours_that_are_not_drawn_have_no_line(figures, tmp_path):
    used = np.array([True, False, True, False])
    draw_stencils(tmp_path / "s.png", [[StencilPanel("two", OFFSETS, used)]], title="Two of four")
    lines, (drawn, left) = shown(figures[0].axes[0])
    assert lines == drawn == {(1.0, 0.0), (-1.0, 0.0)}
    assert left == {(0.0, 1.0), (0.0, -2.0)}


def test_panels_of_a_row_have_one_scale(figures, tmp_path):
    row = [StencilPanel("small", OFFSETS[:3]), StencilPanel("large", OFFSETS)]
    draw_stencils(tmp_path / "s.png", [row], title="Two")
    assert figures[0].axes[0].get_xlim() == figures[0].axes[1].get_xlim()


def test_the_same_stencils_give_the_same_bytes(tmp_path):
    for name in ("a.png", "b.png"):
        draw_stencils(tmp_path / name, [[StencilPanel("cross", OFFSETS)]], title="Again")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    "rows", [[], [[]], [[StencilPanel("flat", OFFSETS.ravel())]], [[StencilPanel("x", OFFSETS, [1])]]]
)
def test_what_is_no_stencil_is_refused(rows, tmp_path):
    with pytest.raises(ValueError, match=r"no stencil|not \(n, 2\)"):
        draw_stencils(tmp_path / "s.png", rows, title="None")
    assert not (tmp_path / "s.png").exists()
