"""The values that the whole flow hands on: a plan with all its stages, and what was found at the pins."""

from __future__ import annotations

from dataclasses import dataclass

from planarm.analysis.step_count import MeasuredSteps, StepComparison
from planarm.routes.moving_route import MovingRoute
from planarm.scene import Scene
from planarm.search.joint_space import JointRoute
from planarm.search.path import Path
from planarm.smoothing.smooth_path import SmoothPath
from planarm.stepping.certificate import Certificate
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.train import StepTrain
from planarm.trajectory.binding import TimingReport
from planarm.trajectory.jerk import Mean
from planarm.trajectory.motion import Trajectory
from planarm.workspace.free_map import RegionMap


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything from a scene to certified segments, each stage's value kept for the report."""

    scene: Scene
    free_map: RegionMap
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
    moving: MovingRoute | None = None
    """How the motion among moving obstacles was found; None where obstacles rest."""
    bound_cm: float | None = None
    """No path of the tip on the map is shorter; None where the path was searched, or optimised, in joint space."""
    mean: Mean | None = None
    """What the motion is the moving mean of; None where no joint's jerk is limited."""
    note: str = ""
    """In what the path is less than was asked for; empty when in nothing."""

    def length_figures(self) -> dict[str, float | str | None]:
        """The path's length, its proven lower bound, by how many per cent it can exceed the best, and the note."""
        length_cm, bound_cm = self.path.length_cm, self.bound_cm
        gap = None if not bound_cm else round(100.0 * max(0.0, length_cm / bound_cm - 1.0), 4)
        bound = None if not bound_cm else round(bound_cm, 6)
        figures = {"path_length_cm": round(length_cm, 6), "path_bound_cm": bound, "path_gap_percent": gap}
        return {**figures, "path_note": self.note} if self.note else {**figures}


@dataclass(frozen=True, slots=True)
class Findings:
    """What the pins showed, held against the plan."""

    measured: tuple[MeasuredSteps, ...]
    comparison: StepComparison
