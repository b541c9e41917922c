"""Watches a chip: keeps the arrays of `kernels.py` and makes figures of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import layout as at
from planarm_sim.cpu.decode import FLASH_WORDS
from planarm_sim.cpu.layout import Bytes, State
from planarm_sim.cpu.program import Program
from planarm_sim.cpu.registers import SRAM_END
from planarm_sim.insight import kernels as k
from planarm_sim.insight.figures import (
    INTERVAL,
    VECTOR_NAMES,
    FunctionFigures,
    Insight,
    InterruptFigures,
    Spread,
    running_interrupts,
)
from planarm_sim.insight.roles import landmarks, roles_for_insight, with_breakpoints
from planarm_sim.loader import Symbol

__all__ = ["Observer"]

LOG_INTERVALS = 16_384
_NOTHING = np.empty(0, INTERVAL)


class Observer:
    """What watches one chip; see `Chip.watch`.

    Args:
        symbols: the program's functions.
        figures: keep figures; without, only breakpoints are seen to.
        keep_intervals: keep every interrupt's interval, too.
    """

    def __init__(self, symbols: Iterable[Symbol] = (), *, figures: bool = True, keep_intervals: bool = True) -> None:
        self._symbols = tuple(symbol for symbol in symbols if symbol.address < 2 * FLASH_WORDS)
        self._figures = figures
        self._keep_intervals = keep_intervals
        self._breakpoints: frozenset[int] = frozenset()
        self._places = self._values = np.empty(0, dtype=np.int64)
        self._program: Program | None = None
        self._roles = self._landmarks = np.empty(0, dtype=np.int64)
        self._log = np.zeros(LOG_INTERVALS * k.INTERVAL_WORDS, dtype=np.int64)
        self._intervals: list[NDArray[Any]] = []
        self.begin(0)

    def begin(self, cycle: int) -> None:
        """Forget everything noted and begin at `cycle`."""
        self._start = cycle
        self._intervals = []
        self._functions = np.zeros((len(self._symbols) + 1) * k.FUNCTION_WORDS, dtype=np.int64)
        self._vectors = np.zeros(at.VECTORS * k.VECTOR_WORDS, dtype=np.int64)
        figures = self._vectors.reshape(at.VECTORS, k.VECTOR_WORDS)
        figures[:, [k.LATENCY_LEAST, k.DURATION_LEAST]] = at.NEVER
        figures[:, [k.ACKNOWLEDGED_AT, k.LEFT_AT]] = cycle
        self._totals = np.zeros(k.TOTALS, dtype=np.int64)
        self._totals[k.DEEPEST_SP] = SRAM_END - 1
        self._totals[[k.PASSED_AT, k.CHANGED]] = -1
        self._frames = np.zeros(k.FRAMES * k.FRAME_WORDS, dtype=np.int64)
        self.restart(cycle)

    def restart(self, cycle: int) -> None:
        """The chip was reset at `cycle`: what ran has ended there, and nothing will return from it."""
        if self._totals[k.DEPTH]:
            self._wake(cycle, self._totals, self._frames)
            k.end_frames(cycle, k.ABOVE_ALL, *self._arrays())
        self._totals[[k.DEPTH, k.ASLEEP_SINCE]] = (1, -1)
        self._frames[: k.FRAME_WORDS] = (k.ABOVE_ALL, k.NO_FUNCTION, 0, cycle, 0, 0, 0, 0)

    @property
    def breakpoints(self) -> frozenset[int]:
        """Word addresses at which the chip stops before the instruction."""
        return self._breakpoints

    @breakpoints.setter
    def breakpoints(self, words: Iterable[int]) -> None:
        self._breakpoints = frozenset(words)
        self._program = None

    @property
    def watchpoints(self) -> frozenset[int]:
        """Data addresses at whose change the chip stops, after the instruction that made it."""
        return frozenset(self._places.tolist())

    @watchpoints.setter
    def watchpoints(self, addresses: Iterable[int]) -> None:
        self._places = np.array(sorted(addresses), dtype=np.int64)
        self._values = np.full(len(self._places), -1, dtype=np.int64)

    @property
    def changed_address(self) -> int | None:
        """The watched data address whose change stopped the chip; None when something else did."""
        changed = int(self._totals[k.CHANGED])
        return changed if changed >= 0 else None

    def pass_breakpoint(self, cycle: int) -> None:
        """Do not stop at a breakpoint at this cycle, nor for changes made before: a debugger goes on."""
        self._totals[k.PASSED_AT] = cycle
        self._values[:] = -1

    def advance(self, st: State, memory: Bytes, words: State, program: Program, target: int) -> int:
        """Run as `dispatch.run` does and note what is met; returns one of `service`'s stops."""
        if program is not self._program:
            self._look_at(program)
        chip = (st, memory, words, program.code, self._landmarks, program.flash, self._roles)
        self._totals[k.CHANGED] = -1
        for index in np.nonzero(self._values < 0)[0]:
            self._values[index] = k.data_byte(st, memory, int(self._places[index]))
        while True:
            if len(self._places):
                cause = k.run_to_change(*chip, *self._arrays(), self._places, self._values, target)
            else:
                cause = k.run_watched(*chip, *self._arrays(), target)
            self._take_log()
            if cause != k.LOG_FULL:
                return int(cause)

    def intervals(self) -> NDArray[Any]:
        """Every interrupt that has returned, INTERVAL in order of entries."""
        joined = np.concatenate([_NOTHING, *self._intervals])
        self._intervals = [joined]
        return joined[np.argsort(joined["entry"], kind="stable")]

    def take_running(self, cycle: int) -> tuple[list[tuple[int, int]], int]:
        """Return and forget which interrupts ran, as far as that is settled, and up to which cycle it is.

        What began in or after an interrupt that has not returned is kept for later.
        """
        frames = self._frames.reshape(k.FRAMES, k.FRAME_WORDS)[: int(self._totals[k.DEPTH])]
        under_way = frames[frames[:, k.FRAME_VECTOR] != 0, k.FRAME_BEGAN]
        settled = int(min(cycle, under_way.min(initial=cycle)))
        intervals = self.intervals()
        over = intervals["entry"] < settled
        self._intervals = [intervals[~over]]
        return running_interrupts(intervals[over]), settled

    def insight(self, cycle: int) -> Insight:
        """The figures up to `cycle`; functions that have not returned count up to there."""
        totals, frames, functions = self._totals.copy(), self._frames.copy(), self._functions.copy()
        self._wake(cycle, totals, frames)
        k.end_frames(cycle, k.ABOVE_ALL, totals, frames, functions, self._vectors.copy(), self._log.copy())
        return Insight(
            start_cycle=self._start,
            cycles=cycle - self._start,
            asleep_cycles=int(totals[k.ASLEEP_CYCLES]),
            interrupt_cycles=int(totals[k.INTERRUPT_CYCLES]),
            deepest_stack_bytes=SRAM_END - 1 - int(totals[k.DEEPEST_SP]),
            interrupts=self._interrupt_figures(),
            functions=self._function_figures(functions),
        )

    def _arrays(self) -> tuple[State, State, State, State, State]:
        return self._totals, self._frames, self._functions, self._vectors, self._log

    @staticmethod
    def _wake(cycle: int, totals: State, frames: State) -> None:
        """Count the sleep under way up to `cycle`."""
        if totals[k.ASLEEP_SINCE] >= 0:
            slept = cycle - totals[k.ASLEEP_SINCE]
            totals[k.ASLEEP_CYCLES] += slept
            frames[k.FRAME_WORDS * (totals[k.DEPTH] - 1) + k.FRAME_AWAY] += slept

    def _look_at(self, program: Program) -> None:
        self._program = program
        words = [symbol.address // 2 for symbol in self._symbols]
        roles = roles_for_insight(program.code, words) if self._figures else np.zeros(len(program.code), dtype=np.int64)
        self._roles = with_breakpoints(roles, self._breakpoints)
        self._landmarks = landmarks(program.code, self._roles)

    def _take_log(self) -> None:
        count = int(self._totals[k.LOGGED])
        self._totals[k.LOGGED] = 0
        if count and self._keep_intervals:
            raw = self._log[: count * k.INTERVAL_WORDS].reshape(count, k.INTERVAL_WORDS)
            piece = np.empty(count, INTERVAL)
            for column, name in enumerate(INTERVAL.names or ()):
                piece[name] = raw[:, column]
            self._intervals.append(piece)

    def _interrupt_figures(self) -> tuple[InterruptFigures, ...]:
        rows = self._vectors.reshape(at.VECTORS, k.VECTOR_WORDS)
        return tuple(
            InterruptFigures(
                vector,
                VECTOR_NAMES[vector],
                int(row[k.COUNT]),
                _spread(row, k.LATENCY_SUM, k.LATENCY_BINS),
                _spread(row, k.DURATION_SUM, k.DURATION_BINS),
            )
            for vector, row in enumerate(rows)
            if row[k.COUNT]
        )

    def _function_figures(self, functions: State) -> tuple[FunctionFigures, ...]:
        rows = functions.reshape(-1, k.FUNCTION_WORDS)
        figures = [
            FunctionFigures(symbol.name, symbol.address, int(row[k.CALLS]), int(row[k.INCLUSIVE]), int(row[k.SELF]))
            for symbol, row in zip(self._symbols, rows, strict=False)
            if row[k.CALLS]
        ]
        return tuple(sorted(figures, key=lambda f: (-f.self_cycles, f.address)))


def _spread(row: State, sums: int, bins: int) -> Spread:
    """Make a spread of a sum, least and most from `sums` on, and a histogram from `bins` on."""
    count = int(row[k.COUNT])
    reached = int(np.searchsorted(np.cumsum(row[bins : bins + k.BINS]), -(-99 * count // 100)))
    upper = reached if reached < k.FINE_BINS else k.FINE_BINS + ((reached - k.FINE_BINS + 1) << k.COARSE) - 1
    least, most = int(row[sums + 1]), int(row[sums + 2])
    return Spread(least, int(row[sums]) / count, most if reached == k.BINS - 1 else min(upper, most), most)
