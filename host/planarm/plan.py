"""The values that the whole flow hands on: a plan with all its stages, and what was found at the pins."""

from __future__ import annotations

from dataclasses import dataclass

from planarm.analysis.step_count import MeasuredSteps, StepComparison
from planarm.scene import Scene
from planarm.search.joint_space import JointRoute
from planarm.search.path import Path
from planarm.smoothing.smooth_path import SmoothPath
from planarm.stepping.certificate import Certificate
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import StepTrain
from planarm.trajectory.binding import TimingReport
from planarm.trajectory.motion import Trajectory
from planarm.workspace.free_map import FreeMap


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything from a scene to certified segments, each stage's value kept for the report."""

    scene: Scene
    free_map: FreeMap
    path: Path
    smooth_path: SmoothPath
    trajectory: Trajectory
    train: StepTrain
    segments: SegmentPlan
    certificate: Certificate
    plan_ms: float
    """Wall time of the whole planning, certificate included."""
    timing: TimingReport
    """Which limits hold the motion back, and what the braking share costs."""
    search_ms: float
    """Wall time of the grid search alone."""
    joint: JointRoute | None = None
    """The way-points of a route in joint space."""


@dataclass(frozen=True, slots=True)
class Findings:
    """What the pins showed, held against the plan."""

    measured: tuple[MeasuredSteps, ...]
    comparison: StepComparison
