"""Cut a step train into segments, each as long as a fit allows.

All joints share a segment's borders, so candidates are counted in steps of all joints in the order of time: doubled
while they fit, then halved between the last that fits and the first that does not. Invariant at every border: each
joint's next step can still be made, at the latest in its window. So one step of one joint, or of both, always fits.
"""

import numpy as np
from numpy.typing import NDArray

from planarm.stepping.fit import fit_run
from planarm.stepping.windows import GAP, HIGH, LOW, RUN_END, SETUP, TICK, Windows
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import MAX_SEGMENT_TICKS

Ticks = NDArray[np.int64]

COUNT, FIRST, INTERVAL, ADD = 0, 1, 2, 3
"""Columns of a run."""

NEVER = -(1 << 62)


def cut(windows: Windows, duration_ticks: int) -> tuple[list[int], list[Ticks]]:
    """Return (ends, runs): the tick at which each segment ends, and its runs, shape (joints, 4).

    By the invariant the last end is `duration_ticks`; the caller expands and checks it.

    Args:
        windows: the steps.
        duration_ticks: the motion's end, where the last segment ends.
    """
    joints = len(windows.least_interval)
    following, last = windows.first[:-1].copy(), np.full(joints, NEVER)
    ends, runs = [], []
    begin, length = 0, 1
    while 0 <= begin < duration_ticks:
        best = np.zeros((joints, 4), np.int64)
        end, length = longest(windows, following, last, begin, duration_ticks, length, best)
        for j, (count, first, interval, add) in enumerate(best.tolist()):
            if count > 0:
                n = count - 1
                last[j] = begin + first + ((n * interval + n * (n - 1) // 2 * add) >> 16)
        following += best[:, COUNT]
        ends.append(end)
        runs.append(best)
        begin = end
    return ends, runs


@kernel
def longest(
    windows: Windows,
    following: Ticks,
    last: Ticks,
    begin: int,
    duration_ticks: int,
    guess: int,
    best: Ticks,
) -> tuple[int, int]:
    """Find the longest segment from `begin`: fill `best`, return its end and its number of steps."""
    joints = best.shape[0]
    trial = np.zeros((joints, 4), np.int64)
    left = 0
    for j in range(joints):
        left += windows.first[j + 1] - following[j]
    fits, fails = 0, left + 1
    size = min(guess, left)
    best_end, choice = -1, 0
    while size > fits or (fits == 0 and choice < joints + 2):
        if size > fits:
            count_steps(windows, following, size, trial)
        else:
            count_choice(windows, following, choice, trial)
            choice += 1
        end = try_segment(windows, following, last, begin, duration_ticks, trial)
        if end > begin:
            fits, best_end = max(1, size), end
            copy_runs(trial, best)
            size = min(2 * size, (fits + fails) // 2)
        elif size > fits:
            fails = size
            size = (fits + fails) // 2
    return best_end, max(1, fits)


@kernel
def count_steps(windows: Windows, following: Ticks, size: int, trial: Ticks) -> None:
    """Fill in how many of the next `size` steps, in the order of time, are each joint's; as many must be left."""
    for j in range(trial.shape[0]):
        trial[j, COUNT] = 0
    for _ in range(size):
        soonest, tick = 0, -NEVER
        for j in range(trial.shape[0]):
            n = following[j] + trial[j, COUNT]
            if n < windows.first[j + 1] and windows.steps[n, TICK] < tick:
                soonest, tick = j, windows.steps[n, TICK]
        trial[soonest, COUNT] += 1


@kernel
def count_choice(windows: Windows, following: Ticks, choice: int, trial: Ticks) -> None:
    """Fill in a smallest segment: one step of joint `choice`, then one of every joint, then none; one of these fits."""
    joints = trial.shape[0]
    for j in range(joints):
        more = following[j] < windows.first[j + 1]
        trial[j, COUNT] = 1 if more and choice in (j, joints) else 0


@kernel
def try_segment(windows: Windows, following: Ticks, last: Ticks, begin: int, duration_ticks: int, trial: Ticks) -> int:
    """Fit trial[j, COUNT] steps of each joint j: fill the rest of `trial` and return the segment's end, or -1."""
    for j in range(trial.shape[0]):
        n = following[j]
        if trial[j, COUNT] > 0 and n + trial[j, COUNT] > windows.steps[n, RUN_END]:
            return -1
    end = border(windows, following, last, begin, duration_ticks, trial)
    if end <= begin:
        return -1
    for j in range(trial.shape[0]):
        steps = trial[j, COUNT]
        if steps == 0:
            trial[j, FIRST] = trial[j, INTERVAL] = trial[j, ADD] = 0
            continue
        n = following[j]
        low, high = np.empty(steps, np.int64), np.empty(steps, np.int64)
        for i in range(steps):
            low[i] = max(windows.steps[n + i, LOW], begin) - begin
            high[i] = min(windows.steps[n + i, HIGH], end - 1) - begin
        low[0] = earliest_tick(windows, n, last[j], begin) - begin
        found, first, interval, add = fit_run(low, high, windows.least_interval[j])
        if not found:
            return -1
        trial[j, FIRST], trial[j, INTERVAL], trial[j, ADD] = first, interval, add
    return end


@kernel
def earliest_tick(windows: Windows, n: int, last: int, begin: int) -> int:
    """Return the earliest tick of step n, the first of its joint in a segment from `begin`, after one at `last`."""
    return int(max(windows.steps[n, LOW], last + windows.steps[n, GAP], begin + windows.steps[n, SETUP]))


@kernel
def border(windows: Windows, following: Ticks, last: Ticks, begin: int, duration_ticks: int, trial: Ticks) -> int:
    """Return where a segment with trial[j, COUNT] steps of each joint j ends, or -1 when no border is possible.

    After the earliest tick of its last steps and before the latest of those that follow; best in the middle between the
    windows of both.
    """
    earliest, latest = begin + 1, begin + MAX_SEGMENT_TICKS
    before, after = NEVER, -NEVER
    for j in range(trial.shape[0]):
        n = following[j] + trial[j, COUNT]
        if trial[j, COUNT] > 0:
            run = (trial[j, COUNT] - 1) * windows.least_interval[j]
            reached = earliest_tick(windows, following[j], last[j], begin) + run
            earliest = max(earliest, reached + 1, windows.steps[n - 1, LOW] + 1)
            before = max(before, windows.steps[n - 1, HIGH] + 1)
        if n < windows.first[j + 1]:
            latest = min(latest, windows.steps[n, HIGH] - windows.steps[n, SETUP])
            after = min(after, windows.steps[n, LOW] - windows.steps[n, SETUP])
    if after == -NEVER:
        end = duration_ticks if duration_ticks <= latest else begin + (duration_ticks - begin) // 2
    elif before == NEVER:
        end = after
    else:
        end = before + (after - before) // 2
    end = min(max(end, earliest), latest)
    return end if earliest <= latest else -1


@kernel
def copy_runs(source: Ticks, target: Ticks) -> None:
    """Copy the runs of one segment."""
    for j in range(source.shape[0]):
        for field in range(source.shape[1]):
            target[j, field] = source[j, field]
