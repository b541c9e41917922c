"""The dialogue that makes a scene file: what the arm is, whether that goes together, which way its joints turn."""

from __future__ import annotations

from dataclasses import replace
from math import radians

from planarm.bringup.arm_answers import PLANNED_BY_TIP, ArmAnswers, JointAnswers, plausibility
from planarm.bringup.nudge import Mover
from planarm.bringup.person import Person, ask_until, number, numbers, one_of
from planarm_wire.boards import Board
from planarm_wire.drivers import DRIVERS
from planarm_wire.messages import BOARDS
from planarm_wire.wirings import OWN, board_of, pins_of, wirings

MOST_JOINTS = max(board.joints for board in BOARDS.values())
NUDGE_DEG = 10.0
MARKS_DEG = 60.0
"""Between two marks: far enough that a degree read wrong is little."""
YES = ("yes", "no")
WAYS = ("counter-clockwise", "clockwise", "not at all")
PLAIN = "counter-clockwise"


def ask_arm(person: Person, name: str, port: str) -> ArmAnswers:
    """Ask for the arm and its joints; a joint whose numbers do not go together is asked for again, unless kept.

    Raises:
        UsageError: answers could not be read.
        SceneError: the answers make no scene.
    """
    person.tell("Lengths in centimetres, angles in degrees. Enter takes what stands in brackets.")
    question = "Lengths of the links, one to four, joint to joint (cm)"
    lengths = ask_until(person, question, "20, 15", numbers(range(1, MOST_JOINTS + 1), 0.1, 1000.0))
    width = ask_until(person, "Width of the links (cm)", "1", number(0.01, 100.0))
    elbow = "either"
    if len(lengths) == PLANNED_BY_TIP:
        elbow = ask_until(person, "Elbow: up, down or either", "up", one_of(("up", "down", "either")))
    known = wirings(len(lengths))
    wiring = ask_until(person, f"Wiring of the drivers: {', '.join(known)}", OWN, one_of(known))
    board = board_of(len(lengths), wiring)
    person.tell(wiring_words(board))
    question = f"Are the drivers on while ENABLE ({board.enable_pin}) is high; most are while it is low"
    active_high = ask_until(person, question, "no", one_of(YES)) == "yes"
    question = f"Is a stop contact, closed while all is well, wired from {board.stop_pin} to ground"
    stop_input = ask_until(person, question, "no", one_of(YES)) == "yes"
    gravity = ask_until(person, "Does the arm stand upright, so that gravity pulls at it", "no", one_of(YES)) == "yes"
    payload = ask_until(person, "Mass at the tip (kg)", "0", number(0.0, 100.0))
    arm = ArmAnswers(
        name,
        lengths,
        width,
        elbow,
        gravity,
        payload,
        port=port,
        wiring=wiring,
        enable_active_high=active_high,
        stop_input=stop_input,
    )
    for joint in range(arm.links):
        arm = _ask_joint(person, arm, joint)
    return arm


def wiring_words(board: Board) -> str:
    """Say which flash image a board needs, and where its drivers are to be wired."""
    pins = "\n".join(f"  {what}: {which}" for what, which in pins_of(board).items())
    return f"Board {board.name} (planarm flash --board {board.name}):\n{pins}"


def _ask_joint(person: Person, arm: ArmAnswers, number_: int) -> ArmAnswers:
    person.tell(f"\nJoint {number_ + 1}")
    before = arm.joints[number_ - 1] if number_ else arm.joints[0]
    while True:
        arm = arm.with_joint(number_, _ask_motor(person, before))
        remarks = plausibility(arm, number_)
        for remark in remarks:
            person.tell(f"  {'!' if remark.grave else ' '} {remark.text}")
        if not any(remark.grave for remark in remarks):
            return arm
        if ask_until(person, "That will not work well. Keep it all the same", "no", one_of(YES)) == "yes":
            return arm
        before = arm.joints[number_]


def _ask_motor(person: Person, before: JointAnswers) -> JointAnswers:
    def ask(question: str, default: float, least: float, most: float) -> float:
        return ask_until(person, question, f"{default:g}", number(least, most))

    return JointAnswers(
        steps_per_rev=int(ask("Full steps of the motor in one turn", before.steps_per_rev, 1, 100_000)),
        microsteps=int(ask("Micro-steps of a full step, as the driver is set", before.microsteps, 1, 256)),
        gear_ratio=ask("Turns of the motor for one turn of the joint", before.gear_ratio, 0.01, 10_000),
        driver=ask_until(person, f"Driver: {', '.join(sorted(DRIVERS))}", before.driver, one_of(sorted(DRIVERS))),
        max_speed_deg_s=ask("Largest speed of the joint (deg/s)", before.max_speed_deg_s, 0.1, 100_000),
        max_acceleration_deg_s2=ask(
            "Largest acceleration of the joint (deg/s^2)", before.max_acceleration_deg_s2, 0.1, 1e6
        ),
        holding_torque_nm=ask("Holding torque of the motor (N m)", before.holding_torque_nm, 0.001, 1000),
        rated_current_a=ask("Rated current of a phase (A)", before.rated_current_a, 0.01, 100),
        current_a=ask("Current that the driver is set to (A)", before.current_a, 0.01, 100),
        supply_v=ask("Supply of the motors (V)", before.supply_v, 1, 400),
    )


def try_joints(person: Person, arm: ArmAnswers, mover: Mover) -> ArmAnswers:
    """Move each joint a little, learn which way it went and how far, and return the arm as it is.

    Raises:
        PlanarmError: a motion is refused or fails.
    """
    for joint in range(len(arm.joints)):
        arm = _try_sense(person, arm, mover, joint)
        arm = _measure(person, arm, mover, joint)
    return arm


def _try_sense(person: Person, arm: ArmAnswers, mover: Mover, joint: int) -> ArmAnswers:
    """Turn a joint until it is known which way it goes."""
    while True:
        person.tell(f"\nJoint {joint + 1} now turns by {NUDGE_DEG:g} degrees, slowly.")
        mover.turn(arm.scene(), joint, radians(NUDGE_DEG))
        went = ask_until(person, f"Which way did joint {joint + 1} turn", PLAIN, one_of(WAYS))
        if went == "not at all":
            (step, direction), enable = arm.board.joint_pins[joint], arm.board.enable_pin
            person.tell(
                f"  Check the motors' supply, ENABLE ({enable}), STEP ({step}) and DIR ({direction}) of that driver."
            )
            if ask_until(person, "Try again", "yes", one_of(YES)) == "yes":
                continue
        elif went != PLAIN:
            now = arm.joints[joint]
            arm = arm.with_joint(joint, replace(now, reversed=not now.reversed))
            mover.rescale(joint, -1.0)
            person.tell(f"  Joint {joint + 1} is reversed; its scene says so now.")
        return arm


def _measure(person: Person, arm: ArmAnswers, mover: Mover, joint: int) -> ArmAnswers:
    """Turn a joint between two marks, and take its gear ratio from what was measured."""
    person.ask(f"Make a mark at joint {joint + 1}; Enter turns it by {MARKS_DEG:g} degrees", "")
    mover.turn(arm.scene(), joint, radians(MARKS_DEG))
    turned = ask_until(person, "By how many degrees did it turn, by your marks", f"{MARKS_DEG:g}", number(0.1, 3600.0))
    now = arm.joints[joint]
    if turned == MARKS_DEG:
        measured = now
    else:
        words = f"measured: {MARKS_DEG:g} degrees asked for, {turned:g} turned; {now.gear_ratio:g} was said"
        measured = replace(now, gear_ratio=now.gear_ratio * MARKS_DEG / turned, measured=words)
        mover.rescale(joint, turned / MARKS_DEG)
        person.tell(f"  {measured.usteps_per_deg:.5g} micro-steps a degree instead of {now.usteps_per_deg:.5g}.")
    arm = arm.with_joint(joint, measured)
    mover.turn(arm.scene(), joint, -radians(turned))
    return arm


def remarks_of(arm: ArmAnswers) -> list[str]:
    """Return what is grave about an arm as measured, a sentence each."""
    return [
        f"joint {joint + 1}: {remark.text}"
        for joint in range(len(arm.joints))
        for remark in plausibility(arm, joint)
        if remark.grave
    ]
