"""Certify a finished plan from its segments, by code that made none of it.

The segments are expanded again by code of its own; limits, gaps, counts, times and clearances are then computed from
those steps. `streaming` takes no plan whose certificate is not `ok`.
"""

from planarm.model.transmission import motor_axes
from planarm.scene import Scene
from planarm.stepping.certificate import Certificate, Check
from planarm.stepping.check_board import check_board
from planarm.stepping.check_motion import Planned, check_deviation, check_limits
from planarm.stepping.check_space import check_space
from planarm.stepping.check_steps import check_counts, check_gaps
from planarm.stepping.check_stop import check_stop
from planarm.stepping.check_swing import check_swing
from planarm.stepping.check_torque import check_torque
from planarm.stepping.check_wire import check_pulses, check_wire
from planarm.stepping.expand import expand
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.poses import motor_positions
from planarm.stepping.table import table_of
from planarm.stepping.train import StepTrain
from planarm.trajectory.motion import Trajectory
from planarm_wire.messages import TICKS_HZ

__all__ = ["Certificate", "Check", "certify"]


def certify(
    scene: Scene, trajectory: Trajectory, train: StepTrain, plan: SegmentPlan, from_ticks: int = 0
) -> Certificate:
    """Return every check of the plan: steps, motion, and the arm in space.

    Args:
        scene: what was asked for.
        trajectory: the timed motion.
        train: its steps.
        plan: the segments to be streamed; everything is held against what they expand to.
        from_ticks: clearance from obstacles is looked at from here on: what was before is past, and was certified among
            the obstacles of its time.
    """
    made = expand(plan)
    axes = motor_axes(scene.joints, scene.coupling)
    table, at = table_of(plan), motor_positions(made)
    checks = check_wire(plan, table, scene.board) + check_pulses(scene, made)
    checks += check_board(table, made, scene.link)
    for number in range(1, len(scene.joints) + 1):
        checks += check_counts(train, made, number)
        checks += check_gaps(made, axes, number)
    if trajectory.duration_s > 0.0:
        planned = Planned.of(trajectory)
        checks += check_limits(planned, scene.joints)
        checks += check_torque(planned, scene)
        checks += check_swing(planned, plan, made, scene, from_ticks / TICKS_HZ)
        checks += check_stop(plan, table, planned, scene)
    checks += check_deviation(trajectory, scene, made, at)
    checks += check_space(scene, made, at, from_ticks)
    return Certificate(tuple(checks))
