"""The emulated arm of a scene, built from plain values: the emulator moves it by itself. A door to the emulator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from planarm.errors import EmulatorError
from planarm.link.arm_record import ArmRecord, ArmSetup, BrokenRule, LostSteps, Touch
from planarm.model.arm import Arm
from planarm.model.kinematics import inverse_2r
from planarm.model.shapes import Circle, shape_of
from planarm.model.transmission import Transmission
from planarm.scene import JointSpec, Obstacle, Scene
from planarm_wire.boards import Board

if TYPE_CHECKING:
    from planarm_sim import Bench, CircleObstacle, DriverWiring, Motor, PolygonObstacle, Rig, Uno
    from planarm_sim.faults import FaultRunner

CM = 0.01
GRAVITY_M_S2 = 9.80665


class SimArm:
    """The arm behind an emulated board, and what goes wrong with it."""

    def __init__(self, bench: Bench, faults: FaultRunner | None) -> None:
        self._bench = bench
        self._faults = faults

    def record(self) -> ArmRecord:
        """Return what it did so far."""
        motion, report = self._bench.motion(), self._bench.report()
        touches = [Touch(c.cycle, c.link + 1, c.obstacle + 1) for c in report.contacts]
        touches += [Touch(hit.cycle, hit.joint + 1, 0) for hit in report.stop_hits]
        return ArmRecord(
            ticks=motion["cycle"],
            q_rad=motion["q_rad"],
            lost_full_steps=report.lost_full_steps,
            lost=tuple(LostSteps(s.cycle, s.motor + 1, s.full_steps) for s in report.slips),
            broken_rules=tuple(
                BrokenRule(v.cycle, v.driver + 1, v.rule, 1e-3 * v.measured_ns, 1e-3 * v.limit_ns)
                for v in report.violations
            ),
            touches=tuple(sorted(touches, key=lambda touch: touch.ticks)),
            faults=self._fault_lines(),
        )

    def settle(self, seconds: float) -> None:
        """Let emulated time pass, so that the arm comes to rest."""
        self._bench.run(seconds=seconds)

    def _fault_lines(self) -> tuple[str, ...]:
        if self._faults is None:
            return ()
        counts = ", ".join(f"{count} bytes {what}" for what, count in self._faults.line.counts.items() if count)
        return (*self._faults.log, *((counts,) if counts else ()))


def build_bench(uno: Uno, setup: ArmSetup) -> tuple[Bench, FaultRunner | None]:
    """Put the scene's drivers, motors and arm around an emulated board, and let its faults loose.

    Raises:
        EmulatorError: a driver has no such micro-steps, or the schedule of faults is none.
    """
    from planarm_sim import Bench, SimError  # noqa: PLC0415 - brings Numba, which only emulation needs

    try:
        upright = setup.scene.mechanics.gravity  # a person holds such an arm until its drivers do
        stop_pin = setup.scene.board.stop_pin if setup.scene.board_spec.stop_input else None
        rig, drivers = rig_of(setup.scene, setup.start_usteps), drivers_of(setup.scene)
        bench = Bench(uno, rig, drivers, propped=upright, stop_pin=stop_pin)
    except SimError as error:
        raise EmulatorError(f"{setup.scene.source}: joints.driver, joints.microsteps: {error}") from error
    return bench, _let_loose(bench, setup.faults, setup.fault_seed)


def _let_loose(bench: Bench, faults: Path | None, fault_seed: int | None) -> FaultRunner | None:
    from planarm_sim import SimError  # noqa: PLC0415
    from planarm_sim.faults import inject, load_schedule  # noqa: PLC0415

    if faults is None:
        return None
    try:
        return inject(bench, load_schedule(faults, fault_seed))
    except SimError as error:
        raise EmulatorError(str(error)) from error


def arm_at_its_start(scene: Scene, faults: Path | None, fault_seed: int | None) -> Callable[[Uno], Bench]:
    """Return what puts the scene's arm around a board, standing where its task starts.

    Raises:
        EmulatorError: the start is out of the arm's reach.
    """
    arm, task = Arm.from_spec(scene.arm), scene.task
    if task.start_rad is not None:
        q_rad = np.array(task.start_rad)
    else:
        q_rad = inverse_2r(arm, task.start_cm, "down" if scene.arm.elbow == "down" else "up")
    if np.isnan(q_rad).any():
        raise EmulatorError(f"{scene.source}: task.start_cm: {list(task.start_cm)} is out of the arm's reach")
    usteps = tuple(int(n) for n in np.floor(Transmission.of(scene).usteps(q_rad) + 0.5))
    return lambda uno: build_bench(uno, ArmSetup(scene, usteps, faults, fault_seed))[0]


def desk_arm_around(board: Board, faults: Path | None, fault_seed: int | None) -> Callable[[Uno], Bench]:
    """Return what puts a light arm around a board that the firmware drives: A4988 on its pins, 1/16 steps."""

    def put(uno: Uno) -> Bench:
        from planarm_sim import Bench, DriverWiring, desk_arm, driver_row  # noqa: PLC0415

        row = driver_row("a4988")
        drivers = [DriverWiring(row, step, direction, board.enable_pin) for step, direction in board.joint_pins]
        bench = Bench(uno, desk_arm(len(drivers)), drivers)
        _let_loose(bench, faults, fault_seed)
        return bench

    return put


def rig_of(scene: Scene, start_usteps: tuple[int, ...]) -> Rig:
    """Return the scene's arm, standing where its motors are at `start_usteps`."""
    from planarm_sim import Joint, LimitSwitch, Link, Rig  # noqa: PLC0415

    mechanics = scene.mechanics
    lengths_m = [CM * length for length in scene.arm.link_lengths_cm]
    links = tuple(
        Link(length, mass, share * length, inertia, end, CM * scene.arm.link_width_cm)
        for length, mass, share, inertia, end in zip(
            lengths_m,
            mechanics.link_masses_kg,
            mechanics.link_com_share,
            mechanics.link_inertias_kg_m2,
            mechanics.end_masses_kg,
            strict=True,
        )
    )
    joints = tuple(
        Joint(coulomb, viscous, stops)
        for coulomb, viscous, stops in zip(
            mechanics.coulomb_friction_nm, mechanics.viscous_friction_nm_s, mechanics.hard_stops_rad, strict=True
        )
    )
    return Rig(
        links=links,
        joints=joints,
        motors=tuple(_motor(scene, number, joint) for number, joint in enumerate(scene.joints)),
        start_rad=tuple(Transmission.of(scene).q_rad(np.array(start_usteps)).tolist()),
        zero_rad=tuple(joint.zero_offset_rad for joint in scene.joints),
        coupling=scene.coupling,
        gravity_m_s2=GRAVITY_M_S2 if mechanics.gravity else 0.0,
        base_m=(CM * scene.arm.base_cm[0], CM * scene.arm.base_cm[1]),
        obstacles=tuple(_obstacle(obstacle) for obstacle in scene.obstacles if obstacle.motion is None),
        switches=tuple(
            LimitSwitch(s.joint - 1, s.pin, s.at_rad, s.above, s.bounce_s, s.normally_closed)
            for s in scene.limit_switches
        ),
    )


def drivers_of(scene: Scene) -> list[DriverWiring]:
    """Return the scene's drivers on the pins of its board."""
    from planarm_sim import DriverWiring  # noqa: PLC0415

    board = scene.board
    return [
        DriverWiring(
            joint.driver_row,
            step,
            direction,
            board.enable_pin,
            microsteps=joint.microsteps,
            enable_active_high=scene.board_spec.enable_active_high,
        )
        for joint, (step, direction) in zip(scene.joints, board.joint_pins, strict=False)
    ]


def _motor(scene: Scene, number: int, joint: JointSpec) -> Motor:
    from planarm_sim import Motor  # noqa: PLC0415

    spec, mechanics = joint.motor, scene.mechanics
    return Motor(
        steps_per_rev=joint.steps_per_rev,
        holding_torque_nm=spec.holding_torque_nm,
        rated_current_a=spec.rated_current_a,
        current_a=spec.current_a,
        resistance_ohm=spec.resistance_ohm,
        inductance_h=spec.inductance_h,
        supply_v=spec.supply_v,
        rotor_inertia_kg_m2=spec.rotor_inertia_kg_m2,
        detent_torque_nm=spec.detent_torque_nm,
        damping_nm_s=spec.rotor_damping_nm_s,
        gear_ratio=joint.gear_ratio,
        reversed=joint.reversed,
        backlash_rad=mechanics.backlash_rad[number],
        stiffness_nm_rad=mechanics.stiffness_nm_rad[number],
    )


def _obstacle(obstacle: Obstacle) -> CircleObstacle | PolygonObstacle:
    from planarm_sim import CircleObstacle, PolygonObstacle  # noqa: PLC0415

    shape = shape_of(obstacle)
    if isinstance(shape, Circle):
        return CircleObstacle((CM * shape.center_cm[0], CM * shape.center_cm[1]), CM * shape.radius_cm)
    return PolygonObstacle(tuple((CM * x, CM * y) for x, y in shape.vertices_cm))
