"""The arm as an object: it takes what the drivers ask for and lets time pass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm_sim.errors import UsageError
from planarm_sim.plant import layout, simulate
from planarm_sim.plant.build import CYCLES_PER_S, body_of, drive_of, fitting_step, start_of, switches_of
from planarm_sim.plant.contact import obstacle_arrays
from planarm_sim.plant.happenings import Contact, Slip, StopHit, SwitchChange
from planarm_sim.plant.rigid_body import energy_j
from planarm_sim.plant.spec import Rig

__all__ = ["Plant"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAMPLE_CYCLES = 8000
"""Time between samples of the motion, 0.5 ms."""
CHUNK_STEPS = 4000
MOST_MARKS = 4096
NEVER = 1 << 62
REST_RAD_S = 1e-7
REST_A = 1e-9
"""Where all moves slower and no current changes more, nothing will move before something is asked for."""
NO_EVENTS = np.empty((0, 4), np.int64)
PHASE_PER_STEP = 256


class Plant:
    """An arm with its motors, from a cycle on.

    Args:
        rig: what stands there; it is at rest at the rig's start.
        cycle: clock cycle of 62.5 ns at which it begins.
        step_cycles: length of a step; None chooses one at which the fastest vibration is computed well.
        sample_cycles: time between samples of `motion`; 0 keeps none.
        propped: somebody holds the arm where it stands, until every motor's driver is on for the first time.
    """

    def __init__(
        self,
        rig: Rig,
        cycle: int = 0,
        *,
        step_cycles: int | None = None,
        sample_cycles: int = SAMPLE_CYCLES,
        propped: bool = False,
    ) -> None:
        self.rig = rig
        self._step_cycles = step_cycles or fitting_step(rig)
        self._begin = cycle
        self._cycle = cycle
        self._sample_cycles = sample_cycles
        n = len(rig.links)
        self._body = body_of(rig)
        self._drive = drive_of(rig)
        self._obstacles = obstacle_arrays(rig.obstacles)
        self._state = start_of(rig, self._drive)
        self._switches = switches_of(rig)
        size = len(self._state.y)
        self._work = layout.Work(np.zeros((4, size)), np.zeros(size), *(np.zeros(s) for s in ((n, n), n, n, (n, n), n)))
        self._marks: list[Floats] = []
        self._switched: list[SwitchChange] = []
        self._log = [np.concatenate([[cycle], self._state.y])[None]]
        self._waiting = NO_EVENTS
        self._at_rest = False
        self._propped = propped

    @property
    def cycle(self) -> int:
        """Time up to which it was computed; less than a step before what was asked for."""
        return self._cycle

    @property
    def step_cycles(self) -> int:
        """Length of a step in cycles."""
        return self._step_cycles

    @property
    def start_phases(self) -> tuple[int, ...]:
        """Phases at which drivers hold the rotors where they start, in 1/256 of a full step."""
        turns = self._rotors_at(np.array(self.rig.start_rad)) / (2.0 * np.pi)
        steps = np.array([motor.steps_per_rev for motor in self.rig.motors])
        return tuple(int(p) for p in np.rint(turns * steps * PHASE_PER_STEP))

    @property
    def q_rad(self) -> Floats:
        """Joint angles now."""
        n = len(self.rig.links)
        return np.diff(self._state.y[:n], prepend=0.0)

    @property
    def q_dot_rad_s(self) -> Floats:
        """Joint speeds now."""
        n = len(self.rig.links)
        return np.diff(self._state.y[n : 2 * n], prepend=0.0)

    @property
    def rotors_rad(self) -> Floats:
        """Rotor angles now, from where micro-step 0 is."""
        n = len(self.rig.links)
        return self._state.y[2 * n : 2 * n + len(self.rig.motors)].copy()

    @property
    def currents_a(self) -> Floats:
        """Phase currents now, shape (motors, 2)."""
        return self._state.currents.copy()

    @property
    def energy_j(self) -> float:
        """Kinetic and potential energy of links, rotors and gears now."""
        n, m = len(self.rig.links), len(self.rig.motors)
        y, drive = self._state.y, self._drive
        total = float(energy_j(self._body.a, self._body.b, self._body.gravity, y[:n], y[n : 2 * n]))
        slack = drive.coupling @ (self.q_rad - drive.zero) - drive.gear * y[2 * n : 2 * n + m]
        beyond = np.maximum(np.abs(slack) - drive.half_play, 0.0)
        return total + float(
            (0.5 * drive.stiffness * beyond**2).sum() + (0.5 * drive.inertia * y[2 * n + m :] ** 2).sum()
        )

    def set_motion(self, q_rad: Sequence[float], q_dot_rad_s: Sequence[float]) -> None:
        """Put the joints somewhere, moving; the rotors follow without strain."""
        n, m = len(self.rig.links), len(self.rig.motors)
        y = self._state.y
        y[:n], y[n : 2 * n] = np.cumsum(q_rad), np.cumsum(q_dot_rad_s)
        y[2 * n : 2 * n + m] = self._rotors_at(np.asarray(q_rad))
        self._at_rest = False
        y[2 * n + m :] = (self._drive.coupling @ np.asarray(q_dot_rad_s)) / self._drive.gear

    def set_friction(self, joint: int, coulomb_nm: float) -> None:
        """Change a joint's dry friction from now on."""
        self._at_rest = False
        self._state.coulomb[joint] = coulomb_nm

    def set_rotor_friction(self, motor: int, coulomb_nm: float) -> None:
        """Change a rotor's dry friction from now on; far beyond its torque it is jammed."""
        self._at_rest = False
        self._state.rotor_coulomb[motor] = coulomb_nm

    def set_outside_torque(self, joint: int, torque_nm: float) -> None:
        """Push on a joint from outside, from now on."""
        self._at_rest = False
        self._state.outside[joint] = torque_nm

    def take(self, events: Ints) -> None:
        """Take what the drivers ask for: cycle, motor, phase, on; it counts when its time comes."""
        if len(events):
            waiting = np.concatenate([self._waiting, events])
            self._waiting = waiting[np.argsort(waiting[:, 0], kind="stable")]

    def run_to(self, cycle: int) -> None:
        """Let time pass up to `cycle`, in whole steps.

        Raises:
            UsageError: the state is no number any more; the step is too long for what was set.
        """
        steps = (cycle - self._cycle) // self._step_cycles
        while steps > 0:
            chunk = self._skip_rest(steps)
            if chunk == 0:
                chunk = min(steps, CHUNK_STEPS)
                before = self._state.y.copy(), self._state.currents.copy()
                self._run(chunk)
                self._at_rest = self._rests_since(*before)
            steps -= chunk
        if not np.isfinite(self._state.y).all():
            raise UsageError(
                f"the arm's motion is no number any more before {self._cycle / CYCLES_PER_S:.6f} s: a step of "
                f"{self._step_cycles} cycles is too long for its stiffest gear or lightest link; lower "
                "mechanics.stiffness_nm_rad, or make the link heavier"
            )

    def _skip_rest(self, steps: int) -> int:
        """Let time pass without computing while nothing moves and nothing is asked for; returns the steps skipped."""
        if self._propped:
            steps = min(steps, (self._let_go() - self._cycle) // self._step_cycles)
            self._propped = steps > 0
        elif not self._at_rest:
            return 0
        elif len(self._waiting):
            steps = min(steps, int(self._waiting[0, 0] - self._cycle) // self._step_cycles - 1)
        if steps <= 0:
            return 0
        self._cycle += steps * self._step_cycles
        if self._sample_cycles:
            self._log.append(np.concatenate([[self._cycle], self._state.y])[None])
        return steps

    def _let_go(self) -> int:
        """The cycle from which all drivers hold their motors, or NEVER; while propped, all they asked for waits."""
        on = np.zeros(len(self.rig.motors), np.bool_)
        for cycle, motor, _, is_on in self._waiting.tolist():
            on[motor] = is_on
            if on.all():
                return int(cycle)
        return NEVER

    def _rests_since(self, y: Floats, currents: Floats) -> bool:
        n, m = len(self.rig.links), len(self.rig.motors)
        speeds = np.concatenate([self._state.y[n : 2 * n], self._state.y[2 * n + m :]])
        return bool(
            np.abs(speeds).max() < REST_RAD_S
            and np.abs(self._state.y - y).max() < REST_RAD_S
            and np.abs(self._state.currents - currents).max(initial=0.0) < REST_A
        )

    def _run(self, steps: int) -> None:
        every = self._sample_cycles or (1 << 60)
        end = self._cycle + steps * self._step_cycles
        log = np.empty((end // every - self._cycle // every + 1, 1 + len(self._state.y)))
        marks = np.empty((MOST_MARKS, layout.MARK_COLUMNS))
        due = int(np.searchsorted(self._waiting[:, 0], end, side="left"))
        logged, marked = simulate.advance(
            self._body,
            self._drive,
            self._obstacles,
            self._switches,
            self._state,
            self._work,
            self._cycle,
            steps,
            self._step_cycles,
            self._waiting[:due],
            log,
            every,
            marks,
        )
        # The middle of the last step has not passed for what came in its second half.
        done = int(np.searchsorted(self._waiting[:, 0], end - self._step_cycles + self._step_cycles // 2, side="right"))
        self._waiting = self._waiting[done:]
        self._cycle = end
        if logged:
            self._log.append(log[:logged].copy())
        if marked:
            self._marks.append(marks[:marked].copy())
            self._switched += _switch_changes(marks[:marked])

    def motion(self) -> NDArray[Any]:
        """Samples of the motion so far.

        Returns:
            Structured array: cycle (int64), q_rad (joints), q_dot_rad_s (joints), rotor_rad (motors).
        """
        rows = np.concatenate(self._log)
        self._log = [rows]
        n, m = len(self.rig.links), len(self.rig.motors)
        dtype = [("cycle", np.int64), ("q_rad", float, (n,)), ("q_dot_rad_s", float, (n,)), ("rotor_rad", float, (m,))]
        result = np.empty(len(rows), dtype)
        result["cycle"] = rows[:, 0]
        result["q_rad"] = np.diff(rows[:, 1 : n + 1], prepend=0.0, axis=1)
        result["q_dot_rad_s"] = np.diff(rows[:, n + 1 : 2 * n + 1], prepend=0.0, axis=1)
        result["rotor_rad"] = rows[:, 2 * n + 1 : 2 * n + m + 1]
        return result

    def slips(self) -> tuple[Slip, ...]:
        """Every electrical turn that a rotor lost, in order of time."""
        rows = self._marked(layout.SLIPPED)
        return tuple(Slip(int(c), int(m), 4 * int(turns), speed) for c, _, m, turns, speed in rows)

    def contacts(self) -> tuple[Contact, ...]:
        """Every touch of a link and an obstacle, in order of time."""
        rows = self._marked(layout.TOUCHED)
        return tuple(Contact(int(c), int(i), int(k), place) for c, _, i, k, place in rows)

    def stop_hits(self) -> tuple[StopHit, ...]:
        """Every time that a joint ran into a hard stop."""
        return tuple(StopHit(int(c), int(i), q) for c, _, i, _, q in self._marked(layout.STOPPED))

    def switch_changes(self, after: int = 0) -> tuple[SwitchChange, ...]:
        """Every change of a limit switch, without its bouncing, but the first `after` of them."""
        return tuple(self._switched[after:])

    @property
    def pressed(self) -> tuple[bool, ...]:
        """Whether each limit switch is pressed now."""
        return tuple(bool(p) for p in self._switches.pressed)

    def lost_full_steps(self, counted_phases: Ints) -> tuple[float, ...]:
        """How far each rotor is behind what its driver counted since the start, in full steps, load angle included."""
        moved = self.rotors_rad - self._rotors_at(np.array(self.rig.start_rad))
        steps = np.array([motor.steps_per_rev for motor in self.rig.motors]) / (2.0 * np.pi)
        return tuple((counted_phases / PHASE_PER_STEP - moved * steps).tolist())

    def snapshot(self) -> tuple[Any, ...]:
        """Copy what decides the further run, and what was seen so far."""
        arrays = [array.copy() for array in (*self._state, self._switches.pressed)]
        return self._cycle, arrays, list(self._log), list(self._marks), self._waiting, self._propped

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        self._at_rest = False
        self._cycle, arrays, log, marks, self._waiting, self._propped = snapshot
        for array, saved in zip((*self._state, self._switches.pressed), arrays, strict=True):
            array[...] = saved
        self._log, self._marks = list(log), list(marks)
        self._switched = [change for rows in marks for change in _switch_changes(rows)]

    def _marked(self, kind: int) -> list[list[float]]:
        return _of_kind(np.concatenate([np.empty((0, layout.MARK_COLUMNS)), *self._marks]), kind)

    def _rotors_at(self, q_rad: Floats) -> Floats:
        turned: Floats = self._drive.coupling @ (q_rad - self._drive.zero) / self._drive.gear
        return turned


def _of_kind(marks: Floats, kind: int) -> list[list[float]]:
    return [list(row) for row in marks[marks[:, 1] == kind].tolist()]


def _switch_changes(marks: Floats) -> list[SwitchChange]:
    rows = _of_kind(marks, layout.SWITCHED)
    return [SwitchChange(int(c), int(k), bool(pressed)) for c, _, k, pressed, _ in rows]
