"""The drivers on a bench: fed with the board's edges, they say what the motors are asked for and what was broken."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm_sim.board.pins import pin_name, pin_place
from planarm_sim.drivers import judge
from planarm_sim.errors import UsageError
from planarm_wire.drivers import DRIVERS, RULES, DriverRow

__all__ = ["DriverBank", "DriverCounts", "DriverWiring", "Violation", "driver_row", "wiring_of"]

CYCLES_PER_S = 16_000_000
_NO_EDGES = np.zeros((0, 3), np.int64)


@dataclass(frozen=True, slots=True)
class DriverWiring:
    """A driver and how it is wired to the board.

    Attributes:
        row: the driver.
        step: pin on the board that STEP is wired to; so are the others.
        direction: DIR.
        enable: ENABLE; None: strapped so that current flows. On a bench a resistor keeps the driver off while nothing
            drives the pin (docs/wiring.md).
        sleep: SLEEP, active low; None: strapped high.
        mode_pins: micro-step pins, as many as the row's modes have; empty: strapped, or switches, to `microsteps`.
        microsteps: resolution when the mode pins are not wired.
        enable_active_high: current flows where ENABLE is high, as behind an inverting input.
    """

    row: DriverRow
    step: str
    direction: str
    enable: str | None = None
    sleep: str | None = None
    mode_pins: tuple[str, ...] = ()
    microsteps: int = 16
    enable_active_high: bool = False

    def __post_init__(self) -> None:
        if not self.mode_pins and self.microsteps not in self.row.microsteps:
            known = ", ".join(map(str, self.row.microsteps))
            raise UsageError(f"{self.row.title} has no {self.microsteps} micro-steps; it has {known}")
        if self.mode_pins and len(self.mode_pins) != len(next(iter(self.row.modes), ())):
            raise UsageError(f"{self.row.title} has {len(next(iter(self.row.modes), ()))} mode pins: {self.mode_pins}")


@dataclass(frozen=True, slots=True)
class Violation:
    """A broken rule.

    Attributes:
        cycle: clock cycle of the edge that broke it.
        driver: number of the driver, from 0.
        pin: the driver's STEP pin.
        rule: one of `planarm_wire.drivers.RULES`.
        measured_ns: the time that was kept.
        limit_ns: the time that was needed.
    """

    cycle: int
    driver: int
    pin: str
    rule: str
    measured_ns: float
    limit_ns: float

    @property
    def time_s(self) -> float:
        """Seconds since power-up."""
        return self.cycle / CYCLES_PER_S


@dataclass(frozen=True, slots=True)
class DriverCounts:
    """What a driver saw and did, in micro-steps of its present size.

    Attributes:
        pulses: rises of STEP.
        wanted: signed sum of what the pulses asked for by the DIR level at each rise.
        made: signed sum of the steps taken.
    """

    pulses: int
    wanted: float
    made: float


class DriverBank:
    """All drivers of a bench.

    Args:
        wirings: the drivers.
        levels: the level of every pin of the chip now.
        start_phases: where each driver's phase stands, in 1/256 of a full step: where the rotor is.

    Motor supply has been there for long.
    """

    def __init__(self, wirings: Sequence[DriverWiring], levels: Sequence[int], start_phases: Sequence[int]) -> None:
        self._wirings = tuple(wirings)
        count = len(self._wirings)
        self._pins = np.full((count, judge.INPUTS), -1, np.int64)
        self._limits = np.full((count, judge.LIMIT_COLUMNS), -1.0)
        self._sizes = np.zeros((count, 8), np.int64)
        self._state = np.zeros((count, judge.STATE_COLUMNS), np.int64)
        self._violations: list[NDArray[np.float64]] = []
        for d, wiring in enumerate(self._wirings):
            self._set_up(d, wiring, levels, start_phases[d])

    def _set_up(self, d: int, wiring: DriverWiring, levels: Sequence[int], phase: int) -> None:
        row, state = wiring.row, self._state[d]
        names = (wiring.step, wiring.direction, wiring.enable, wiring.sleep, *wiring.mode_pins)
        for role, name in enumerate(names):
            if name is not None:
                self._pins[d, role] = pin_place(name).index
        for rule, name in enumerate(RULES):
            limit_s = row.limit_s(name)
            self._limits[d, rule] = -1.0 if limit_s is None else round(1e9 * limit_s, 3)
        self._limits[d, judge.COUNTS_DISABLED] = float(row.counts_disabled)
        self._limits[d, judge.HOME] = round(row.home_deg / 360.0 * judge.PHASE_TURN)
        for bits in range(8):
            chosen = tuple(bits >> k & 1 for k in range(len(wiring.mode_pins)))
            # Levels that the sheet does not list give the finest steps.
            microsteps = row.modes.get(chosen, max(row.microsteps)) if wiring.mode_pins else wiring.microsteps
            self._sizes[d, bits] = judge.PHASE_PER_STEP // microsteps
        level = [levels[pin] if pin >= 0 else None for pin in self._pins[d].tolist()]
        state[[judge.ROSE, judge.FELL, judge.TURNED, judge.ENABLED_AT, judge.MODE_AT, judge.AWAKE_AT]] = judge.NEVER
        state[judge.STEP], state[judge.DIR] = level[judge.IN_STEP] or 0, level[judge.IN_DIR] or 0
        self._limits[d, judge.ENABLE_ON] = float(wiring.enable_active_high)
        state[judge.ENABLED] = level[judge.IN_ENABLE] in (None, int(wiring.enable_active_high))
        state[judge.AWAKE] = level[judge.IN_SLEEP] in (None, 1)
        state[judge.MODE_BITS] = sum((bit or 0) << k for k, bit in enumerate(level[judge.IN_MODE :]))
        state[judge.SIZE] = state[judge.OLD_SIZE] = self._sizes[d, state[judge.MODE_BITS]]
        state[judge.POWERED] = 1
        state[judge.PHASE] = phase

    @property
    def wirings(self) -> tuple[DriverWiring, ...]:
        """The drivers, as wired."""
        return self._wirings

    def see(self, edges: NDArray[Any], until: int) -> NDArray[np.int64]:
        """Let the drivers see edges and the time up to a cycle.

        Args:
            edges: fields cycle, pin and level, in order of time, later than what was seen before.
            until: cycle up to which time has passed.

        Returns:
            What changes for the motors, in order of time: cycle, driver, phase in 1/256 of a full step, and whether
            current flows; shape (n, 4).
        """
        rows = _NO_EDGES if len(edges) == 0 else np.column_stack([edges[f] for f in ("cycle", "pin", "level")])
        count = len(self._wirings)
        events = np.empty((2 * len(rows) * count + count, judge.EVENT_COLUMNS), np.int64)
        violations = np.empty((4 * len(rows) * count, judge.VIOLATION_COLUMNS))
        made, broken = judge.judge_edges(
            self._state, self._limits, self._pins, self._sizes, rows.astype(np.int64), until, events, violations
        )
        if broken:
            self._violations.append(violations[:broken].copy())
        return in_order(events[:made])

    def set_power(self, driver: int, powered: bool, cycle: int) -> NDArray[np.int64]:
        """Switch the motor supply of a driver; returns events as `see` does."""
        events = np.empty((2, judge.EVENT_COLUMNS), np.int64)
        made = judge.set_power(self._state[driver], self._limits[driver], driver, cycle, powered, events, 0)
        return events[:made]

    def violations(self) -> tuple[Violation, ...]:
        """Every broken rule so far, in order of time."""
        rows = np.concatenate([np.empty((0, judge.VIOLATION_COLUMNS)), *self._violations])
        return tuple(
            Violation(
                int(cycle),
                int(driver),
                pin_name(int(self._pins[int(driver), judge.IN_STEP])) or "?",
                RULES[int(rule)],
                measured,
                float(self._limits[int(driver), int(rule)]),
            )
            for cycle, driver, rule, measured in rows.tolist()
        )

    def counts(self) -> tuple[DriverCounts, ...]:
        """What each driver saw and did so far."""
        return tuple(
            DriverCounts(
                int(row[judge.PULSES]),
                int(row[judge.WANTED]) / int(row[judge.SIZE]),
                int(row[judge.COUNTED]) / int(row[judge.SIZE]),
            )
            for row in self._state
        )

    @property
    def counted_phases(self) -> NDArray[np.int64]:
        """Steps taken by each driver so far, signed, in 1/256 of a full step."""
        return self._state[:, judge.COUNTED].copy()

    @property
    def wanted_phases(self) -> NDArray[np.int64]:
        """What each driver's pulses asked for so far, signed, in 1/256 of a full step."""
        return self._state[:, judge.WANTED].copy()

    @property
    def states(self) -> NDArray[np.int64]:
        """Each driver's phase and whether current flows, now, shape (drivers, 2)."""
        flows = self._state[:, judge.ENABLED] & self._state[:, judge.AWAKE] & self._state[:, judge.POWERED]
        return np.column_stack([self._state[:, judge.PHASE], flows])

    def snapshot(self) -> tuple[NDArray[np.int64], tuple[NDArray[np.float64], ...]]:
        """Copy what decides the further run."""
        return self._state.copy(), tuple(self._violations)

    def restore(self, snapshot: tuple[NDArray[np.int64], tuple[NDArray[np.float64], ...]]) -> None:
        """Go back to a snapshot."""
        self._state[:] = snapshot[0]
        self._violations = list(snapshot[1])


def driver_row(name: str) -> DriverRow:
    """Return a driver's row.

    Raises:
        UsageError: no such driver; the message names the closest.
    """
    if name in DRIVERS:
        return DRIVERS[name]
    close = difflib.get_close_matches(name, DRIVERS, n=1, cutoff=0.0)[0]
    raise UsageError(f"no driver {name!r}; known: {', '.join(DRIVERS)}. Closest: {close}")


def wiring_of(driver: str, **settings: Any) -> DriverWiring:  # noqa: ANN401 - they are DriverWiring's
    """Return a driver on its pins, by the driver's name and `DriverWiring`'s settings.

    Raises:
        UsageError: no such driver, or it has no such micro-steps.
    """
    return DriverWiring(driver_row(driver), **settings)


def in_order(events: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return events sorted by time; those of one moment stay in their order."""
    return events[np.argsort(events[:, 0], kind="stable")]
