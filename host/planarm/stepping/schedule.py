"""From a path to segments: time it, make its steps, compress them, and slow it down until a stop fits everywhere."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from planarm.errors import TimingError
from planarm.model.transmission import motor_axes
from planarm.scene import Scene
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.quantise import quantise
from planarm.stepping.segments import Coding, compress, expand
from planarm.stepping.slowing import Road, SpeedLimit, lacks_road, slower
from planarm.stepping.stopping import allowances
from planarm.stepping.train import JointSteps, StepTrain
from planarm.trajectory.motion import Trajectory

MOST_ROUNDS = 40

SAME_TICKS = 32
"""Two motions that part at a border may make a step before it, or one that was taken across it, so much apart."""

Timing = Callable[[SpeedLimit | None], Trajectory]


def encode(scene: Scene, trajectory: Trajectory, coding: Coding | None = None) -> tuple[StepTrain, SegmentPlan]:
    """Return a motion's steps and segments with their allowances, its times as they are.

    Raises:
        TimingError: a joint would have to step faster than the firmware can.
    """
    train = quantise(trajectory, scene.joints, scene.coupling, scene.wiring)
    plan = compress(train, coding or Coding.of(motor_axes(scene.joints, scene.coupling)))
    durations = [segment.duration_flags >> 1 for segment in plan.segments]
    return train, replace(plan, allowances=allowances(trajectory, scene, durations))


def schedule(
    scene: Scene, timing: Timing, told: Callable[[float], None] = lambda _share: None
) -> tuple[Trajectory, StepTrain, SegmentPlan]:
    """Return a motion from which the device can come to rest on the path at any moment, its steps and its segments.

    Where no speed makes all stops fit, as with all of the acceleration used, the last try is returned; the certificate
    tells what is missing.

    Args:
        scene: the joints, their motors and limits.
        timing: times the path under a further limit of the speed along it.
        told: told the share of the tries that may be needed, before each; most motions need few.

    Raises:
        TimingError: a joint would have to step faster than the firmware can.
    """
    coding = Coding.of(motor_axes(scene.joints, scene.coupling))
    return _until_stops_fit(scene, timing, lambda trajectory: encode(scene, trajectory, coding), 0, told)


def go_on(
    scene: Scene, timing: Timing, before: tuple[StepTrain, SegmentPlan], kept: int
) -> tuple[Trajectory, StepTrain, SegmentPlan]:
    """Do what `schedule` does for a motion whose first `kept` segments, and their allowances, are those of another.

    Args:
        scene: the joints, their motors and limits.
        timing: times the motion, which is the other up to the border, under a further limit of the speed after it.
        before: the other motion's steps and segments.
        kept: how many segments stay.

    Raises:
        TimingError: a joint would have to step faster than the firmware can; or the motions differ before the border.
    """
    coding = Coding.of(motor_axes(scene.joints, scene.coupling))
    old, segments, told = before[0], before[1].segments[:kept], before[1].allowances[:kept]
    made = [len(joint.ticks) for joint in expand(SegmentPlan(segments, 0, old.start_usteps, wiring=old.wiring)).steps]

    def encoded(trajectory: Trajectory) -> tuple[StepTrain, SegmentPlan]:
        train = with_first_steps(old, made, quantise(trajectory, scene.joints, scene.coupling, scene.wiring))
        plan = compress(train, coding, kept=segments)
        durations = [segment.duration_flags >> 1 for segment in plan.segments]
        plan = replace(plan, allowances=(*told, *allowances(trajectory, scene, durations)[kept:]))
        tried.append((trajectory, train, plan))
        return train, plan

    tried: list[tuple[Trajectory, StepTrain, SegmentPlan]] = []
    try:
        return _until_stops_fit(scene, timing, encoded, kept)
    except TimingError:  # it cannot be slower behind the border; where road is short the device slows down by itself
        if not tried:
            raise
        return tried[-1]


def with_first_steps(old: StepTrain, made: Sequence[int], new: StepTrain) -> StepTrain:
    """Return a train whose joints' first steps, so many of each, are an old one's to the tick.

    Raises:
        TimingError: they are other steps, or not at the same time but for rounding.
    """
    steps = []
    for number, (count, first, rest) in enumerate(zip(made, old.steps, new.steps, strict=True), start=1):
        same = len(rest.ticks) >= count and (first.directions[:count] == rest.directions[:count]).all()
        if not same or (count and np.abs(first.ticks[:count] - rest.ticks[:count]).max() > SAME_TICKS):
            raise TimingError(f"joint {number} makes other steps than before on the part of a motion that stays")
        steps.append(JointSteps(np.concatenate([first.ticks[:count], rest.ticks[count:]]), rest.directions))
    return StepTrain(old.start_usteps, tuple(steps), new.duration_ticks, old.wiring)


def _until_stops_fit(
    scene: Scene,
    timing: Timing,
    encoded: Callable[[Trajectory], tuple[StepTrain, SegmentPlan]],
    first: int,
    told: Callable[[float], None] = lambda _share: None,
) -> tuple[Trajectory, StepTrain, SegmentPlan]:
    """Time and encode, slower until the device holds the path of every stop from segment `first` on."""
    limit: SpeedLimit | None = None
    road: Road | None = None
    found = 0
    for left in range(MOST_ROUNDS, 0, -1):
        told(1.0 - left / MOST_ROUNDS)
        trajectory = timing(limit)
        lower = None if road is None or left == 1 else slower(trajectory, scene, road, limit)
        if lower is not None:
            limit = lower
            continue
        train, plan = encoded(trajectory)
        if not lacks_road(plan, first):
            return trajectory, train, plan
        road, found = Road.of(plan, trajectory, found), found + 1
    return trajectory, train, plan
