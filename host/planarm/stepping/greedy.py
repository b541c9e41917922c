"""Cut a step train into segments, each as long as a fit allows.

All joints share a segment's borders, so candidates are counted in steps of all joints in the order of time: doubled
while they fit, then halved between the last that fits and the first that does not. Invariant at every border: each
joint's next step can still be made, at the latest in its window. So one step of one joint, or of both, always fits.
"""

import numpy as np
from numpy.typing import NDArray

from planarm.stepping.fit import add_unit, fit_run, fit_smaller
from planarm.stepping.windows import FAST, GAP, HIGH, LOW, RUN_END, SETUP, TICK, Windows
from planarm_wire.kernel_cache import kernel
from planarm_wire.messages import MAX_SEGMENT_TICKS

Ticks = NDArray[np.int64]

COUNT, FIRST, INTERVAL, ADD = 0, 1, 2, 3
"""Columns of a run."""

NEVER = -(1 << 62)

NO_BORDER = -2

SHARE_OF_FRAME = 4
"""Bytes of a segment's frame beside it: header 3, two checks of 2, delimiter; as a rule two segments share a frame."""

SHORTER_SIZES = 2
"""How many segments a step or more shorter than the longest are looked at."""

FIRST_TICKS = 64
"""A segment starts this long before the window of the step after it, where there is room."""


@kernel
def cut(
    windows: Windows, made: Ticks, last: Ticks, begin: int, fast_ticks: int, duration_ticks: int
) -> tuple[Ticks, Ticks]:
    """Return (ends, runs): the tick at which each segment ends, and its runs, shape (segments, joints, 4).

    By the invariant the last end is `duration_ticks`; the caller expands and checks it.

    Args:
        windows: the steps.
        made: how many of its steps each joint has made before, shape (joints,).
        last: when each made the last of them, NEVER where none; changed.
        begin: the tick from which on to cut.
        fast_ticks: the longest segment where a motor is fast.
        duration_ticks: the motion's end, where the last segment ends.
    """
    joints = windows.least_interval.shape[0]
    following = windows.first[:-1] + made
    ends, runs = np.zeros(64, np.int64), np.zeros((64, joints, 4), np.int64)
    # No literals go into the other kernels: each would be compiled a second time for them.
    segments, length = 0, int(np.int64(1))
    while 0 <= begin < duration_ticks:
        if segments == ends.shape[0]:
            ends, runs = np.concatenate((ends, ends)), np.concatenate((runs, runs))
        best = runs[segments]
        best[:] = 0
        end, length = longest(windows, following, last, begin, fast_ticks, duration_ticks, length, best)
        end = cheapest(windows, following, last, begin, fast_ticks, duration_ticks, end, best)
        for j in range(joints):
            if best[j, COUNT] > 0:
                n = best[j, COUNT] - 1
                last[j] = begin + best[j, FIRST] + ((n * best[j, INTERVAL] + n * (n - 1) // 2 * best[j, ADD]) >> 16)
            following[j] += best[j, COUNT]
        ends[segments] = begin = end
        segments += 1
    return ends[:segments], runs[:segments]


@kernel
def longest(
    windows: Windows,
    following: Ticks,
    last: Ticks,
    begin: int,
    fast_ticks: int,
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
            end, size = try_size(windows, following, last, begin, fast_ticks, duration_ticks, size, fails, trial)
        else:
            count_choice(windows, following, choice, trial)
            choice += 1
            end = try_segment(windows, following, last, begin, fast_ticks, duration_ticks, trial)
        if end > begin:
            size = max(1, size)
            fits, best_end = size, end
            copy_runs(trial, best)
            size = min(2 * size, (fits + fails) // 2)
        elif size > fits:
            fails = size
            size = (fits + fails) // 2
    return best_end, max(1, fits)


@kernel
def cheapest(
    windows: Windows,
    following: Ticks,
    last: Ticks,
    begin: int,
    fast_ticks: int,
    duration_ticks: int,
    end: int,
    best: Ticks,
) -> int:
    """Give `best`, the longest segment, its shortest form; take a little shorter one if it costs less a tick.

    A segment is charged for the bytes of the next one's first ticks, too: a border shortly before a step saves some.
    Returns the end.
    """
    size = 0
    for j in range(best.shape[0]):
        size += best[j, COUNT]
    cost = charge(windows, following, last, begin, end, best)
    trial = np.zeros_like(best)
    for shorter in range(size - 1, max(size - 1 - SHORTER_SIZES, 0), -1):
        count_steps(windows, following, last, shorter, trial)
        trial_end = try_segment(windows, following, last, begin, fast_ticks, duration_ticks, trial)
        if trial_end > begin and end < duration_ticks:
            trial_cost = charge(windows, following, last, begin, trial_end, trial)
            if trial_cost * (end - begin) < cost * (trial_end - begin):
                cost, end = trial_cost, trial_end
                copy_runs(trial, best)
    return end


@kernel
def charge(windows: Windows, following: Ticks, last: Ticks, begin: int, end: int, runs: Ticks) -> int:
    """Give the runs their shortest form; return the bytes of the segment and what its end costs the next one."""
    total = SHARE_OF_FRAME + varuint_bytes(2 * (end - begin))
    for j in range(runs.shape[0]):
        count, n = runs[j, COUNT], following[j]
        total += varuint_bytes(2 * count)
        if count > 0:
            shorten(windows, n, last[j], begin, end, runs[j], windows.least_interval[j])
        if count > 1:
            interval, add = runs[j, INTERVAL], runs[j, ADD]
            add //= add_unit(count)
            total += varuint_bytes(interval >> 8) + varuint_bytes(2 * add if add >= 0 else -2 * add - 1)
        n += count
        if n < windows.first[j + 1]:
            total += varuint_bytes(max(windows.steps[n, SETUP], windows.steps[n, LOW] - end))
    return total


@kernel
def varuint_bytes(number: int) -> int:
    """Return the bytes that a number takes on the wire."""
    size = 1
    while number >= 128:
        size += 1
        number >>= 7
    return size


@kernel
def try_size(
    windows: Windows,
    following: Ticks,
    last: Ticks,
    begin: int,
    fast_ticks: int,
    duration_ticks: int,
    size: int,
    fails: int,
    trial: Ticks,
) -> tuple[int, int]:
    """Try a segment of the next `size` steps: return (end, size), or (-1, the size asked for).

    That no border is possible says nothing of longer segments: the windows of two joints' steps may overlap. So up to
    as many steps more as there are joints are tried, fewer than `fails`.
    """
    for longer in range(size, min(size + trial.shape[0] + 1, fails)):
        count_steps(windows, following, last, longer, trial)
        end = try_segment(windows, following, last, begin, fast_ticks, duration_ticks, trial)
        if end != NO_BORDER:
            return (end, longer) if end > begin else (-1, size)
    return -1, size


@kernel
def count_steps(windows: Windows, following: Ticks, last: Ticks, size: int, trial: Ticks) -> None:
    """Fill in how many of the next `size` steps, in the order of time, are each joint's; as many must be left.

    A joint whose last step was late makes its next one no sooner than it can: of a slow joint that is long after its
    tick, when the others have made many steps.
    """
    for j in range(trial.shape[0]):
        trial[j, COUNT] = 0
    for _ in range(size):
        soonest, tick = 0, -NEVER
        for j in range(trial.shape[0]):
            n = following[j] + trial[j, COUNT]
            if n >= windows.first[j + 1]:
                continue
            due = windows.steps[n, TICK]
            if trial[j, COUNT] == 0:
                due = max(due, last[j] + windows.steps[n, GAP])
            if due < tick:
                soonest, tick = j, due
        trial[soonest, COUNT] += 1


@kernel
def count_choice(windows: Windows, following: Ticks, choice: int, trial: Ticks) -> None:
    """Fill in a smallest segment: one step of joint `choice`, then one of every joint, then none; one of these fits."""
    joints = trial.shape[0]
    for j in range(joints):
        more = following[j] < windows.first[j + 1]
        trial[j, COUNT] = 1 if more and choice in (j, joints) else 0


@kernel
def try_segment(
    windows: Windows, following: Ticks, last: Ticks, begin: int, fast_ticks: int, duration_ticks: int, trial: Ticks
) -> int:
    """Fit trial[j, COUNT] steps of each joint j: fill the rest of `trial` and return the segment's end.

    NO_BORDER when it cannot end between its last steps and those that follow, -1 when the steps do not fit.
    """
    for j in range(trial.shape[0]):
        n = following[j]
        if trial[j, COUNT] > 0 and n + trial[j, COUNT] > windows.steps[n, RUN_END]:
            return -1
    end = border(windows, following, last, begin, fast_ticks, duration_ticks, trial)
    if end <= begin:
        return NO_BORDER
    for j in range(trial.shape[0]):
        steps = trial[j, COUNT]
        if steps == 0:
            trial[j, FIRST] = trial[j, INTERVAL] = trial[j, ADD] = 0
            continue
        n = following[j]
        low, high = run_windows(windows, n, steps, last[j], begin, end)
        found, first, interval, add = fit_run(low, high, windows.least_interval[j])
        if not found:
            return -1
        trial[j, FIRST], trial[j, INTERVAL], trial[j, ADD] = first, interval, add
    return end


@kernel
def run_windows(windows: Windows, n: int, steps: int, last: int, begin: int, end: int) -> tuple[Ticks, Ticks]:
    """Return the earliest and the latest tick, from `begin`, of the steps n, n + 1, ... of a segment."""
    low, high = np.empty(steps, np.int64), np.empty(steps, np.int64)
    for i in range(steps):
        low[i] = max(windows.steps[n + i, LOW], begin) - begin
        high[i] = min(windows.steps[n + i, HIGH], end - 1) - begin
    low[0] = earliest_tick(windows, n, last, begin) - begin
    return low, high


@kernel
def shorten(windows: Windows, n: int, last: int, begin: int, end: int, run: Ticks, least_interval: int) -> None:
    """Give a run that fits the add that takes the fewest bytes."""
    low, high = run_windows(windows, n, run[COUNT], last, begin, end)
    found, first, interval, add = fit_smaller(low, high, least_interval, run[ADD])
    if found:
        run[FIRST], run[INTERVAL], run[ADD] = first, interval, add


@kernel
def earliest_tick(windows: Windows, n: int, last: int, begin: int) -> int:
    """Return the earliest tick of step n, the first of its joint in a segment from `begin`, after one at `last`."""
    return int(max(windows.steps[n, LOW], last + windows.steps[n, GAP], begin + windows.steps[n, SETUP]))


@kernel
def border(
    windows: Windows, following: Ticks, last: Ticks, begin: int, fast_ticks: int, duration_ticks: int, trial: Ticks
) -> int:
    """Return where a segment with trial[j, COUNT] steps of each joint j ends, or -1 when no border is possible.

    After the earliest tick of its last steps and before the latest of those that follow; best outside the windows of
    both, shortly before the latter: then the next segment's `first_ticks` takes one byte.
    """
    earliest, latest = begin + 1, begin + MAX_SEGMENT_TICKS
    if is_fast(windows, following, trial):
        latest = begin + fast_ticks
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
    elif after - before > 2 * FIRST_TICKS:
        end = after - FIRST_TICKS
    else:
        end = before + (after - before) // 2
    end = min(max(end, earliest), latest)
    return end if earliest <= latest else -1


@kernel
def is_fast(windows: Windows, following: Ticks, trial: Ticks) -> bool:
    """Tell whether any interval that a segment with these steps overlaps is that of a fast motor."""
    for j in range(trial.shape[0]):
        first, after = windows.first[j], windows.first[j + 1]
        begin, end = following[j], min(following[j] + trial[j, COUNT], after - 1)  # the next step's interval as well
        if end < begin:
            continue
        before = windows.steps[begin - 1, FAST] if begin > first else 0
        if windows.steps[end, FAST] > before:
            return True
    return False


@kernel
def copy_runs(source: Ticks, target: Ticks) -> None:
    """Copy the runs of one segment."""
    for j in range(source.shape[0]):
        for field in range(source.shape[1]):
            target[j, field] = source[j, field]
