"""From a path to segments: time it, make its steps, compress them, and slow it down until a stop fits everywhere."""

from collections.abc import Callable
from dataclasses import replace

from planarm.model.transmission import motor_axes
from planarm.scene import Scene
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.quantise import quantise
from planarm.stepping.segments import Coding, compress
from planarm.stepping.slowing import SpeedLimit, missing_road_ticks, slower
from planarm.stepping.stopping import allowances
from planarm.stepping.train import StepTrain
from planarm.trajectory.motion import Trajectory

MOST_ROUNDS = 16

TIGHTER = 0.9
"""What the device holds is known once the segments are made; if they hold less, a little less is taken for it."""

Timing = Callable[[SpeedLimit | None], Trajectory]


def encode(scene: Scene, trajectory: Trajectory, coding: Coding | None = None) -> tuple[StepTrain, SegmentPlan]:
    """Return a motion's steps and segments with their allowances, its times as they are.

    Raises:
        TimingError: a joint would have to step faster than the firmware can.
    """
    train = quantise(trajectory, scene.joints, scene.coupling)
    plan = compress(train, coding or Coding.of(motor_axes(scene.joints, scene.coupling)))
    durations = [segment.duration_flags >> 1 for segment in plan.segments]
    return train, replace(plan, allowances=allowances(trajectory, scene, durations))


def schedule(scene: Scene, timing: Timing) -> tuple[Trajectory, StepTrain, SegmentPlan]:
    """Return a motion from which the device can come to rest on the path at any moment, its steps and its segments.

    Where no speed makes all stops fit, as with all of the acceleration used, the last try is returned; the certificate
    tells what is missing.

    Args:
        scene: the joints, their motors and limits.
        timing: times the path under a further limit of the speed along it.

    Raises:
        TimingError: a joint would have to step faster than the firmware can.
    """
    coding = Coding.of(motor_axes(scene.joints, scene.coupling))
    limit: SpeedLimit | None = None
    road_ticks: float | None = None
    for left in range(MOST_ROUNDS, 0, -1):
        trajectory = timing(limit)
        lower = None if road_ticks is None or left == 1 else slower(trajectory, scene, road_ticks, limit)
        if lower is not None:
            limit = lower
            continue
        train, plan = encode(scene, trajectory, coding)
        missing = missing_road_ticks(plan)
        if missing is None:
            return trajectory, train, plan
        road_ticks = missing if road_ticks is None else TIGHTER * road_ticks
    return trajectory, train, plan
