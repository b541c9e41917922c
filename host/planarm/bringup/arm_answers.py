"""What setup asks about an arm, as values; whether they go together; and the scene that they make."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, pi

import numpy as np

from planarm.scene import MechanicsSpec, Scene, parse_scene
from planarm.stepping.check_torque import joint_torques_nm, motor_torque_shares
from planarm.stepping.train import largest_rate_hz
from planarm_wire.boards import Board
from planarm_wire.wirings import OWN, board_of

COARSE_TIP_MM = 1.0
"""A tip that jumps by more than this with each micro-step is told."""
TORQUE_SHARE = 0.5
PLANNED_BY_TIP = 2
"""Links of an arm whose tip's place gives its pose, so that its task is told by places and searched in the plane."""
FIRST_DEG = 30.0
"""Of the first motion of other arms."""


@dataclass(frozen=True, slots=True)
class JointAnswers:
    """One joint, in the units of the scene file."""

    steps_per_rev: int = 200
    microsteps: int = 16
    gear_ratio: float = 5.0
    driver: str = "a4988"
    max_speed_deg_s: float = 110.0
    max_acceleration_deg_s2: float = 570.0
    holding_torque_nm: float = 0.4
    rated_current_a: float = 1.7
    current_a: float = 1.2
    supply_v: float = 24.0
    reversed: bool = False
    measured: str = ""
    """How the gear ratio was measured, for the file's comment."""

    @property
    def usteps_per_deg(self) -> float:
        """Micro-steps of the motor for one degree of the joint."""
        return self.steps_per_rev * self.microsteps * self.gear_ratio / 360.0


@dataclass(frozen=True, slots=True)
class ArmAnswers:
    """The arm, in the units of the scene file."""

    name: str
    link_lengths_cm: tuple[float, ...]
    link_width_cm: float = 1.0
    elbow: str = "up"
    gravity: bool = False
    payload_kg: float = 0.0
    joints: tuple[JointAnswers, ...] = ()
    """One a link; where none are given they are all alike."""
    port: str = "sim://"
    wiring: str = OWN
    """Of the drivers; a name of the wire's pin maps."""
    enable_active_high: bool = False
    stop_input: bool = False

    def __post_init__(self) -> None:
        if not self.joints:
            object.__setattr__(self, "joints", (JointAnswers(),) * self.links)

    @property
    def links(self) -> int:
        """How many."""
        return len(self.link_lengths_cm)

    @property
    def board(self) -> Board:
        """The board that moves it.

        Raises:
            WireError: none of this wiring steps so many joints.
        """
        return board_of(self.links, self.wiring)

    def with_joint(self, number: int, joint: JointAnswers) -> ArmAnswers:
        """Return the same arm with another joint `number`, counted from 0."""
        return replace(self, joints=(*self.joints[:number], joint, *self.joints[number + 1 :]))

    def scene(self) -> Scene:
        """Return the scene of these answers.

        Raises:
            SceneError: they make none.
        """
        return parse_scene(scene_text(self), self.name)


@dataclass(frozen=True, slots=True)
class Remark:
    """What is to be said of a joint: `grave` when the arm would not work so."""

    grave: bool
    text: str


def plausibility(arm: ArmAnswers, number: int) -> list[Remark]:
    """Return what is to be said of a joint, counted from 0: resolution, step rate, torque at full stretch."""
    joint, reach_cm = arm.joints[number], sum(arm.link_lengths_cm[number:])
    step_mm = 10.0 * reach_cm * pi / 180.0 / joint.usteps_per_deg
    rate_hz = joint.max_speed_deg_s * joint.usteps_per_deg
    share = _torque_share(arm, number)
    most_hz = largest_rate_hz(arm.board)
    fastest = most_hz / joint.usteps_per_deg
    return [
        Remark(
            step_mm > COARSE_TIP_MM,
            f"{joint.usteps_per_deg:.4g} micro-steps a degree: one moves the tip by {step_mm:.3g} mm at full stretch"
            + ("; more microsteps or gear_ratio make it finer" if step_mm > COARSE_TIP_MM else ""),
        ),
        Remark(
            rate_hz > most_hz,
            f"{rate_hz:,.0f} steps/s at full speed, {most_hz:,.0f} are the most"
            + (f"; at most {fastest:.4g} deg/s" if rate_hz > most_hz else ""),
        ),
        Remark(
            share > 1.0,
            f"{100.0 * share:.0f} % of the motor's torque for full acceleration at full speed, arm stretched; "
            f"{100.0 * TORQUE_SHARE:.0f} % is what plans use"
            + ("; lower the acceleration or speed, or raise gear_ratio or current" if share > TORQUE_SHARE else ""),
        ),
    ]


def _torque_share(arm: ArmAnswers, number: int) -> float:
    """Return the share of its pull-out torque that a joint's motor gives when all is asked of it at once."""
    scene = arm.scene()
    joints = len(scene.joints)
    rates, accelerations = np.zeros((1, joints)), np.zeros((1, joints))
    rates[0, number] = scene.joints[number].max_speed_rad_s
    accelerations[0, number] = scene.joints[number].max_acceleration_rad_s2
    torques = joint_torques_nm(scene.arm.link_lengths_cm, scene.mechanics, np.zeros((1, joints)), rates, accelerations)
    return float(motor_torque_shares(scene, torques, rates, accelerations)[0, number])


def _board_lines(arm: ArmAnswers) -> list[str]:
    """Return the table of what is not as usual; nothing where all is."""
    lines = [f'wiring = "{arm.wiring}"         # of the drivers (docs/wiring.md)'] * (arm.wiring != OWN)
    lines += ["enable_active_high = true       # the drivers are on while ENABLE is high"] * arm.enable_active_high
    lines += ["stop_input = true               # all pulses end when the stop contact opens"] * arm.stop_input
    return ["", "[board]", *lines] if lines else []


def scene_text(arm: ArmAnswers) -> str:
    """Return the scene file of an arm, with a comment where a person would ask why."""
    reach = sum(arm.link_lengths_cm)
    mechanics = MechanicsSpec.usual(arm.link_lengths_cm)
    masses = ", ".join(f"{mass:.3g}" for mass in mechanics.link_masses_kg)
    ends = ", ".join(["0"] * (len(arm.link_lengths_cm) - 1) + [f"{arm.payload_kg:g}"])
    lines = [
        f'name = "{arm.name}"',
        "",
        "[arm]",
        f"link_lengths_cm = {_list(arm.link_lengths_cm)}   # joint to joint; planarm calibrate measures them",
        f"link_width_cm = {arm.link_width_cm:g}             # obstacles keep half of it from the links' centre lines",
        f'elbow = "{arm.elbow}"               # "up": theta2 <= 0, "down": theta2 >= 0, "either"',
        *_board_lines(arm),
        "",
        "[workspace]                     # where the tip may be; obstacles go below as [[obstacles]]",
        f"x_cm = [{-reach:g}, {reach:g}]",
        f"y_cm = [{0 if arm.links == PLANNED_BY_TIP else -reach:g}, {reach:g}]",
        f"cell_cm = {max(0.25, round(reach / 60.0, 2)):g}",
        "",
        "[task]                          # a first short motion; put your own here",
        *_task_lines(arm),
        "",
        "[mechanics]",
        f"gravity = {str(arm.gravity).lower()}                 # true: the arm stands upright",
        f"link_masses_kg = [{masses}]    # of aluminium tubes; weigh yours",
        f"end_masses_kg = [{ends}]         # at each link's end: the next motor, the payload",
    ]
    for number, joint in enumerate(arm.joints, start=1):
        lines += ["", *_joint_lines(number, joint)]
    return "\n".join([*lines, "", "[link]", f'port = "{arm.port}"', ""])


def _joint_lines(number: int, joint: JointAnswers) -> list[str]:
    gear = f"   # {joint.measured}" if joint.measured else "   # turns of the motor for one of the joint"
    return [
        f"[[joints]]                      # joint {number}: {joint.usteps_per_deg:.5g} micro-steps a degree",
        f"steps_per_rev = {joint.steps_per_rev}",
        f"microsteps = {joint.microsteps}                 # as the driver's pins or switches say",
        f"gear_ratio = {joint.gear_ratio:.8g}{gear}",
        f'driver = "{joint.driver}"',
        f"max_speed_deg_s = {joint.max_speed_deg_s:g}",
        f"max_acceleration_deg_s2 = {joint.max_acceleration_deg_s2:g}",
        f"reversed = {str(joint.reversed).lower()}               # true: DIR high turns the joint clockwise",
        "[joints.motor]",
        f"holding_torque_nm = {joint.holding_torque_nm:g}",
        f"rated_current_a = {joint.rated_current_a:g}",
        f"current_a = {joint.current_a:g}                 # what the driver is set to",
        f"supply_v = {joint.supply_v:g}",
    ]


def _task_lines(arm: ArmAnswers) -> list[str]:
    """Return a first short motion: of the tip with two links, else of the joints, which a roadmap is searched for."""
    if arm.links == PLANNED_BY_TIP:
        start, goal = _task_cm(arm)
        return [f"start_cm = {_list(start)}", f"goal_cm = {_list(goal)}"]
    start_deg = (FIRST_DEG, *(-FIRST_DEG,) * (arm.links - 1))
    planner = ["", "[planner]", 'algorithm = "mpd_star_lite"     # on a roadmap of joint angles']
    return [f"start_deg = {_list(start_deg)}", f"goal_deg = {_list((2.0 * FIRST_DEG, *start_deg[1:]))}", *planner]


def _task_cm(arm: ArmAnswers) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return two points that the arm reaches on its elbow side, a tenth of its reach apart."""
    inner = abs(arm.link_lengths_cm[0] - sum(arm.link_lengths_cm[1:]))
    radius = 0.5 * (inner + sum(arm.link_lengths_cm))
    side = 0.1 * sum(arm.link_lengths_cm)
    far = hypot(radius, side)
    return (round(radius, 3), round(side, 3)), (round(radius * radius / far, 3), round(2.0 * side * radius / far, 3))


def _list(values: tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{value:g}" for value in values) + "]"
