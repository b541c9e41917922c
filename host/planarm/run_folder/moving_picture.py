"""A motion among moving obstacles as an animation for its run's folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.moving import offset_cm
from planarm.model.shapes import shape_of
from planarm.plan import Plan
from planarm.report.animation import MovingShape, write_animation

POSES_PER_SAMPLE = 4


def animate(path_svg: Path, plan: Plan) -> None:
    """Write the planned motion and its obstacles, in real time."""
    assert plan.moving is not None, "only motions among moving obstacles are animated"
    scene, clock = plan.scene, plan.moving.moving_map.clock
    poses = max(2, POSES_PER_SAMPLE * plan.moving.path.arrival + 1)
    t_s = np.linspace(0.0, max(plan.trajectory.duration_s, clock.sample_s), poses)
    joints = forward(Arm.from_spec(scene.arm), plan.trajectory.sample(t_s)[0])
    (left, right), (bottom, top) = scene.workspace.x_cm, scene.workspace.y_cm
    write_animation(
        path_svg,
        step_s=float(t_s[1]),
        joints_cm=joints,
        obstacles=[
            MovingShape(shape_of(o), np.array([offset_cm(o.motion, float(t)) for t in t_s])) for o in scene.obstacles
        ],
        path_cm=joints[:, -1],
        view_cm=(left, bottom, right, top),
        title=f"{scene.name}: {plan.path.length_cm:.2f} cm in {plan.trajectory.duration_s:.1f} s",
    )
