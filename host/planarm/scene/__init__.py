"""Scenes: a TOML file read strictly into frozen dataclasses.

This is the only place where units are converted: the file speaks centimetres and degrees, everything behind it
centimetres and radians. docs/scene.md is the reference of the format.
"""

from planarm.scene.board import BoardSpec
from planarm.scene.dc_motors import DcMotorSpec
from planarm.scene.joint import JointSpec
from planarm.scene.joint_space import ElbowChoice, JointObjective, JointSpaceSpec
from planarm.scene.limit_switches import LimitSwitchSpec
from planarm.scene.load import load_scene, parse_scene, with_planner, with_space
from planarm.scene.mechanics import Matrix, MechanicsSpec
from planarm.scene.motor import MotorSpec
from planarm.scene.moving import MovingSpec, ObstacleMotion
from planarm.scene.roadmap import EdgeCost, RoadmapSpec, Sampling
from planarm.scene.task import Point, Range, TaskSpec
from planarm.scene.types import (
    ROADMAP_ALGORITHMS,
    Algorithm,
    ArmSpec,
    Corners,
    Elbow,
    LinkSpec,
    MotionSpec,
    Moves,
    Objective,
    Obstacle,
    PlannerSpec,
    Scene,
    Shape,
    Subset,
    WorkspaceSpec,
)

__all__ = [
    "ROADMAP_ALGORITHMS",
    "Algorithm",
    "ArmSpec",
    "BoardSpec",
    "Corners",
    "DcMotorSpec",
    "EdgeCost",
    "Elbow",
    "ElbowChoice",
    "JointObjective",
    "JointSpaceSpec",
    "JointSpec",
    "LimitSwitchSpec",
    "LinkSpec",
    "Matrix",
    "MechanicsSpec",
    "MotionSpec",
    "MotorSpec",
    "Moves",
    "MovingSpec",
    "Objective",
    "Obstacle",
    "ObstacleMotion",
    "PlannerSpec",
    "Point",
    "Range",
    "RoadmapSpec",
    "Sampling",
    "Scene",
    "Shape",
    "Subset",
    "TaskSpec",
    "WorkspaceSpec",
    "load_scene",
    "parse_scene",
    "with_planner",
    "with_space",
]
