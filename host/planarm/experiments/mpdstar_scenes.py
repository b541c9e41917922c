"""Paper A's scenarios as scenes, and those that its claims are measured on.

The paper prints pictures only: no masses, no lengths, no coordinates. What stands here is chosen after what the text
says of each figure, and said so where results are shown (`ASSUMPTIONS`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from planarm.scene import EdgeCost, Obstacle, Point, Scene, parse_scene

JOINT: Final = "[[joints]]\nmax_speed_deg_s = 90\nmax_acceleration_deg_s2 = 360\n"

ASSUMPTIONS: Final = (
    "Figures 12 to 17 give no numbers: link lengths, obstacles, start and goal are chosen after the text.",
    "Masses: 0.4 kg a metre of link (aluminium tube), 0.15 kg at each link's end; the arm stands upright.",
    "Motors: Table 7's cannot move the arm (shown below); here a 24 V motor of the 60 W class behind 1 : 100, with one "
    "constant for torque and back-EMF (docs/scene.md, table dc_motors). Energies are joules; the paper gives no unit.",
    "An edge is a quintic from rest to rest, as fast as 90 deg/s and 360 deg/s2 allow; the paper gives no duration.",
    "Nodes: as many as the paper's table says, drawn at random; the first seed whose graph joins start and goal.",
)


@dataclass(frozen=True, slots=True)
class Case:
    """One of the paper's cases, and what Tables 8 to 11 print of it."""

    title: str
    figure: int
    lengths_cm: tuple[float, ...]
    obstacles: tuple[str, ...]
    start_deg: tuple[float, ...]
    goal_deg: tuple[float, ...]
    nodes: int
    printed_joints: tuple[float, ...]
    """Energy of each joint as printed, no unit; empty where the paper gives the total only."""
    printed_total: float
    printed_path: int


def circle(x: float, y: float, diameter: float) -> str:
    """Return a circle as a scene file writes it."""
    return f'[[obstacles]]\nshape = "circle"\ncenter_cm = [{x}, {y}]\ndiameter_cm = {diameter}\n'


def shape(name: str, x: float, y: float, diameter: float) -> str:
    """Return a named shape as a scene file writes it."""
    return f'[[obstacles]]\nshape = "{name}"\ncenter_cm = [{x}, {y}]\ndiameter_cm = {diameter}\n'


def polygon(*vertices: tuple[float, float]) -> str:
    """Return a polygon as a scene file writes it."""
    return f'[[obstacles]]\nshape = "polygon"\nvertices_cm = {[list(v) for v in vertices]}\n'


CASES: Final[dict[int, Case]] = {
    1: Case(
        "divider",
        12,
        (22.0, 18.0, 14.0),
        (polygon((-1.5, 30), (1.5, 30), (1.5, 60), (-1.5, 60)),),
        (62.0, 25.0, -20.0),
        (118.0, -25.0, 20.0),
        87,
        (32.77, 16.90, 3.93),
        53.61,
        16,
    ),
    2: Case(
        "crowded",
        13,
        (14.0, 14.0, 14.0, 14.0),
        (
            circle(38, 26, 8),
            shape("square", 14, 44, 9),
            shape("triangle", -16, 40, 9),
            shape("hexagon", -40, 22, 9),
            shape("diamond", -30, -8, 8),
            circle(30, -12, 8),
        ),
        (5.0, 10.0, 10.0, 5.0),
        (150.0, 10.0, 20.0, 15.0),
        86,
        (62.88, 33.39, 13.27, 3.52),
        113.1,
        11,
    ),
    3: Case(
        "tight, seven links",
        14,
        (6.0, 6.0, 6.0, 6.0, 6.0, 6.0, 18.0),
        (
            polygon((-42, 36), (42, 36), (42, 42), (-42, 42)),
            polygon((-42, -42), (42, -42), (42, -36), (-42, -36)),
            circle(26, 22, 8),
            circle(-26, -22, 8),
        ),
        (-20.0, 10.0, 10.0, 10.0, 0.0, -10.0, -10.0),
        (160.0, 10.0, 10.0, 10.0, 0.0, -10.0, -10.0),
        152,
        (),
        1702.0,
        13,
    ),
    4: Case(
        "large obstacle",
        15,
        (24.0, 18.0, 12.0),
        (shape("hexagon", 0, 44, 34),),
        (35.0, 25.0, 20.0),
        (145.0, -25.0, -20.0),
        42,
        (25.68, 11.64, 2.22),
        39.54,
        11,
    ),
}


def case_scene(number: int, nodes: int | None = None, seed: int = 1, cost: EdgeCost = "consumed") -> Scene:
    """Return one of the paper's four cases, with the paper's number of nodes or another."""
    case = CASES[number]
    return arm_scene(
        f"case {number}: {case.title}",
        case.lengths_cm,
        "".join(case.obstacles),
        (case.start_deg, case.goal_deg),
        nodes or case.nodes,
        seed=seed,
        cost=cost,
    )


ZONES_CM: Final[tuple[tuple[Point, ...], ...]] = (
    ((26.0, 9.0), (46.0, 8.0), (38.0, 28.0)),
    ((-26.0, 9.0), (-38.0, 28.0), (-46.0, 8.0)),
)
"""Fig. 17's triangles on both sides."""


def zones_scene(nodes: int, seed: int = 1) -> Scene:
    """Return three links between two triangles, around the right one of which the way leads."""
    triangles = "".join(polygon(*zone) for zone in ZONES_CM)
    ends = ((-25.0, 15.0, 10.0), (75.0, 15.0, 10.0))
    return arm_scene("no enter zones", (20.0, 16.0, 12.0), triangles, ends, nodes, seed=seed, cost="consumed")


def bench_scene(nodes: int, cost: EdgeCost = "consumed", seed: int = 1, *, links: int = 2) -> Scene:
    """Return two or three links of 50 cm among four obstacles, with room to pass them on several sides."""
    obstacles = circle(30, 22, 7) + circle(-22, 34, 6) + circle(-36, -18, 7) + circle(16, -38, 6)
    lengths = (30.0, 20.0) if links == 2 else (20.0, 17.0, 13.0)
    ends = ((0.0, 60.0, 0.0)[:links], (160.0, 30.0, 0.0)[:links])
    return arm_scene("bench", lengths, obstacles, ends, nodes, seed=seed, cost=cost, sampling="halton")


def random_scene(seed: int, links: int, nodes: int, cost: EdgeCost) -> Scene:
    """Return an arm among random obstacles, for distributions."""
    rng = np.random.default_rng(seed)
    lengths = tuple(float(round(x, 1)) for x in rng.uniform(12.0, 24.0, links))
    reach = sum(lengths)
    scene = arm_scene(
        "random", lengths, "", ((0.0,) * links, (90.0,) + (0.0,) * (links - 1)), nodes, seed=seed, cost=cost
    )
    obstacles = []
    for _ in range(int(rng.integers(2, 6))):
        angle, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.5, 0.95) * reach
        center: Point = (float(away * np.cos(angle)), float(away * np.sin(angle)))
        obstacles.append(Obstacle("circle", center_cm=center, diameter_cm=float(rng.uniform(4.0, 12.0))))
    return replace(scene, obstacles=tuple(obstacles))


def arm_scene(
    name: str,
    lengths_cm: tuple[float, ...],
    obstacles: str,
    ends_deg: tuple[tuple[float, ...], tuple[float, ...]],
    nodes: int,
    *,
    seed: int,
    cost: EdgeCost,
    sampling: str = "random",
) -> Scene:
    """Return an upright arm with the motors and masses of `ASSUMPTIONS`."""
    reach, links = sum(lengths_cm) + 5.0, len(lengths_cm)
    text = f"""
name = "{name}"
[arm]
link_lengths_cm = {list(lengths_cm)}
link_width_cm = 2
elbow = "either"
[workspace]
x_cm = [{-reach}, {reach}]
y_cm = [{-reach}, {reach}]
[planner]
algorithm = "mpd_star_lite"
neighbours = 12
seed = {seed}
[roadmap]
nodes = {nodes}
sampling = "{sampling}"
cost = "{cost}"
[mechanics]
gravity = true
end_masses_kg = {[0.15] * links}
[task]
start_deg = {list(ends_deg[0])}
goal_deg = {list(ends_deg[1])}
{obstacles}
"""
    return parse_scene(text + links * JOINT, f"paper A, {name}")
