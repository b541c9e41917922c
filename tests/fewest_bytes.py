"""The fewest bytes that any segments can take for a short train: the oracle of compression.

A lower bound: dynamic programming over how many steps of each joint are made at a border. What a run needs is bounded
by linear programs in real numbers over (first, interval, add): whether one exists at all, its smallest interval and the
add nearest to 0. Borders are free within what the windows around them leave, each apart from the others. So no coding
can take fewer bytes.
"""

from itertools import product

import numpy as np
from scipy.optimize import linprog

from planarm.stepping.segments import Coding
from planarm.stepping.train import MIN_REVERSAL_TICKS, StepTrain
from planarm.stepping.windows import least_interval_ticks
from planarm_wire.messages import MAX_INTERVAL_TICKS, MAX_SEGMENT_TICKS, MIN_DIR_SETUP_TICKS

Q16 = 65536.0

SHARE_OF_FRAME = 4
"""Bytes of a segment's frame beside it: header 3, two checks of 2, delimiter; as a rule two segments share a frame."""


def varuint_bytes(number: float) -> int:
    size = 1
    while number >= 128**size:
        size += 1
    return size


def fewest_bytes(train: StepTrain, coding: Coding) -> int:
    """Bytes of all segments as encoded, and of their shares of the frames."""
    return solve(train, coding)[0]


def solve(train: StepTrain, coding: Coding) -> tuple[int, list[tuple[tuple[int, ...], int]]]:
    """The bytes, and the borders: (steps of each joint up to it, tick)."""
    start_stops = coding.start_stop_ticks or (0,) * len(train.steps)
    tables = [_Joint(*of, train.duration_ticks) for of in zip(train.steps, start_stops, strict=True)]
    for table in tables:
        table.fill(coding)
    none, end = tuple(0 for _ in tables), tuple(len(table.low) for table in tables)
    best = {(none, 0): (0, None)}
    for counts in sorted(product(*(range(n + 1) for n in end)), key=sum):
        # By tick: a border may follow another with the same counts, a rest between them.
        for at in sorted(key for key in best if key[0] == counts):
            _extend(tables, coding, train.duration_ticks, best, at)
    at = (end, train.duration_ticks)
    borders = []
    cost = best[at][0]
    while at is not None:
        borders.append(at)
        at = best[at][1]
    return cost, borders[::-1]


def _extend(tables, coding, duration, best, at):
    """Improve what can be reached by one more segment from the border `at`."""
    counts, begin = at
    if begin == duration:
        return
    for to in product(*(range(n, n + t.longest(n) + 1) for t, n in zip(tables, counts, strict=True))):
        runs = list(zip(tables, counts, to, strict=True))
        fast = any(t.is_fast(n, m) for t, n, m in runs)
        longest = coding.fast_ticks if fast else MAX_SEGMENT_TICKS
        for tick in _borders(tables, to, begin, longest, duration):
            cost = best[at][0] + SHARE_OF_FRAME + varuint_bytes(2 * (tick - begin))
            cost += sum(t.run_bytes(n, m, begin) for t, n, m in runs)
            if cost < best.get((to, tick), (1 << 30,))[0]:
                best[to, tick] = (cost, at)


def _borders(tables, to, begin, longest, duration):
    """Ticks at which a segment from `begin` may end: the earliest, the latest, and what makes a varuint one byte."""
    earliest = max((t.low[m - 1] + 1 for t, m in zip(tables, to, strict=True) if m), default=0.0)
    latest = min((t.high[m] - t.setup(m) for t, m in zip(tables, to, strict=True) if m < len(t.low)), default=duration)
    earliest, latest = max(earliest, begin + 1.0), min(latest, begin + longest)
    if all(m == len(t.low) for t, m in zip(tables, to, strict=True)):
        return [duration] if earliest <= duration <= latest else [int(latest)] if earliest <= latest else []
    firsts = [t.low[m] - 63 for t, m in zip(tables, to, strict=True) if m < len(t.low)]
    return sorted({int(tick) for tick in (earliest, latest, *firsts) if earliest <= tick <= latest})


class _Joint:
    """The windows of one joint's steps, and the fewest bytes of each run of them."""

    def __init__(self, steps, start_stop, duration):
        self.ticks, self.directions = steps.ticks.astype(float), steps.directions
        self.fast = np.diff(self.ticks) < start_stop
        self.duration = duration
        self.least = least_interval_ticks(steps)  # compression makes no interval shorter

    def fill(self, coding):
        gaps = np.diff(self.ticks)
        shorter = (
            np.minimum(np.r_[gaps[:1], gaps], np.r_[gaps, gaps[-1:]]) if len(gaps) else np.full(len(self.ticks), 0)
        )
        tolerance = np.maximum(np.minimum(coding.ticks, coding.most_share * shorter), coding.share * shorter)
        tolerance = tolerance if len(gaps) else np.full(len(self.ticks), coding.ticks)
        self.low, self.high = self.ticks - np.floor(tolerance), self.ticks + np.floor(tolerance)
        self.high = np.minimum(self.high, self.duration - 1)
        for n in range(len(self.ticks)):  # as early as the steps before allow
            before = (
                self.low[n - 1] + (self.least if self.setup(n) == 0 else MIN_REVERSAL_TICKS) if n else self.setup(n)
            )
            self.low[n] = max(self.low[n], before)
        self.sizes = {}
        for n in range(len(self.ticks)):
            for m in range(n + 1, len(self.ticks) + 1):
                size = self._coefficient_bytes(n, m)
                if size is None:
                    break
                self.sizes[n, m] = size

    def longest(self, n):
        return max((m - n for a, m in self.sizes if a == n), default=0)

    def is_fast(self, n, m):
        return bool(self.fast[max(0, n - 1) : m].any())

    def setup(self, n):
        return MIN_DIR_SETUP_TICKS if n == 0 or self.directions[n] != self.directions[n - 1] else 0

    def run_bytes(self, n, m, begin):
        if m == n:
            return 1
        first = max(self.low[n] - begin, self.setup(n), 0.0)
        return varuint_bytes(2 * (m - n)) + varuint_bytes(first) + self.sizes[n, m]

    def _coefficient_bytes(self, n, m):
        """Bytes of interval and add for steps n .. m - 1, None when no run makes them."""
        if (np.diff(self.directions[n:m]) != 0).any():
            return None
        if m - n == 1:
            return 0
        count = m - n
        k = np.arange(count, dtype=float)
        rows = np.column_stack([np.ones(count), k, 0.5 * k * (k - 1)])
        last = np.array([0.0, 1.0, count - 2.0])
        a = np.vstack([rows, -rows, -last, last, [0, -1, 0], [0, 1, 0]])
        limits = [-self.least, MAX_INTERVAL_TICKS]
        b = np.r_[self.high[n:m] + 1 - self.ticks[n], self.ticks[n] - self.low[n:m], limits, limits]
        any_add = (0, 0) if count == 2 else (None, None)
        found = [
            linprog(goal, a, b, bounds=[(None, None), (None, None), any_add])
            for goal in ([0, 1, 0], [0, 0, 1], [0, 0, -1])
        ]
        if found[0].status != 0:
            return None
        interval, low, high = found[0].fun * Q16, found[1].fun * Q16, -found[2].fun * Q16
        nearest = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
        return varuint_bytes(np.ceil(interval - 1e-3)) + varuint_bytes(2 * max(0.0, nearest - 1.0))
