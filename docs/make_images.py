"""Make the pictures of README and docs anew: `python docs/make_images.py [FOLDER]`.

They come from the example scenes and the code alone, so the same sources and the same matplotlib give the same bytes.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from planarm.envelope.maps import envelope_maps
from planarm.experiments.pictures import draw_angles, draw_free_space, draw_paper_stencils, draw_path
from planarm.experiments.published import CHS
from planarm.experiments.table2 import load_case
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.shapes import shape_of
from planarm.notice import silent
from planarm.pipeline import plan_scene
from planarm.report import draw_workspace
from planarm.report.envelope import draw_envelope
from planarm.report.style import INK, JOINT_COLOURS, QUIET, TEXT_SIZE, dress, new_figure, save, set_title
from planarm.scene import Algorithm, PlannerSpec, load_scene
from planarm.search.grid_search import find_path
from planarm.workspace.free_map import build_free_map
from planarm_sim.plant import Motor
from planarm_sim.plant.pull_out import pull_out_steps_s

DOCS = Path(__file__).resolve().parent
EXAMPLES = DOCS.parent / "examples"
CURVE_POINTS = 600
LOAD_SHARES = (0.25, 0.35, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
POSES_SHOWN = 9


def make_images(folder: Path) -> list[Path]:
    """Write all pictures into the folder and return their files."""
    names = ("stencils", "table1_case1", "case1_free_space", "case1_chs_joints", "case2_chs", "elbow_change")
    files = [folder / f"{name}.png" for name in names]
    draw_paper_stencils(files[0])
    _draw_plan(EXAMPLES / "table1_case1.toml", files[1])
    _draw_cases(*files[2:5])
    _draw_joint_plan(EXAMPLES / "elbow_change.toml", files[5])
    files += [folder / "pull_out.png", folder / "envelope.png", folder / "search_growth.png"]
    _draw_pull_out(files[-3])
    _draw_envelope(EXAMPLES / "table1_case1.toml", files[-2])
    _draw_growth(files[-1])
    return files


def _draw_envelope(scene_file: Path, target: Path) -> None:
    """Draw the maps that `planarm envelope` makes of a scene."""
    scene = load_scene(scene_file)
    draw_envelope(target, envelope_maps(scene, "up"), scene.name, scene.arm.base_cm)


def _draw_plan(scene_file: Path, target: Path) -> None:
    """Draw the plan that `planarm run` makes of a scene: the path with its corners blended, and the arm along it."""
    plan = plan_scene(load_scene(scene_file), silent)
    q_rad = plan.trajectory.sample(np.linspace(0.0, plan.trajectory.duration_s, CURVE_POINTS))[0]
    planner = plan.scene.planner
    draw_path(
        target,
        plan.scene,
        plan.free_map,
        plan.path,
        subtitle=f"CHS, {planner.neighbours} neighbours, every move proved free: {plan.path.length_cm:.4f} cm in "
        f"{plan.trajectory.duration_s:.2f} s",
        tip_curve_cm=forward(Arm.from_spec(plan.scene.arm), q_rad)[:, -1],
    )


def _draw_pull_out(target: Path) -> None:
    """Draw which torque the emulated motor's field makes up to which speed, for three supplies, beside V / (2 L I)."""
    figure = new_figure(9.0, 4.2)
    axes = figure.subplots()
    dress(axes)
    for colour, supply_v in zip(JOINT_COLOURS, (12.0, 24.0, 36.0), strict=False):
        motor = Motor(supply_v=supply_v, current_a=1.7, detent_torque_nm=0.0)
        own_nm = motor.damping_nm_s * 2.0 * np.pi / motor.steps_per_rev  # of its damping, for a full step a second
        loads_nm = [share * motor.peak_torque_nm - own_nm * motor.corner_steps_s for share in LOAD_SHARES]
        speeds = [pull_out_steps_s(motor, load, acceleration_steps_s2=8000.0) for load in loads_nm]
        made_nm = [load + own_nm * speed for load, speed in zip(loads_nm, speeds, strict=True)]
        axes.plot(speeds, made_nm, "o-", color=colour, linewidth=2.0, label=f"{supply_v:g} V")
        axes.axvline(motor.corner_steps_s, color=colour, linewidth=1.2, linestyle=(0, (5, 3)))
    axes.set_xlabel("full steps a second", fontsize=TEXT_SIZE, color=INK)
    axes.set_ylabel("torque of load and own damping (N m)", fontsize=TEXT_SIZE, color=INK)
    axes.set_xlim(0.0)
    axes.set_ylim(0.0)
    axes.legend(frameon=False)
    set_title(axes, "Pull-out of the emulated motor", "dashed: V / (2 L I); 2.8 mH, 1.7 A, 1/16 steps")
    save(figure, target)


GROWTH_CELLS_CM = (2.0, 1.0, 0.5, 0.25, 0.125)
NAMES = {"a_star": "A*", "modified_a_star": "Modified A*", "chs": "CHS"}
GROWTH_STENCILS: tuple[tuple[Algorithm, int], ...] = (
    ("a_star", 8),
    ("modified_a_star", 24),
    ("modified_a_star", 48),
    ("chs", 56),
    ("chs", 80),
)


def _draw_growth(target: Path) -> None:
    """Draw how the search's work grows with cells and with neighbours, counted, not timed: the same everywhere."""
    scene = load_scene(DOCS.parent / "examples" / "table1_case1.toml")
    free, work = [], []
    for cell_cm in GROWTH_CELLS_CM:
        free_map = build_free_map(replace(scene, workspace=replace(scene.workspace, cell_cm=cell_cm)))
        ends = (48.0, 4.0), (2.0, 44.0)  # nodes at every cell size
        free.append(free_map.free_nodes)
        work.append([find_path(free_map, *ends, PlannerSpec(*which, "run", 1, "proved")) for which in GROWTH_STENCILS])
    figure = new_figure(9.0, 3.6)
    left, right = figure.subplots(1, 2)
    for k, (algorithm, neighbours) in enumerate(GROWTH_STENCILS[::2]):
        results = [row[2 * k] for row in work]
        left.loglog(
            free, [r.expanded for r in results], "o-", color=JOINT_COLOURS[k], label=f"{NAMES[algorithm]} {neighbours}"
        )
    left.loglog(free, free, "--", color=QUIET, label="all free nodes")
    left.set_xlabel("free nodes of the map")
    left.set_ylabel("nodes expanded")
    counts = [neighbours for _, neighbours in GROWTH_STENCILS]
    for place, name, marker in ((0, "expanded", "o-"), (1, "put on the open list", "s-")):
        values = [(r.expanded, r.generated)[place] for r in work[-1]]
        right.plot(counts, values, marker, color=JOINT_COLOURS[place], label=name)
    right.set_xlabel(f"neighbours, cells of {GROWTH_CELLS_CM[-1]:g} cm")
    right.set_ylabel("nodes")
    right.yaxis.set_major_formatter("{x:,.0f}")
    right.set_ylim(bottom=0.0)
    for axes in (left, right):
        dress(axes)
        axes.legend(frameon=False, fontsize=8)
    save(figure, target)


def _draw_cases(free_space: Path, joints: Path, hopping: Path) -> None:
    """Draw case 1's free space and joint angles, and the path of case 2 that hops over blocked cells."""
    case1, case2 = load_case(1), load_case(2)
    draw_free_space(free_space, case1.scene, case1.free_map)
    path = case1.search(CHS, "proved").path
    draw_angles(joints, case1.scene, case1.free_map, path, subtitle=f"CHS, 56 neighbours, {path.length_cm:.4f} cm")
    path = case2.search(CHS, "nodes").path
    words = f"CHS, 56 neighbours, {path.length_cm:.4f} cm; only nodes checked, as the paper reads"
    draw_path(hopping, case2.scene, case2.free_map, path, subtitle=words)


def _draw_joint_plan(scene_file: Path, target: Path) -> None:
    """Draw a plan made in joint space, with its way-points and the arm on its way."""
    plan = plan_scene(load_scene(scene_file), silent)
    arm, joint = Arm.from_spec(plan.scene.arm), plan.joint
    q_rad = plan.trajectory.sample(np.linspace(0.0, plan.trajectory.duration_s, CURVE_POINTS))[0]
    shown = np.linspace(0, CURVE_POINTS - 1, POSES_SHOWN).round().astype(int)
    draw_workspace(
        target,
        x_cm=plan.free_map.x_cm,
        y_cm=plan.free_map.y_cm,
        region=plan.free_map.region,
        obstacles=[shape_of(obstacle) for obstacle in plan.scene.obstacles],
        path_points_cm=forward(arm, joint.poses_rad)[:, -1],
        poses_cm=forward(arm, q_rad[shown]),
        title=plan.scene.name,
        subtitle=f"joint space: the elbow changes its side at full stretch; {plan.trajectory.duration_s:.2f} s",
        tip_curve_cm=forward(arm, q_rad)[:, -1],
    )


if __name__ == "__main__":
    make_images(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "images")
