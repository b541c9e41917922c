"""Make the pictures of README and docs anew: `python docs/make_images.py [FOLDER]`.

They come from the example scenes and the code alone, so the same sources and the same matplotlib give the same bytes.
"""

import sys
from pathlib import Path

import numpy as np

from planarm.envelope.maps import envelope_maps
from planarm.experiments.pictures import draw_paper_stencils, draw_path
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.pipeline import plan_scene
from planarm.report.envelope import draw_envelope
from planarm.report.style import INK, JOINT_COLOURS, TEXT_SIZE, dress, new_figure, save, set_title
from planarm.scene import load_scene
from planarm_sim.plant import Motor
from planarm_sim.plant.pull_out import pull_out_steps_s

DOCS = Path(__file__).resolve().parent
CURVE_POINTS = 600
LOAD_SHARES = (0.2, 0.35, 0.5, 0.6, 0.7, 0.8, 0.85)


def make_images(folder: Path) -> list[Path]:
    """Write all pictures into the folder and return their files."""
    files = [folder / "stencils.png", folder / "table1_case1.png", folder / "pull_out.png"]
    draw_paper_stencils(files[0])
    _draw_plan(DOCS.parent / "examples" / "table1_case1.toml", files[1])
    files.append(folder / "envelope.png")
    _draw_envelope(DOCS.parent / "examples" / "table1_case1.toml", files[-1])
    _draw_pull_out(files[2])
    return files


def _draw_envelope(scene_file: Path, target: Path) -> None:
    """Draw the maps that `planarm envelope` makes of a scene."""
    scene = load_scene(scene_file)
    draw_envelope(target, envelope_maps(scene, "up"), scene.name, scene.arm.base_cm)


def _draw_plan(scene_file: Path, target: Path) -> None:
    """Draw the plan that `planarm run` makes of a scene: the path with its corners blended, and the arm along it."""
    plan = plan_scene(load_scene(scene_file), lambda _stage, _share: None)
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
    """Draw which torque the emulated motor pulls up to which speed, for three supplies, beside V / (2 L I)."""
    figure = new_figure(9.0, 4.2)
    axes = figure.subplots()
    dress(axes)
    for colour, supply_v in zip(JOINT_COLOURS, (12.0, 24.0, 36.0), strict=False):
        motor = Motor(supply_v=supply_v, current_a=1.7)
        loads_nm = [share * motor.peak_torque_nm for share in LOAD_SHARES]
        speeds = [pull_out_steps_s(motor, load, acceleration_steps_s2=8000.0) for load in loads_nm]
        axes.plot(speeds, loads_nm, "o-", color=colour, linewidth=2.0, label=f"{supply_v:g} V")
        axes.axvline(motor.corner_steps_s, color=colour, linewidth=1.2, linestyle=(0, (5, 3)))
    axes.set_xlabel("full steps a second", fontsize=TEXT_SIZE, color=INK)
    axes.set_ylabel("torque pulled (N m)", fontsize=TEXT_SIZE, color=INK)
    axes.set_xlim(0.0)
    axes.set_ylim(0.0)
    axes.legend(frameon=False)
    set_title(axes, "Pull-out of the emulated motor", "dashed: V / (2 L I); 2.8 mH, 1.7 A, 1/16 steps")
    save(figure, target)


if __name__ == "__main__":
    make_images(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "images")
