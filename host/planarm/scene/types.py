"""What a scene says, as frozen dataclasses in centimetres and radians."""

from dataclasses import dataclass, field
from math import ceil, floor
from typing import Literal

from planarm.errors import SceneError
from planarm.scene.board import BoardSpec
from planarm.scene.dc_motors import DcMotorSpec
from planarm.scene.joint import JointSpec
from planarm.scene.joint_space import JointSpaceSpec
from planarm.scene.limit_switches import LimitSwitchSpec
from planarm.scene.mechanics import Matrix, MechanicsSpec
from planarm.scene.moving import MovingSpec, ObstacleMotion
from planarm.scene.pulses import short_pulse, short_pulse_words
from planarm.scene.roadmap import RoadmapSpec
from planarm.scene.task import Point, Range, TaskSpec
from planarm_wire.boards import Board
from planarm_wire.errors import WireError
from planarm_wire.wirings import OWN, board_of

Elbow = Literal["up", "down", "either"]
Shape = Literal["circle", "square", "diamond", "triangle", "hexagon", "polygon"]
Algorithm = Literal[
    "a_star",
    "modified_a_star",
    "chaos_a_star",
    "chs",
    "taut",
    "theta_star",
    "lazy_theta_star",
    "any_angle",
    "mpd_star_lite",
    "d_star_lite",
    "roadmap_a_star",
]
ROADMAP_ALGORITHMS: tuple[Algorithm, ...] = ("mpd_star_lite", "d_star_lite", "roadmap_a_star")
"""Those that search a graph of configurations (paper A), for any number of links."""
Subset = Literal["run", "expansion"]
Moves = Literal["proved", "cells", "nodes"]
Corners = Literal["blend", "stop"]
Objective = Literal["length", "joint_travel", "time"]


@dataclass(frozen=True, slots=True)
class ArmSpec:
    """The arm: links from the base outwards; elbow "up" means theta2 < 0, "down" theta2 > 0."""

    link_lengths_cm: tuple[float, ...]
    link_width_cm: float
    base_cm: Point
    elbow: Elbow
    joint_limits_rad: tuple[Range, ...]
    floor: bool
    """True when all links must stay above y = 0."""


@dataclass(frozen=True, slots=True)
class WorkspaceSpec:
    """The rectangle that is searched and the grid laid over it."""

    x_cm: Range
    y_cm: Range
    cell_cm: float
    clearance_cm: float
    """Room to keep between the links' edges and the obstacles."""

    @property
    def columns(self) -> range:
        """The grid's nodes along x, as multiples of `cell_cm`."""
        return _multiples_within(self.x_cm, self.cell_cm)

    @property
    def rows(self) -> range:
        """The grid's nodes along y, as multiples of `cell_cm`."""
        return _multiples_within(self.y_cm, self.cell_cm)


def _multiples_within(limits_cm: Range, cell_cm: float) -> range:
    """Return the k with k * cell_cm within the limits; a rounding error beyond an end still counts."""
    return range(ceil(limits_cm[0] / cell_cm - 1e-9), floor(limits_cm[1] / cell_cm + 1e-9) + 1)


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A filled shape: centre and diameter of the circumscribed circle, or the vertices of a polygon."""

    shape: Shape
    center_cm: Point | None = None
    diameter_cm: float | None = None
    vertices_cm: tuple[Point, ...] | None = None
    motion: ObstacleMotion | None = None
    """How it moves; None: it rests."""


@dataclass(frozen=True, slots=True)
class PlannerSpec:
    """The search: algorithm, neighbourhood, and how moves are checked.

    `subset` says how often Chaos A* draws its subset of the neighbours; `moves` "proved" proves every move free,
    "nodes" checks grid nodes only, as the papers do. `objective` "joint_travel" searches the least turning of the
    joints; "time" the least time at their top speeds, and goes on from there to optimise the path itself for duration,
    for `budget_s` seconds.
    """

    algorithm: Algorithm
    neighbours: int
    subset: Subset
    seed: int
    moves: Moves
    objective: Objective = "length"
    budget_s: float = 3.0

    @property
    def on_roadmap(self) -> bool:
        """Whether a graph of configurations is searched."""
        return self.algorithm in ROADMAP_ALGORITHMS


@dataclass(frozen=True, slots=True)
class MotionSpec:
    """How a path becomes a motion: what happens at its corners, and how much of the acceleration is used."""

    corners: Corners = "blend"
    tolerance_cm: float = 0.5
    """Largest distance of the tip from the path's straight moves."""
    acceleration_share: float = 0.8
    """Share of each joint's acceleration that the plan uses; the rest keeps a stop along the path possible."""
    torque_share: float = 0.5
    """Share of the motors' pull-out torque that may be used at all: the model is an estimate."""


@dataclass(frozen=True, slots=True)
class LinkSpec:
    """Where the firmware is reached: port or URL, and the baud rate."""

    port: str
    baud: int


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything a scene file says, in centimetres and radians."""

    name: str
    source: str
    arm: ArmSpec
    workspace: WorkspaceSpec
    obstacles: tuple[Obstacle, ...]
    task: TaskSpec
    planner: PlannerSpec
    joints: tuple[JointSpec, ...]
    link: LinkSpec
    mechanics: MechanicsSpec
    coupling: Matrix
    """Row m says how far motor m turns, behind its gear, when each joint turns once."""
    motion: MotionSpec = MotionSpec()
    joint_space: JointSpaceSpec | None = None
    """How to plan in joint space; None plans in tip space."""
    limit_switches: tuple[LimitSwitchSpec, ...] = ()
    roadmap: RoadmapSpec = field(default_factory=RoadmapSpec)
    dc_motors: DcMotorSpec | None = None
    """None stands for the usual ones (`DcMotorSpec.usual`)."""
    moving: MovingSpec | None = None
    """How to plan in space and time; None: obstacles rest."""
    wiring: str = OWN
    """The wire's pin map: how the drivers are wired, and whether they need long pulses."""
    board_spec: BoardSpec = field(default_factory=BoardSpec)
    """What the board is told of its surroundings."""

    @property
    def board(self) -> Board:
        """The board that makes this arm's motions; its name is that of its flash image.

        Raises:
            SceneError: no board of this wiring steps so many joints, or makes pulses as long as a driver needs. Such an
                arm can be searched, not moved.
        """
        try:
            board = board_of(len(self.joints), self.wiring)
        except WireError as error:
            lengths = list(self.arm.link_lengths_cm)
            problem = f"{lengths}: {error} (board.wiring): it can be searched, but no motion is made"
            raise SceneError(self.source, "arm.link_lengths_cm", problem) from error
        short = short_pulse(self.joints, self.coupling, board)
        if short is not None:
            joint = self.joints[short.joint - 1]
            told = joint.step_high_s if short.level == "high" else joint.step_low_s
            key = "driver" if told is None else f"step_{short.level}_us"
            problem = short_pulse_words(joint.driver_row.title, short, board)
            raise SceneError(self.source, f"joints[{short.joint}].{key}", problem)
        return board

    @property
    def margin_cm(self) -> float:
        """Least distance of a link's centre line to an obstacle: half the link's width plus the clearance."""
        return 0.5 * self.arm.link_width_cm + self.workspace.clearance_cm
