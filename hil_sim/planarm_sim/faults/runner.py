"""Carries a schedule of faults out on a bench."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planarm_sim.bench import Bench
from planarm_sim.board import CLOCK_HZ
from planarm_sim.cpu.chip import ResetCause
from planarm_sim.errors import FaultError
from planarm_sim.faults.line import ActiveFault, FaultyLine
from planarm_sim.faults.schedule import Fault, Schedule

__all__ = ["FaultRunner", "inject"]

JAMMED_NM = 1e3
FOR_EVER = 1 << 62


def inject(bench: Bench, schedule: Schedule) -> FaultRunner:
    """Let a schedule of faults come true on a bench; use `bench.serial` for the line from now on.

    Raises:
        FaultError: it names a joint or a switch that the bench does not have.
    """
    return FaultRunner(bench, schedule)


class FaultRunner:
    """A schedule on a bench.

    Attributes:
        schedule: what goes wrong.
        line: the line with its faults.
        log: what happened, one line each, with seconds since power-up.
    """

    def __init__(self, bench: Bench, schedule: Schedule) -> None:
        self.schedule = schedule
        self.log = bench.fault_log
        self._bench = bench
        self._active: tuple[ActiveFault, ...] = ()
        self._before: dict[int, float] = {}
        for fault in schedule.faults:
            self._require_places(fault)
        self.line = FaultyLine(bench.uno, lambda: self._active)
        bench.serial = self.line
        if schedule.zero == "first_step":
            bench.on_first_step(self._begin)
        else:
            self._begin(0)

    @property
    def unplugged(self) -> bool:
        """Whether the cable is out now."""
        return self._holds("line.unplug") is not None

    @property
    def host_killed(self) -> bool:
        """Whether the host's program is dead by now."""
        return self._holds("host.killed") is not None

    def host_pause_cycles(self) -> int:
        """How many cycles from now on the host does nothing; 0 when it runs."""
        pause = self._holds("host.pause")
        return 0 if pause is None else pause.end - self._bench.cycle

    def _holds(self, kind: str) -> ActiveFault | None:
        now = self._bench.cycle
        return next((a for a in self._active if a.fault.kind == kind and a.holds(now)), None)

    def _require_places(self, fault: Fault) -> None:
        rig = self._bench.plant.rig
        if fault.kind == "mechanics.stop_input" and self._bench.stop_pin is None:
            raise FaultError(
                f"{self.schedule.source}: {fault.kind}: the bench has no stop contact; a scene's is board.stop_input"
            )
        for key, count, noun in (("joint", len(rig.motors), "joints"), ("switch", len(rig.switches), "limit switches")):
            number = fault.settings.get(key, 1)
            if key in fault.settings and number > count:
                raise FaultError(f"{self.schedule.source}: {fault.kind}: {key} {number}; the bench has {count} {noun}")

    def _begin(self, zero_cycle: int) -> None:
        active = []
        for index, fault in enumerate(self.schedule.faults):
            begin = zero_cycle + round(fault.at_s * CLOCK_HZ)
            end = FOR_EVER if fault.for_s is None else begin + round(fault.for_s * CLOCK_HZ)
            one = ActiveFault(fault, begin, end, np.random.default_rng([self.schedule.seed, index]))
            active.append(one)
            start, stop = self._actions(index, one)
            self._bench.at(begin, self._told(f"{fault.kind} begins", start))
            if end != FOR_EVER and stop is not None:
                self._bench.at(end, self._told(f"{fault.kind} ends", stop))
        self._active = tuple(active)

    def _told(self, what: str, action: Callable[[], None]) -> Callable[[], None]:
        def act() -> None:
            self.log.append(f"{self._bench.time_s:.6f} s: {what}")
            action()

        return act

    def _actions(self, index: int, one: ActiveFault) -> tuple[Callable[[], None], Callable[[], None] | None]:
        """Return what to do when a fault begins, and when it ends."""
        bench, plant = self._bench, self._bench.plant
        settings = one.fault.settings
        joint = int(settings.get("joint", 1)) - 1
        switch = int(settings.get("switch", 1)) - 1

        def nothing() -> None:
            """The fault is looked at by the line or by the host, all the time that it holds."""

        def set_baud(baud: float) -> None:
            self._before.setdefault(index, bench.uno.serial.baud)
            bench.uno.serial.baud = int(baud)

        actions: dict[str, tuple[Callable[[], None], Callable[[], None] | None]] = {
            "line.burst": (lambda: self._burst(one), None),
            "line.wrong_baud": (lambda: set_baud(settings["baud"]), lambda: set_baud(self._before[index])),
            "power.brown_out": (lambda: bench.uno.reset(ResetCause.BROWN_OUT), None),
            "power.reset": (lambda: bench.uno.reset(ResetCause.EXTERNAL), None),
            "power.motor_supply": (lambda: bench.set_motor_supply(False), lambda: bench.set_motor_supply(True)),
            "mechanics.stall": (
                lambda: plant.set_rotor_friction(joint, JAMMED_NM),
                lambda: plant.set_rotor_friction(joint, plant.rig.motors[joint].coulomb_nm),
            ),
            "mechanics.friction": (
                lambda: plant.set_friction(joint, plant.rig.joints[joint].coulomb_nm + settings["torque_nm"]),
                lambda: plant.set_friction(joint, plant.rig.joints[joint].coulomb_nm),
            ),
            "mechanics.bump": (
                lambda: plant.set_outside_torque(joint, settings["torque_nm"]),
                lambda: plant.set_outside_torque(joint, 0.0),
            ),
            "mechanics.stop_input": (lambda: bench.press_stop(True), lambda: bench.press_stop(False)),
            "mechanics.limit_switch": (
                lambda: bench.force_switch(switch, settings["state"]),
                lambda: bench.force_switch(switch, None),
            ),
        }
        return actions.get(one.fault.kind, (nothing, nothing))

    def _burst(self, one: ActiveFault) -> None:
        noise = one.random.integers(0, 256, int(one.fault.settings["bytes"])).astype(np.uint8).tobytes()
        self.line.insert(one.fault.settings["direction"], noise)
