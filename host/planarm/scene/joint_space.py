"""The scene's table [joint_space]: with it, planning takes place in joint space."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians
from typing import Literal

from planarm.scene.strict_toml import Table

JOINT_SPACE_KEYS = ("cell_deg", "objective", "elbow_change_cost", "start_elbow", "goal_elbow")

JointObjective = Literal["time", "joint_travel", "tip_length"]
ElbowChoice = Literal["up", "down", "either"]

OBJECTIVES: tuple[JointObjective, ...] = ("time", "joint_travel", "tip_length")
CHOICES: tuple[ElbowChoice, ...] = ("up", "down", "either")
SMALLEST_CELL_DEG = 0.1
LARGEST_CELL_DEG = 30.0


@dataclass(frozen=True, slots=True)
class JointSpaceSpec:
    """How a way in joint space is searched."""

    cell_rad: float = pi / 90.0
    objective: JointObjective = "time"
    elbow_change_cost: float = 0.0
    """Added for each change of the elbow's side: seconds, radians or centimetres, as the objective has it."""
    start_elbow: ElbowChoice = "either"
    goal_elbow: ElbowChoice = "either"


def read_joint_space(table: Table, elbow: ElbowChoice) -> JointSpaceSpec:
    """Return the table's values; the start's elbow side is that of the arm unless the table says another."""
    return JointSpaceSpec(
        cell_rad=radians(table.number("cell_deg", 2.0, at_least=SMALLEST_CELL_DEG, at_most=LARGEST_CELL_DEG)),
        objective=table.choice("objective", OBJECTIVES, "time"),
        elbow_change_cost=table.number("elbow_change_cost", 0.0, at_least=0.0, at_most=1e6),
        start_elbow=table.choice("start_elbow", CHOICES, elbow),
        goal_elbow=table.choice("goal_elbow", CHOICES, "either"),
    )
