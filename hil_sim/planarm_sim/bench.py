"""The bench: an emulated Uno, its drivers, motors and arm, in one time.

::

    from planarm_sim import Bench, Rig

    bench = Bench(uno, rig, drivers)
    bench.run(seconds=1)
    print(bench.q_rad, bench.report())

The board runs ahead by a slice; then its edges go through the drivers, and the arm follows. What the arm does to the
board, limit switches, happens as the next slice begins. Two runs with the same calls are the same to the last edge.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from planarm_sim.board import CLOCK_HZ, PINS, Uno
from planarm_sim.drivers import DriverBank, DriverCounts, DriverWiring, Violation
from planarm_sim.errors import UsageError
from planarm_sim.plant import Contact, Plant, Rig, Slip, StopHit

__all__ = ["Bench", "BenchReport"]

SLICE_CYCLES = 160_000
"""How far the board runs ahead of the arm, 10 ms, when nothing that the arm does can reach it."""
ATTENTIVE_SLICE_CYCLES = 16_000
"""The same while the first step is waited for, 1 ms."""
SWITCH_SLICE_CYCLES = 1600
"""The same with limit switches, 0.1 ms: how late the board may see one."""
BOUNCE_CYCLES = 3200
"""Between two bounces of a contact that was just pressed or let go of, 0.2 ms."""
CHATTER_CYCLES = 16_000
"""Between two changes of a switch that bounces on its own, 1 ms."""

SwitchState = Literal["stuck_open", "stuck_closed", "bouncing"]

EMPTY = np.empty(0, [("cycle", np.int64), ("pin", np.uint8), ("level", np.uint8)])


class SerialLine(Protocol):
    """The host's end of the serial line: `Uno.serial`, or one on which things go wrong."""

    baud: int
    host_takes: bool

    @property
    def bridge(self) -> object | None:
        """The board's USB bridge; None when the line is direct."""

    @property
    def room(self) -> int:
        """Bytes that can be written now without being held back."""

    @property
    def pending(self) -> int:
        """Bytes written that have not passed yet."""

    @property
    def idle_cycle(self) -> int:
        """Cycle at which the last byte written has passed."""

    @property
    def next_delivery_cycle(self) -> int:
        """First cycle at which there may be bytes to read that are not there now."""

    def write(self, data: bytes) -> None:
        """Send bytes to the board."""

    def read(self) -> bytes:
        """Take everything received so far."""

    def discard(self) -> int:
        """Throw away everything that the board sent and nobody read; returns how many bytes."""

    def peek(self) -> bytes:
        """Everything received so far, left in place."""


@dataclass(frozen=True, slots=True)
class BenchReport:
    """What happened on the bench so far; times are clock cycles since power-up.

    Attributes:
        cycle: now.
        counts: what each driver saw and did.
        lost_full_steps: how many full steps each rotor stands behind what its driver's pulses asked for, rounded; a
            load angle is not lost.
        slips: every electrical turn that a rotor lost.
        violations: every broken rule of a driver.
        contacts: every touch of a link and an obstacle.
        stop_hits: every time that a joint ran into a hard stop.
        faults: what a schedule of faults did, one line each.
    """

    cycle: int
    counts: tuple[DriverCounts, ...]
    lost_full_steps: tuple[int, ...]
    slips: tuple[Slip, ...]
    violations: tuple[Violation, ...]
    contacts: tuple[Contact, ...]
    stop_hits: tuple[StopHit, ...]
    faults: tuple[str, ...] = ()

    @property
    def clean(self) -> bool:
        """Whether nothing went wrong: no step lost, no rule broken, nothing hit."""
        return not (any(self.lost_full_steps) or self.slips or self.violations or self.contacts or self.stop_hits)


class Bench:
    """An Uno with drivers, motors and an arm.

    Args:
        uno: the board; from now on let time pass by the bench only.
        rig: the arm with its motors.
        drivers: one for each motor.
        step_cycles: the plant's step, see `Plant`.
        propped: somebody holds the arm where it stands, until all drivers are on for the first time.
        stop_pin: on the board, where a normally closed stop contact pulls it to ground; None: there is none.

    Attributes:
        uno: the board.
        plant: the arm.
        drivers: the drivers.
        serial: the host's end of the serial line; faults put another in its place.
        stop_pin: where the stop contact is wired.
        fault_log: what a schedule of faults did, one line each.
    """

    serial: SerialLine

    def __init__(
        self,
        uno: Uno,
        rig: Rig,
        drivers: Sequence[DriverWiring],
        *,
        step_cycles: int | None = None,
        propped: bool = False,
        stop_pin: str | None = None,
    ) -> None:
        if len(drivers) != len(rig.motors):
            raise UsageError(
                f"the rig has {len(rig.motors)} motors, {len(drivers)} drivers are given; give one for each"
            )
        self.uno = uno
        self.stop_pin = stop_pin
        self.serial = uno.serial
        self.fault_log: list[str] = []
        self.plant = Plant(rig, uno.cycle, step_cycles=step_cycles, propped=propped)
        for wiring in drivers:
            if wiring.enable is not None:  # the resistor that keeps the driver off while nothing drives the pin
                uno.pin(wiring.enable).drive(0 if wiring.enable_active_high else 1)
        levels = [0] * (1 + max(pin.index for pin in PINS))
        for pin in PINS:
            levels[pin.index] = uno.pin(pin.name).level
        self.drivers = DriverBank(drivers, levels, self.plant.start_phases)
        self._fresh: list[NDArray[Any]] = []
        self._seen_cycle = uno.cycle
        self._agenda: list[tuple[int, int, Callable[[], None]]] = []
        self._agenda_count = 0
        self._await_step: list[Callable[[int], None]] = []
        self._forced: dict[int, SwitchState] = {}
        self._switches_seen = 0
        states = self.drivers.states
        self.plant.take(np.array([[uno.cycle, m, phase, on] for m, (phase, on) in enumerate(states.tolist())]))
        uno.listen(self._hear)
        if stop_pin is not None:
            uno.pin(stop_pin).drive(0)
        for k in range(len(rig.switches)):
            self._show_switch(k, self.plant.pressed[k])

    @property
    def cycle(self) -> int:
        """Clock cycles since power-up."""
        return self.uno.cycle

    @property
    def time_s(self) -> float:
        """Seconds since power-up."""
        return self.uno.time_s

    @property
    def q_rad(self) -> NDArray[np.float64]:
        """Joint angles now."""
        self.catch_up()
        return self.plant.q_rad

    def run(self, *, cycles: int | None = None, seconds: float | None = None) -> None:
        """Let time pass for board, drivers and arm, by a number of cycles or of seconds.

        Raises:
            UsageError: not exactly one of the two, or negative.
            StoppedError: the program came to an end before.
        """
        if (cycles is None) == (seconds is None):
            raise UsageError("run takes either cycles or seconds")
        self._advance(round(seconds * CLOCK_HZ) if seconds is not None else int(cycles or 0), 0)

    def run_to_reply(self, *, cycles: int, quiet_cycles: int) -> bool:
        """Let time pass as `Uno.run_to_reply` does, for the arm too; a slice may end amid a reply."""
        return self._advance(cycles, quiet_cycles)

    def _advance(self, cycles: int, quiet_cycles: int) -> bool:
        """Run; with `quiet_cycles` to the end of a reply at the latest, and tell whether there was one."""
        if cycles < 0:
            raise UsageError(f"the bench was asked to run for {cycles} cycles; time runs forward only")
        uno, sent = self.uno, False
        end = uno.cycle + cycles
        while uno.cycle < end and not sent:
            self._do_what_is_due()
            look_at = self._seen_cycle + self._slice_cycles()
            ahead = min(end, look_at, self._next_due()) - uno.cycle
            if ahead > 0 and quiet_cycles:
                sent = uno.run_to_reply(cycles=ahead, quiet_cycles=quiet_cycles)
            elif ahead > 0:
                uno.run(cycles=ahead)
            if uno.cycle >= look_at:
                self.catch_up()
        return sent

    def _slice_cycles(self) -> int:
        if self.plant.rig.switches:
            return SWITCH_SLICE_CYCLES
        return ATTENTIVE_SLICE_CYCLES if self._await_step else SLICE_CYCLES

    def reset(self) -> None:
        """Press the board's reset button; drivers, motors and arm go on."""
        self.uno.reset()

    def at(self, cycle: int, action: Callable[[], None]) -> None:
        """Do something to the bench when its time comes; actions of one cycle happen in the order of these calls."""
        self._agenda_count += 1
        self._agenda.append((cycle, self._agenda_count, action))
        self._agenda.sort(key=lambda entry: entry[:2])

    def on_first_step(self, action: Callable[[int], None]) -> None:
        """Do something when the first step pulse is seen; it is given the pulse's cycle, a slice ago at most."""
        self._await_step.append(action)

    def catch_up(self) -> None:
        """Let drivers and arm see everything up to the board's time."""
        now = self.uno.cycle
        edges = np.concatenate([EMPTY, *self._fresh]) if self._fresh else EMPTY
        self._fresh = []
        before = self.drivers.counted_phases
        events = self.drivers.see(edges, now)
        self.plant.take(events)
        self.plant.run_to(now)
        self._seen_cycle = now
        if self._await_step and (self.drivers.counted_phases != before).any():
            waiting, self._await_step = self._await_step, []
            for action in waiting:
                action(int(events[0, 0]))
        self._follow_switches()

    def set_motor_supply(self, on: bool) -> None:
        """Switch the supply of all motors; the board on USB goes on."""
        self.catch_up()
        for m in range(len(self.drivers.wirings)):
            self.plant.take(self.drivers.set_power(m, on, self.uno.cycle))

    def force_switch(self, switch: int, state: SwitchState | None) -> None:
        """Let a limit switch stick or bounce from now on; None: it works again."""
        if state is None:
            self._forced.pop(switch, None)
            self._show_switch(switch, self.plant.pressed[switch])
            return
        self._forced[switch] = state
        if state == "bouncing":
            self._chatter(switch, True)
        else:
            self._drive_switch(switch, state == "stuck_closed")

    def press_stop(self, pressed: bool) -> None:
        """Open the stop contact, or close it again.

        Raises:
            UsageError: there is none.
        """
        if self.stop_pin is None:
            raise UsageError("the bench has no stop contact; give it a stop_pin")
        self.uno.pin(self.stop_pin).drive(int(pressed))

    def report(self) -> BenchReport:
        """What happened so far."""
        self.catch_up()
        lost = self.plant.lost_full_steps(self.drivers.wanted_phases)
        return BenchReport(
            cycle=self.uno.cycle,
            counts=self.drivers.counts(),
            lost_full_steps=tuple(round(steps) for steps in lost),
            slips=self.plant.slips(),
            violations=self.drivers.violations(),
            contacts=self.plant.contacts(),
            stop_hits=self.plant.stop_hits(),
            faults=tuple(self.fault_log),
        )

    def write_report(self, path: Path) -> None:
        """Write `report` as a JSON file."""
        path.write_text(json.dumps(asdict(self.report()), indent=1) + "\n", encoding="utf-8")

    def write_motion(self, path: Path) -> None:
        """Write `motion` as a CSV file: seconds, joint angles in radians, rotor angles in radians."""
        motion = self.motion()
        columns = np.column_stack([motion["cycle"] / CLOCK_HZ, motion["q_rad"], motion["rotor_rad"]])
        names = [f"q{j + 1}_rad" for j in range(motion["q_rad"].shape[1])]
        names += [f"rotor{m + 1}_rad" for m in range(motion["rotor_rad"].shape[1])]
        np.savetxt(path, columns, "%.9g", ",", header=",".join(["t_s", *names]), comments="")

    def motion(self) -> NDArray[Any]:
        """Samples of the motion so far, see `Plant.motion`."""
        self.catch_up()
        return self.plant.motion()

    def _hear(self, edges: NDArray[Any]) -> None:
        self._fresh.append(edges)

    def _follow_switches(self) -> None:
        """Carry the switches' changes to the board; the contact chatters for a while after each."""
        changes = self.plant.switch_changes(self._switches_seen) if self.plant.rig.switches else ()
        self._switches_seen += len(changes)
        for change in changes:
            if change.switch in self._forced:
                continue
            bounces = int(self.plant.rig.switches[change.switch].bounce_s * CLOCK_HZ / BOUNCE_CYCLES)
            self._show_switch(change.switch, change.pressed)
            for n in range(1, 2 * (bounces // 2) + 1):
                level = change.pressed if n % 2 == 0 else not change.pressed
                self.at(self.uno.cycle + n * BOUNCE_CYCLES, partial(self._show_unless_forced, change.switch, level))

    def _chatter(self, switch: int, closed: bool) -> None:
        """Open and close a bouncing switch until it works again."""
        if self._forced.get(switch) == "bouncing":
            self._drive_switch(switch, closed)
            self.at(self.uno.cycle + CHATTER_CYCLES, partial(self._chatter, switch, not closed))

    def _show_unless_forced(self, switch: int, pressed: bool) -> None:
        if switch not in self._forced:
            self._show_switch(switch, pressed)

    def _show_switch(self, switch: int, pressed: bool) -> None:
        self._drive_switch(switch, pressed != self.plant.rig.switches[switch].normally_closed)

    def _drive_switch(self, switch: int, closed: bool) -> None:
        pin = self.uno.pin(self.plant.rig.switches[switch].pin)
        pin.drive(0 if closed else 1)

    def _do_what_is_due(self) -> None:
        while self._agenda and self._agenda[0][0] <= self.uno.cycle:
            _, _, action = self._agenda.pop(0)
            self.catch_up()
            action()

    def _next_due(self) -> int:
        return self._agenda[0][0] if self._agenda else 1 << 62
