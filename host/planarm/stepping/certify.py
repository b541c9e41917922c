"""Certify a finished plan from its segments, by code that made none of it.

The segments are expanded again in plain integers; limits, gaps, counts, times and clearances are then computed from
those steps. `streaming` takes no plan whose certificate is not `ok`.
"""

from planarm.model.transmission import motor_axes
from planarm.scene import Scene
from planarm.stepping.certificate import Certificate, Check
from planarm.stepping.check_motion import check_deviation, check_limits
from planarm.stepping.check_space import check_space
from planarm.stepping.check_steps import check_counts, check_gaps, check_wire
from planarm.stepping.expand import expand
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import StepTrain
from planarm.trajectory.motion import Trajectory

__all__ = ["Certificate", "Check", "certify"]


def certify(scene: Scene, trajectory: Trajectory, train: StepTrain, plan: SegmentPlan) -> Certificate:
    """Return every check of the plan: steps, motion, and the arm in space.

    Args:
        scene: what was asked for.
        trajectory: the timed motion.
        train: its steps.
        plan: the segments to be streamed; everything is held against what they expand to.
    """
    made = expand(plan)
    axes = motor_axes(scene.joints, scene.coupling)
    checks = check_wire(plan)
    for number in range(1, len(scene.joints) + 1):
        checks += check_counts(train, made, number)
        checks += check_gaps(made, axes, number)
    checks += check_limits(trajectory, scene.joints)
    checks += check_deviation(trajectory, made, scene.joints, scene.coupling)
    checks += check_space(scene, made)
    return Certificate(tuple(checks))
