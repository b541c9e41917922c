"""Certificate: the arm in space at every micro-step of the expanded segments."""

import numpy as np

from planarm.model.shapes import obstacle_set, shape_of
from planarm.model.transmission import Transmission
from planarm.scene import Scene
from planarm.stepping.certificate import Check, Verdict, at_least, at_most
from planarm.stepping.check_moving import check_moving
from planarm.stepping.clearance import clearances_cm
from planarm.stepping.poses import MotorPositions, Poses, poses_of
from planarm.stepping.train import Floats, StepTrain
from planarm_wire.messages import TICKS_HZ

ROUNDING_CM = 1e-9

AMBER_BEND_RAD = np.radians(5.0)
"""An inner joint nearer than this to straight or folded is amber: there the tip cannot be moved in every direction."""


def check_space(scene: Scene, made: StepTrain, at: MotorPositions, from_ticks: int = 0) -> list[Check]:
    """Check clearance, joint limits, the distance from singular poses, and where the tip starts and ends.

    Args:
        scene: what was asked for.
        made: the expanded plan.
        at: the motors' positions around each of its steps.
        from_ticks: clearance is looked at from here on.
    """
    transmission = Transmission.of(scene)
    poses = poses_of(scene.arm, transmission, made, at)
    checks = []
    if scene.obstacles:
        moving = scene.moving
        checks.append(
            _check_clearance(scene, poses.since(from_ticks)) if moving is None else check_moving(scene, moving, poses)
        )
    if scene.arm.floor:
        height: Floats = poses.positions_cm[:, 1:, 1].min(axis=1) - poses.reach_cm
        worst = int(np.argmin(height))
        where = poses.place(worst)
        checks.append(at_least("height above the floor", height[worst], scene.margin_cm, "cm", where, "arm.floor"))
    checks.extend(_check_joint_limits(scene, transmission, made, at))
    checks.extend(_check_bends(poses))
    bound = 0.5 * float(transmission.levers_cm(scene.arm.link_lengths_cm).sum())
    for name, index, wanted, key in (
        ("start", 0, scene.task.start_cm, "start"),
        ("goal", -1, scene.task.goal_cm, "goal"),
    ):
        tip = poses.positions_cm[index, -1]
        error = float(np.hypot(*(tip - wanted)))
        where = f"tip ({tip[0]:.4f}, {tip[1]:.4f}) cm"
        setting = f"task.{key}_cm or joints.microsteps"
        checks.append(at_most(f"tip error at the {name}", error, bound, "cm", where, setting, ROUNDING_CM))
    return checks


def _check_clearance(scene: Scene, poses: Poses) -> Check:
    """Check the least distance of any link's centre line from any obstacle, at and between all micro-steps."""
    obstacles = obstacle_set([shape_of(obstacle) for obstacle in scene.obstacles])
    distances, nearest = clearances_cm(poses.positions_cm, obstacles)
    least = distances - poses.reach_cm
    worst = int(np.argmin(least))
    where = f"{poses.place(worst)}, obstacles[{nearest[worst] + 1}]"
    setting = "workspace.clearance_cm or planner.moves"
    return at_least("clearance of the links' centre lines", least[worst], scene.margin_cm, "cm", where, setting)


def _check_joint_limits(scene: Scene, transmission: Transmission, made: StepTrain, at: MotorPositions) -> list[Check]:
    """Check every pose against the joint limits; within half a micro-step beyond a limit is amber: it is rounding."""
    checks = []
    ticks = np.concatenate([[0], at.ticks])
    q_rad = transmission.q_rad(np.concatenate([[made.start_usteps], at.after_usteps]))
    for number, (low, high) in enumerate(scene.arm.joint_limits_rad, start=1):
        angles = q_rad[:, number - 1]
        room = np.minimum(angles - low, high - angles)
        worst = int(np.argmin(room))
        rounding_rad = 0.5 * float(np.abs(transmission.rad_per_ustep[number - 1]).sum())
        beyond = -room[worst] / rounding_rad
        verdict: Verdict = "green" if beyond <= 0.0 else "amber" if beyond <= 1.0 + 1e-6 else "red"
        where = f"{ticks[worst] / TICKS_HZ:.6f} s, {np.degrees(angles[worst]):.4f} deg"
        name = f"joint {number} distance to its limits"
        checks.append(Check(name, float(room[worst]), 0.0, "rad", verdict, where, f"arm.joint_limits_deg[{number}]"))
    return checks


def _check_bends(poses: Poses) -> list[Check]:
    """Tell how near each inner joint comes to a singular pose, straight or folded; never red: no limit breaks there.

    Speeds and step rates grow without bound near such a pose, but they are checked themselves.
    """
    checks = []
    for number in range(2, poses.q_rad.shape[1] + 1):
        folded = np.abs(np.remainder(poses.q_rad[:, number - 1], np.pi))
        bend = np.minimum(folded, np.pi - folded)
        worst = int(np.argmin(bend))
        verdict: Verdict = "green" if bend[worst] >= AMBER_BEND_RAD else "amber"
        where = f"{poses.place(worst)}, joint {number} at {np.degrees(poses.q_rad[worst, number - 1]):.2f} deg"
        setting = f"arm.joint_limits_deg[{number}]"
        name = f"joint {number} distance to a singular pose"
        checks.append(Check(name, float(bend[worst]), float(AMBER_BEND_RAD), "rad", verdict, where, setting))
    return checks
