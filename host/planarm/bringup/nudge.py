"""Moving one joint, or from pose to pose, before anything is known of the arm but its motors: slowly, and certified."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from planarm.errors import CertificateError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.scene import Scene
from planarm.smoothing.smooth_path import Floats, JointState, Side
from planarm.stepping.certificate import Certificate
from planarm.stepping.certify import certify
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.schedule import schedule
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion

SLOW = 0.2
"""Share of the speed: whoever stands beside the arm can see what it does."""
GENTLE = 0.5
"""Share of the acceleration: so a stop from that speed is short enough for the queue of every board."""

Execute = Callable[[SegmentPlan, Certificate], None]
"""Streams a plan and waits until it is executed."""


@dataclass(frozen=True, slots=True, eq=False)
class JointLine:
    """A straight line in joint space, over its length in radians."""

    start_rad: Floats
    end_rad: Floats

    @property
    def _unit(self) -> Floats:
        return np.asarray((self.end_rad - self.start_rad) / self._length)

    @property
    def _length(self) -> float:
        return float(np.linalg.norm(self.end_rad - self.start_rad))

    @property
    def borders_s(self) -> Floats:
        """Its ends."""
        return np.array([0.0, self._length])

    @property
    def stops_s(self) -> Floats:
        """None."""
        return np.empty(0)

    def evaluate(self, s: Floats, side: Side = "right") -> JointState:
        """Return angles and derivatives at each s."""
        q = self.start_rad + np.asarray(s)[:, None] * self._unit
        return JointState(q, np.broadcast_to(self._unit, q.shape).copy(), np.zeros_like(q))

    def place(self, s: float) -> str:
        """Say where s is."""
        angles = ", ".join(f"{degrees(angle):.2f}" for angle in self.start_rad + s * self._unit)
        return f"joints at ({angles}) deg"


class Mover:
    """Moves an arm from where it is thought to stand.

    Args:
        execute: streams a plan.
        q_rad: where the joints are thought to stand.
    """

    def __init__(self, execute: Execute, q_rad: tuple[float, ...]) -> None:
        self._execute = execute
        self._start_rad = np.array(q_rad)
        self.q_rad = np.array(q_rad)

    def turn(self, scene: Scene, joint: int, angle_rad: float) -> None:
        """Turn one joint, counted from 0.

        Raises:
            CertificateError: the motion's certificate is red.
            PlanarmError: it cannot be timed or streamed.
        """
        target = self.q_rad.copy()
        target[joint] += angle_rad
        self.go(scene, target)

    def rescale(self, joint: int, factor: float) -> None:
        """Correct where a joint is thought to stand: all its turns so far were really so many times as long."""
        start = self._start_rad[joint]
        self.q_rad[joint] = start + factor * (self.q_rad[joint] - start)

    def go(self, scene: Scene, target_rad: Floats) -> None:
        """Go straight to a pose in joint space; obstacles of the scene are kept clear of, or nothing moves.

        Raises:
            CertificateError: the motion's certificate is red.
            PlanarmError: it cannot be timed or streamed.
        """
        plan, certificate = plan_line(scene, self.q_rad, np.asarray(target_rad))
        if not certificate.ok:
            raise CertificateError(f"this motion is not made: {certificate.explain()}")
        self._execute(plan, certificate)
        self.q_rad = np.array(target_rad)


def plan_line(scene: Scene, start_rad: Floats, end_rad: Floats) -> tuple[SegmentPlan, Certificate]:
    """Plan a slow straight line in joint space, and certify it."""
    arm = Arm.from_spec(scene.arm)
    (start_x, start_y), (end_x, end_y) = (forward(arm, q)[-1].tolist() for q in (start_rad, end_rad))
    joints = tuple(
        replace(
            joint,
            max_speed_rad_s=SLOW * joint.max_speed_rad_s,
            max_acceleration_rad_s2=GENTLE * joint.max_acceleration_rad_s2,
        )
        for joint in scene.joints
    )
    slow = replace(scene, joints=joints, task=replace(scene.task, start_cm=(start_x, start_y), goal_cm=(end_x, end_y)))
    line, limits = JointLine(start_rad, end_rad), Limits.of(slow)
    trajectory, train, plan = schedule(slow, lambda limit: fastest_motion(line, limits, limit))
    return plan, certify(slow, trajectory, train, plan)
