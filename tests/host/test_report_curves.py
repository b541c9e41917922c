"""Curves over time show the numbers they were given, in the units they name."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from planarm.report import curves
from planarm.report.curves import draw_joint_angles, draw_step_rates


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures on their way to the file."""
    seen: list[Figure] = []
    save = curves.save

    def spy(figure: Figure, path: Path) -> None:
        seen.append(figure)
        save(figure, path)

    monkeypatch.setattr(curves, "save", spy)
    return seen


def words(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def level_lines(axes: Axes) -> list[float]:
    return [float(line.get_ydata()[0]) for line in axes.lines if line.get_linestyle() == "--"]


T_S = np.linspace(0.0, 2.0, 50)
Q_RAD = np.stack((np.radians(10 + 40 * T_S), np.radians(-120 + 10 * T_S)), axis=1)


def test_angles_are_drawn_in_degrees_with_their_ends(figures: list[Figure], tmp_path: Path) -> None:
    draw_joint_angles(tmp_path / "q.png", T_S, Q_RAD, title="Angles", subtitle="of a test")
    first, second = figures[0].axes
    assert (first.get_ylabel(), second.get_ylabel(), second.get_xlabel()) == ("θ₁ (°)", "θ₂ (°)", "time (s)")
    for axes, column in zip((first, second), Q_RAD.T, strict=True):
        curve = axes.lines[0].get_xydata()
        assert curve[:, 0].tolist() == T_S.tolist()
        assert curve[:, 1] == pytest.approx(np.degrees(column))
    assert words(first) == ["10.0°", "90.0°", "of a test"]
    assert words(second) == ["−120.0°", "−100.0°"]
    assert first.get_title(loc="left") == "Angles"


def test_limits_are_told_in_words_and_drawn_where_the_curve_comes_near(figures: list[Figure], tmp_path: Path) -> None:
    limits = (np.radians((-90.0, 270.0)), np.radians((-125.0, 125.0)))
    draw_joint_angles(tmp_path / "q.png", T_S, Q_RAD, title="Angles", limits_rad=limits)
    first, second = figures[0].axes
    assert "limits −90.0° and 270.0°" in words(first)
    assert level_lines(first) == []
    assert level_lines(second) == pytest.approx([-125.0])
    assert second.get_ylim()[0] < -125.0 < second.get_ylim()[1] < 125.0


def test_a_joint_that_does_not_move_is_drawn(figures: list[Figure], tmp_path: Path) -> None:
    draw_joint_angles(tmp_path / "q.png", [0.0], [[1.0, 2.0]], title="One moment", limits_rad=[(0, 2), (0, 3)])
    assert len(figures[0].axes) == 2


@pytest.mark.parametrize(
    ("t_s", "q_rad"), [([0, 1], [[1, 2]]), ([0, 1], [1, 2]), ([], np.empty((0, 2))), ([[0]], [[1]])]
)
def test_times_and_angles_must_fit(t_s: object, q_rad: object, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected \(m,\) and \(m, joints\)"):
        draw_joint_angles(tmp_path / "q.png", t_s, q_rad, title="Angles")


def test_rates_are_one_over_the_time_between_steps(figures: list[Figure], tmp_path: Path) -> None:
    ticks = [[0, 16_000, 24_000, 28_000], [8_000, 40_000]]
    signs = [[1, 1, 1, -1], [1, 1]]
    draw_step_rates(tmp_path / "rates.png", ticks, ticks_hz=16e6, title="Rates", limit_hz=4_500, directions=signs)
    first, second = figures[0].axes
    assert first.lines[0].get_xydata().tolist() == [[0, 1000], [0.001, 2000], [0.0015, -4000], [0.00175, -4000]]
    assert second.lines[0].get_xydata().tolist() == [[0.0005, 500], [0.0025, 500]]
    assert words(first) == ["4 steps, fastest 4,000 steps/s, limit 4,500"]
    assert words(second) == ["2 steps, fastest 500 steps/s, limit 4,500"]
    assert level_lines(first) == [-4500, 4500]
    assert level_lines(second) == []
    assert first.get_ylabel() == "joint 1 (steps/s)"


def test_a_resting_joint_has_no_rate(figures: list[Figure], tmp_path: Path) -> None:
    draw_step_rates(tmp_path / "rates.png", [[], [5]], ticks_hz=16e6, title="Rates")
    assert [words(axes) for axes in figures[0].axes] == [["0 steps, so no rate"], ["1 steps, so no rate"]]


def test_steps_out_of_order_and_missing_directions_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="joint 2: step 2 at tick 9 does not come after step 1"):
        draw_step_rates(tmp_path / "r.png", [[1, 2], [3, 9, 9]], ticks_hz=16e6, title="Rates")
    with pytest.raises(ValueError, match="joint 1: 1 directions for 2 steps"):
        draw_step_rates(tmp_path / "r.png", [[1, 2]], ticks_hz=16e6, title="Rates", directions=[[1]])
    with pytest.raises(ValueError, match="there is no joint to draw"):
        draw_step_rates(tmp_path / "r.png", [], ticks_hz=16e6, title="Rates")
