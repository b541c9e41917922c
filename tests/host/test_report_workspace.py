"""The picture of the workspace: each region in its place and colour, told apart by everyone, the path and the arm."""

import itertools
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Circle as DrawnCircle
from matplotlib.patches import Polygon as DrawnPolygon

from planarm.report import workspace
from planarm.report.workspace import OBSTACLE_COLOUR, REGIONS, draw_workspace


@dataclass
class Map:
    x_cm: np.ndarray
    y_cm: np.ndarray
    region: np.ndarray


@dataclass
class Circle:
    center_cm: tuple[float, float]
    radius_cm: float


@dataclass
class Polygon:
    vertices_cm: tuple[tuple[float, float], ...]


MAP = Map(
    np.arange(-4.0, 5.0, 0.5),
    np.arange(0.0, 4.0, 0.5),
    np.add.outer(np.arange(8) // 4, np.arange(18) // 5).astype(np.uint8),
)
OBSTACLES = (Circle((2.5, 2.0), 0.75), Polygon(((-3.0, 1.0), (-2.0, 1.0), (-2.5, 2.0))))
PATH_CM = np.array([[3.0, 0.5], [2.0, 3.0], [0.5, 3.5]])
POSES_CM = np.array([[[0, 0], [2, 1], [3, 0.5]], [[0, 0], [1, 2], [2, 3]], [[0, 0], [-1, 2], [0.5, 3.5]]], float)


def draw(path: Path, **changes: object) -> None:
    values = {
        "x_cm": MAP.x_cm,
        "y_cm": MAP.y_cm,
        "region": MAP.region,
        "obstacles": OBSTACLES,
        "path_points_cm": PATH_CM,
        "poses_cm": POSES_CM,
        "title": "A title",
        "subtitle": "and more",
    }
    draw_workspace(path, **{**values, **changes})


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures on their way to the file."""
    seen: list[Figure] = []
    save = workspace.save

    def spy(figure: Figure, path: Path) -> None:
        seen.append(figure)
        save(figure, path)

    monkeypatch.setattr(workspace, "save", spy)
    return seen


def test_every_node_has_its_regions_colour_in_the_file(figures: list[Figure], tmp_path: Path) -> None:
    path = tmp_path / "made" / "on_the_way" / "map.png"
    bare = np.empty((0, 3, 2))
    draw(path, obstacles=(), poses_cm=bare, path_points_cm=[[-4.0, 0.0]])
    pixels = imread(path)
    (axes,) = figures[0].axes
    checked = 0
    for iy, ix in itertools.product(range(2, 8), range(2, 18)):  # clear of the two markers at (-4, 0)
        x, y = axes.transData.transform((MAP.x_cm[ix], MAP.y_cm[iy])) * 160 / figures[0].dpi
        colour = pixels[pixels.shape[0] - 1 - int(y), int(x), :3]
        assert to_hex(colour) == REGIONS[MAP.region[iy, ix]].colour.lower(), (ix, iy)
        checked += 1
    assert checked == 96


def test_the_legend_names_what_is_there_and_nothing_else(figures: list[Figure], tmp_path: Path) -> None:
    draw(tmp_path / "all.png")
    labels = [text.get_text() for text in figures[0].legends[0].get_texts()]
    assert labels == [
        "free",
        "beyond reach",
        "inner hole",
        "blocked by an obstacle",
        "joint limit or floor",
        "obstacle",
        "arm, fading in towards the goal",
        "path",
        "start",
        "goal",
    ]
    only_free = np.zeros_like(MAP.region)
    draw(tmp_path / "free.png", region=only_free, obstacles=(), tip_curve_cm=PATH_CM)
    labels = [text.get_text() for text in figures[1].legends[0].get_texts()]
    assert labels == ["free", "arm, fading in towards the goal", "path, corners blended", "start", "goal"]


def test_obstacles_are_outlined_where_they_are(figures: list[Figure], tmp_path: Path) -> None:
    draw(tmp_path / "map.png")
    circle, polygon = figures[0].axes[0].patches
    assert isinstance(circle, DrawnCircle)
    assert (tuple(circle.center), circle.radius) == (OBSTACLES[0].center_cm, OBSTACLES[0].radius_cm)
    assert isinstance(polygon, DrawnPolygon)
    assert polygon.get_xy()[:-1].tolist() == [list(vertex) for vertex in OBSTACLES[1].vertices_cm]
    assert all(patch.get_linewidth() > 1 for patch in (circle, polygon))


def test_path_and_poses_are_drawn_and_the_arm_fades_in(figures: list[Figure], tmp_path: Path) -> None:
    draw(tmp_path / "map.png")
    axes = figures[0].axes[0]
    drawn = {line.get_label(): line for line in axes.lines}
    assert np.array_equal(drawn["path"].get_xydata(), PATH_CM)
    assert drawn["start"].get_xydata().tolist() == [PATH_CM[0].tolist()]
    assert drawn["goal"].get_xydata().tolist() == [PATH_CM[-1].tolist()]
    arms = [line for line in axes.lines if len(line.get_xydata()) == 3 and np.array_equal(line.get_xydata()[0], (0, 0))]
    assert [np.array_equal(arm.get_xydata(), pose) for arm, pose in zip(arms, POSES_CM, strict=True)] == [True] * 3
    strengths = [arm.get_alpha() for arm in arms]
    assert strengths == sorted(strengths)
    assert strengths[0] < strengths[-1] == 1.0


def test_scales_are_equal_and_map_and_arm_are_in_view(figures: list[Figure], tmp_path: Path) -> None:
    far = np.array([[[0.0, 0.0], [-9.0, 1.0], [3.0, 8.0]]])
    draw(tmp_path / "map.png", poses_cm=far)
    axes = figures[0].axes[0]
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (cm)", "y (cm)")
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert left < -9.0
    assert top > 8.0
    assert right == pytest.approx(4.75)  # half a cell beyond the last node
    assert bottom <= -0.25


# Machado, Oliveira, Fernandes, "A Physiologically-based Model for Simulation of Color Vision Deficiency" (2009),
# severity 1.0, for linear RGB.
VISION = {
    "usual": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def lab(colour: str, vision: str) -> np.ndarray:
    """CIE L*a*b* (D65) of a colour as seen with this vision."""
    srgb = np.array(to_rgb(colour))
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.asarray(VISION[vision]) @ linear, 0, 1)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(to_xyz @ seen / np.array([0.9505, 1.0, 1.089]))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", VISION)
def test_everybody_tells_the_regions_apart(vision: str) -> None:
    colours = {style.label: style.colour for style in REGIONS} | {"obstacle": OBSTACLE_COLOUR}
    for (a, first), (b, second) in itertools.combinations(colours.items(), 2):
        distance = np.linalg.norm(lab(first, vision) - lab(second, vision))
        assert distance > 12, f"{a} and {b}: {distance:.1f} (a difference of 2.3 is just seen)"


def test_the_same_data_give_the_same_file(tmp_path: Path) -> None:
    draw(tmp_path / "a.png")
    draw(tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"path_points_cm": [1.0, 2.0]}, "path_points_cm has the shape"),
        ({"poses_cm": PATH_CM}, "poses_cm has the shape"),
        ({"tip_curve_cm": np.zeros((3, 3))}, "tip_curve_cm has the shape"),
        ({"region": MAP.region.T}, r"expected \(rows, columns\) = \(8, 18\)"),
        ({"region": MAP.region + np.uint8(4)}, "holds the code 8, known are 0 to 4"),
    ],
)
def test_arrays_that_do_not_fit_are_named(changes: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        draw(tmp_path / "map.png", **changes)
    assert not (tmp_path / "map.png").exists()


def test_neither_import_nor_drawing_touches_pyplot_or_loads_matplotlib_early(tmp_path: Path) -> None:
    program = (
        "import sys, planarm.report\n"
        "assert not {'matplotlib', 'rich', 'numba'} & set(sys.modules)\n"
        f"planarm.report.draw_joint_angles({str(tmp_path / 'q.png')!r}, [0, 1], [[0, 1], [1, 0]], title='q')\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "q.png").stat().st_size > 1000
