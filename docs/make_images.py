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
from planarm.scene import load_scene

DOCS = Path(__file__).resolve().parent
CURVE_POINTS = 600


def make_images(folder: Path) -> list[Path]:
    """Write all pictures into the folder and return their files."""
    files = [folder / "stencils.png", folder / "table1_case1.png"]
    draw_paper_stencils(files[0])
    _draw_plan(DOCS.parent / "examples" / "table1_case1.toml", files[1])
    files.append(folder / "envelope.png")
    _draw_envelope(DOCS.parent / "examples" / "table1_case1.toml", files[-1])
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


if __name__ == "__main__":
    make_images(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "images")
