"""Reads steps, pulse widths and broken driver rules from a stream of edges, chunk by chunk.

A step is a rising STEP edge; its direction is the DIR level at that moment. Everything that must be known across
chunks is in `ScanState`, so a capture of any length needs the memory of one chunk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from planarm.analysis.capture import UNKNOWN, Chunk
from planarm_wire.kernel_cache import kernel

Ints = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]

STEP_HIGH, STEP_LOW, DIR_SETUP, DIR_HOLD = range(4)
RULES = ("step_high", "step_low", "dir_setup", "dir_hold")
"""What a driver asks of its lines, in the order of the limits."""

INTERRUPT_ROLE = 1000
NEVER = -(1 << 62)
WIDTH_BINS = 1 << 16
WIDTH_BIN_PS = 1000

# Columns of a joint's memory: levels (-1 unknown), moments, then the least width of each rule and the longest pulse.
_STEP_LEVEL, _DIR_LEVEL, _RISE, _FALL, _DIR_EDGE, _LEAST = range(6)
_LONGEST_HIGH = _LEAST + len(RULES)
_MEMORY = _LONGEST_HIGH + 1

VIOLATION = np.dtype([("rule", np.uint8), ("joint", np.uint8), ("time_ps", np.int64), ("measured_ps", np.int64)])
INTERRUPT = np.dtype([("vector", np.uint8), ("begin_ps", np.int64), ("end_ps", np.int64)])


@dataclass(slots=True, eq=False)
class ScanState:
    """What the chunks so far leave for the next.

    Attributes:
        joints: number of joints.
        memory: levels and moments, int64[joints, _MEMORY].
        high_bins: how often each high time occurred, in bins of 1 ns, longer ones in the last, int64[joints, bins].
        interrupt: vector that runs, since when, and the recording's first moment, int64[3].
    """

    joints: int
    memory: Ints = field(init=False)
    high_bins: Ints = field(init=False)
    interrupt: Ints = field(init=False)

    def __post_init__(self) -> None:
        """Start with nothing known."""
        self.memory = np.full((self.joints, _MEMORY), NEVER, np.int64)
        self.memory[:, [_STEP_LEVEL, _DIR_LEVEL]] = -1
        self.memory[:, _LEAST:_LONGEST_HIGH] = -NEVER
        self.high_bins = np.zeros((self.joints, WIDTH_BINS), np.int64)
        self.interrupt = np.array([0, 0, NEVER], np.int64)

    def least_ps(self, joint: int, rule: int) -> int | None:
        """The least width seen for a rule, None without one."""
        least = int(self.memory[joint, _LEAST + rule])
        return None if least == -NEVER else least

    def longest_high_ps(self, joint: int) -> int | None:
        """The longest pulse, None without one."""
        longest = int(self.memory[joint, _LONGEST_HIGH])
        return None if longest == NEVER else longest


@dataclass(frozen=True, slots=True, eq=False)
class Scanned:
    """What one chunk holds.

    Attributes:
        times_ps: for each joint its rising STEP edges, int64[n].
        directions: for each joint +1 or -1 at each of them, int8[n].
        violations: broken rules, VIOLATION[n].
        interrupts: interrupts that ended in the chunk, INTERRUPT[n].
    """

    times_ps: tuple[Ints, ...]
    directions: tuple[npt.NDArray[np.int8], ...]
    violations: npt.NDArray[np.void]
    interrupts: npt.NDArray[np.void]


def scan_chunk(chunk: Chunk, roles: Ints, limits_ps: Ints, state: ScanState) -> Scanned:
    """Read a chunk.

    Args:
        chunk: the edges.
        roles: for each channel 2 x joint (STEP), 2 x joint + 1 (DIR), or INTERRUPT_ROLE, int64[channels].
        limits_ps: for each joint and rule the least allowed width, 0 for none, int64[joints, 4].
        state: carried from chunk to chunk.
    """
    room = len(chunk.times_ps)
    counts = np.zeros(state.joints, np.int64)
    times = np.empty((state.joints, room), np.int64)
    directions = np.empty((state.joints, room), np.int8)
    violations = np.empty(room, VIOLATION)
    interrupts = np.empty(room if (roles == INTERRUPT_ROLE).any() else 0, INTERRUPT)
    _put_dir_first(chunk.times_ps, chunk.channels, chunk.levels, roles)
    broken, served = _scan(
        chunk.times_ps,
        chunk.channels,
        chunk.levels,
        roles,
        limits_ps,
        state.memory,
        state.high_bins,
        state.interrupt,
        counts,
        times,
        directions,
        violations,
        interrupts,
    )
    ends: Sequence[int] = counts.tolist()
    return Scanned(
        tuple(times[j, :end] for j, end in enumerate(ends)),
        tuple(directions[j, :end] for j, end in enumerate(ends)),
        violations[:broken],
        interrupts[:served],
    )


@kernel
def _put_dir_first(times: Ints, channels: Bytes, levels: npt.NDArray[np.int16], roles: Ints) -> None:
    """Within one moment of the recording, move DIR edges before STEP edges: that late, they break the set-up rule."""
    for i in range(1, len(times)):
        k = i
        while (
            k > 0
            and times[k - 1] == times[k]
            and roles[channels[k]] & 1 == 1
            and roles[channels[k]] - 1 == roles[channels[k - 1]]
        ):
            channels[k - 1], channels[k] = channels[k], channels[k - 1]
            levels[k - 1], levels[k] = levels[k], levels[k - 1]
            k -= 1


@kernel
def _least_of(memory: Ints, joint: int, rule: int, width: int, limit: int) -> bool:
    """Remember a width; tell whether it breaks the limit."""
    memory[joint, _LEAST + rule] = min(memory[joint, _LEAST + rule], width)
    return width < limit


@kernel
def _note(out: npt.NDArray[np.void], at: int, rule: int, joint: int, time: int, width: int) -> int:
    out[at].rule = rule
    out[at].joint = joint
    out[at].time_ps = time
    out[at].measured_ps = width
    return at + 1


@kernel
def _scan(
    times: Ints,
    channels: Bytes,
    levels: npt.NDArray[np.int16],
    roles: Ints,
    limits: Ints,
    memory: Ints,
    high_bins: Ints,
    interrupt: Ints,
    counts: Ints,
    out_times: Ints,
    out_directions: npt.NDArray[np.int8],
    violations: npt.NDArray[np.void],
    interrupts: npt.NDArray[np.void],
) -> tuple[int, int]:
    broken = 0
    served = 0
    if interrupt[2] == NEVER and len(times) > 0:
        interrupt[2] = times[0]
    for i in range(len(times)):
        role = roles[channels[i]]
        now = times[i]
        level = np.int64(levels[i])
        if level == UNKNOWN:
            continue
        if role == INTERRUPT_ROLE:
            if interrupt[0] != 0 and level != interrupt[0]:
                interrupts[served].vector = interrupt[0]
                interrupts[served].begin_ps = interrupt[1]
                interrupts[served].end_ps = now
                served += 1
            interrupt[0] = level
            interrupt[1] = now
            continue
        joint = role >> 1
        mine = memory[joint]
        line = _STEP_LEVEL + (role & 1)
        before = mine[line]
        mine[line] = level
        if before == level or (before < 0 and (level == 0 or now == interrupt[2])):
            continue  # no change, or the level at the recording's start
        if line == _DIR_LEVEL:
            mine[_DIR_EDGE] = now
            if mine[_RISE] != NEVER and _least_of(memory, joint, DIR_HOLD, now - mine[_RISE], limits[joint, DIR_HOLD]):
                broken = _note(violations, broken, DIR_HOLD, joint, now, now - mine[_RISE])
        elif level == 1:
            if mine[_FALL] != NEVER and _least_of(memory, joint, STEP_LOW, now - mine[_FALL], limits[joint, STEP_LOW]):
                broken = _note(violations, broken, STEP_LOW, joint, now, now - mine[_FALL])
            since = now - mine[_DIR_EDGE]
            if mine[_DIR_EDGE] > mine[_RISE] and _least_of(memory, joint, DIR_SETUP, since, limits[joint, DIR_SETUP]):
                broken = _note(violations, broken, DIR_SETUP, joint, now, since)
            mine[_RISE] = now
            out_times[joint, counts[joint]] = now
            out_directions[joint, counts[joint]] = 1 if mine[_DIR_LEVEL] == 1 else -1
            counts[joint] += 1
        else:
            mine[_FALL] = now
            if mine[_RISE] != NEVER:
                width = now - mine[_RISE]
                high_bins[joint, min(width // WIDTH_BIN_PS, WIDTH_BINS - 1)] += 1
                mine[_LONGEST_HIGH] = max(mine[_LONGEST_HIGH], width)
                if _least_of(memory, joint, STEP_HIGH, width, limits[joint, STEP_HIGH]):
                    broken = _note(violations, broken, STEP_HIGH, joint, now, width)
    return broken, served
