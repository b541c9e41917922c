"""Certificate, part three: the arm in space at every micro-step of the expanded segments.

Between two neighbouring poses one joint, or several at the same tick, moves by a micro-step. The pose in the middle is
taken, and no point of the arm is farther from it than half a micro-step at each moving joint's lever: with that taken
off, the middle's clearance holds for both neighbours and for everything between them.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planarm.model.shapes import shape_of
from planarm.model.transmission import Transmission
from planarm.scene import Scene
from planarm.stepping.certificate import Check, Verdict, at_least, at_most
from planarm.stepping.clearance import joint_positions_cm, link_clearance_cm
from planarm.stepping.train import Floats, StepTrain, Ticks
from planarm_wire.messages import TICKS_HZ

ROUNDING_CM = 1e-9


@dataclass(frozen=True, slots=True)
class _Poses:
    """Poses in the middle of every change, and those at rest before and after the motion."""

    ticks: Ticks
    q_rad: Floats
    reach_cm: Floats
    """Bound of any arm point's displacement between the pose and its neighbours."""


def check_space(scene: Scene, made: StepTrain) -> list[Check]:
    """Check clearance, joint limits, and where the tip starts and ends."""
    poses = _poses(scene, made)
    positions = joint_positions_cm(scene.arm.link_lengths_cm, scene.arm.base_cm, poses.q_rad)
    checks = []
    if scene.obstacles:
        checks.append(_check_clearance(scene, poses, positions))
    if scene.arm.floor:
        height = np.minimum.reduce([p[:, 1] for p in positions[1:]]) - poses.reach_cm
        worst = int(np.argmin(height))
        where = _where(poses, positions, worst)
        checks.append(at_least("height above the floor", height[worst], scene.margin_cm, "cm", where, "arm.floor"))
    checks.extend(_check_joint_limits(scene, made))
    for name, index, wanted, key in (
        ("start", 0, scene.task.start_cm, "start"),
        ("goal", -1, scene.task.goal_cm, "goal"),
    ):
        tip = positions[-1][index]
        bound = float(_half_step_cm(scene).sum())
        error = float(np.hypot(*(tip - wanted)))
        where = f"tip ({tip[0]:.4f}, {tip[1]:.4f}) cm"
        setting = f"task.{key}_cm or joints.microsteps"
        checks.append(at_most(f"tip error at the {name}", error, bound, "cm", where, setting, ROUNDING_CM))
    return checks


def _half_step_cm(scene: Scene) -> Floats:
    """Return how far half a micro-step of each motor can move a point of the arm."""
    return 0.5 * Transmission.of(scene).levers_cm(scene.arm.link_lengths_cm)


def _poses(scene: Scene, made: StepTrain) -> _Poses:
    """Return the poses of the whole motion in the order of time."""
    ticks = np.unique(np.concatenate([steps.ticks for steps in made.steps]))
    half_step_cm = _half_step_cm(scene)
    middles = np.empty((len(ticks) + 2, len(scene.joints)))
    reach_cm = np.zeros(len(ticks) + 2)
    for j, (steps, start) in enumerate(zip(made.steps, made.start_usteps, strict=True)):
        positions = np.concatenate([[start], start + np.cumsum(steps.directions, dtype=np.int64)])
        before = positions[np.searchsorted(steps.ticks, ticks, side="left")]
        after = positions[np.searchsorted(steps.ticks, ticks, side="right")]
        middles[:, j] = np.concatenate([[start], 0.5 * (before + after), positions[-1:]])
        reach_cm[1:-1] += np.abs(after - before) * half_step_cm[j]
    q_rad = Transmission.of(scene).q_rad(middles)
    return _Poses(np.concatenate([[0], ticks, [made.duration_ticks]]), q_rad, reach_cm)


def _check_clearance(scene: Scene, poses: _Poses, positions: list[Floats]) -> Check:
    """Check the least distance of any link's centre line from any obstacle."""
    least, nearest = np.full(len(poses.ticks), np.inf), np.zeros(len(poses.ticks), np.int64)
    for number, obstacle in enumerate(scene.obstacles, start=1):
        shape = shape_of(obstacle)
        for a, b in pairwise(positions):
            distance = link_clearance_cm(a, b, shape)
            nearest = np.where(distance < least, number, nearest)
            least = np.minimum(least, distance)
    least = least - poses.reach_cm
    worst = int(np.argmin(least))
    where = f"{_where(poses, positions, worst)}, obstacles[{nearest[worst]}]"
    setting = "workspace.clearance_cm or planner.moves"
    return at_least("clearance of the links' centre lines", least[worst], scene.margin_cm, "cm", where, setting)


def _check_joint_limits(scene: Scene, made: StepTrain) -> list[Check]:
    """Check every pose against the joint limits; within half a micro-step beyond a limit is amber: it is rounding."""
    checks = []
    transmission = Transmission.of(scene)
    ticks = np.unique(np.concatenate([[0], *(steps.ticks for steps in made.steps)]))
    q_rad = transmission.q_rad(np.column_stack([_positions_after(made, m, ticks) for m in range(len(scene.joints))]))
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


def _positions_after(made: StepTrain, m: int, ticks: Ticks) -> Ticks:
    """Return where motor m, from 0, stands after its steps up to each tick."""
    steps, start = made.steps[m], made.start_usteps[m]
    positions: Ticks = np.concatenate([[start], start + np.cumsum(steps.directions, dtype=np.int64)])
    return positions[np.searchsorted(steps.ticks, ticks, side="right")]


def _where(poses: _Poses, positions: list[Floats], i: int) -> str:
    x, y = positions[-1][i]
    return f"{poses.ticks[i] / TICKS_HZ:.6f} s, tip ({x:.2f}, {y:.2f}) cm"
