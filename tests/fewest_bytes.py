"""The fewest bytes that any segments can take for a short train: the oracle of compression.

A lower bound: dynamic programming over the borders, each told by how many steps of each joint are made and by its tick.
What a run needs is bounded in real numbers: whether any (first, interval, add) makes it and how near to 0 its add can
be, by one linear program; its interval, by the windows of its first two steps. So no coding can take fewer bytes.

A later border with the same steps made is never worse for what follows: the next segment's first ticks and duration are
smaller, and its end can be farther. So of each segment only the latest ends of each length in bytes are looked at, and
of the borders with the same steps made only those that cost less than every later one are kept.
"""

from itertools import product

import numpy as np
from scipy.optimize import linprog

from planarm.stepping.segments import Coding
from planarm.stepping.train import StepTrain, least_reversal_ticks
from planarm.stepping.windows import least_interval_ticks
from planarm_wire.messages import BOARDS, MAX_COARSE_STEPS, MAX_SEGMENT_TICKS, MIN_DIR_SETUP_TICKS
from planarm_wire.steps import LONGEST_INTERVAL_TICKS

SHARE_OF_FRAME = 4
"""Bytes of a segment's frame beside it: header 3, two checks of 2, delimiter; as a rule two segments share a frame."""

LONGEST_IN_BYTES = (63, 8191, 1_048_575)
"""The longest durations whose double takes one, two and three bytes."""


def varuint_bytes(number: float) -> int:
    size = 1
    while number >= 128**size:
        size += 1
    return size


class FewestBytes:
    """The oracle of one train; what runs need is the same for every limit of the segments' length."""

    def __init__(self, train: StepTrain, coding: Coding) -> None:
        start_stops = coding.start_stop_ticks or (0,) * len(train.steps)
        self._duration = train.duration_ticks
        self._joints = [_Joint(*of, train.duration_ticks, coding) for of in zip(train.steps, start_stops, strict=True)]
        end = tuple(len(joint.low) for joint in self._joints)
        borders = {counts: self._between(counts) for counts in product(*(range(n + 1) for n in end))}
        self._borders = {counts: ticks for counts, ticks in borders.items() if ticks[0] <= ticks[1]}

    def bytes_with(self, fast_ticks: int) -> int:
        """Bytes of all segments as encoded, and of their shares of the frames."""
        none = (0,) * len(self._joints)
        costs = {counts: {} for counts in self._borders} | {none: {0: 0}}
        for counts in sorted(costs, key=sum):
            waiting = dict(costs[counts])
            while waiting:  # by tick: a rest may follow, another border with the same steps made
                begin = min(waiting)
                cost = waiting.pop(begin)
                if begin == self._duration or _is_beaten(costs[counts], begin, cost):
                    continue
                for to, tick, more in self._segments(counts, begin, fast_ticks):
                    if not _is_beaten(costs[to], tick, cost + more):
                        costs[to][tick] = cost + more
                        if to == counts:
                            waiting[tick] = cost + more
        return costs[tuple(len(joint.low) for joint in self._joints)][self._duration]

    def _between(self, counts):
        """The earliest and the latest tick of a border after so many steps of each joint."""
        each = list(zip(self._joints, counts, strict=True))
        earliest = max((joint.low[m - 1] + 1 for joint, m in each if m), default=0)
        latest = min((joint.high[m] - joint.setup(m) for joint, m in each if m < len(joint.low)), default=None)
        return int(earliest), self._duration if latest is None else int(latest)

    def _segments(self, counts, begin, fast_ticks):
        """What one segment from `begin` can reach: (steps made at its end, tick, bytes)."""
        for to, (earliest, by_windows) in self._borders.items():
            runs = [(joint, n, m) for joint, n, m in zip(self._joints, counts, to, strict=True)]
            if any(m < n or (m > n and (n, m) not in joint.sizes) for joint, n, m in runs):
                continue
            fast = any(joint.is_fast(n, m) for joint, n, m in runs)
            latest = min(by_windows, begin + (fast_ticks if fast else MAX_SEGMENT_TICKS))
            size = SHARE_OF_FRAME + sum(joint.run_bytes(n, m, begin) for joint, n, m in runs)
            for tick in {latest, *(min(latest, begin + longest) for longest in LONGEST_IN_BYTES)}:
                if tick >= max(earliest, begin + 1):
                    yield to, tick, size + varuint_bytes(2 * (tick - begin))


def _is_beaten(known: dict[int, int], tick: int, cost: int) -> bool:
    """Whether another border is as late for less, or later for no more."""
    return any(t >= tick and c <= cost and (t, c) != (tick, cost) for t, c in known.items())


class _Joint:
    """The windows of one joint's steps, and the fewest bytes of each run of them."""

    def __init__(self, steps, start_stop, duration, coding):
        self.ticks, self.directions = steps.ticks.astype(float), steps.directions
        self.fast = np.diff(self.ticks) < start_stop
        self.least = least_interval_ticks(steps, BOARDS["uno"])  # compression makes no interval shorter
        gaps = np.diff(self.ticks)
        if len(gaps):
            shorter = np.minimum(np.r_[gaps[:1], gaps], np.r_[gaps, gaps[-1:]])
            tolerance = np.maximum(np.minimum(coding.ticks, coding.most_share * shorter), coding.share * shorter)
        else:
            tolerance = np.full(len(self.ticks), coding.ticks)
        self.low, self.high = self.ticks - np.floor(tolerance), self.ticks + np.floor(tolerance)
        self.high = np.minimum(self.high, duration - 1)
        for n in range(len(self.ticks)):  # as early as the steps before allow
            gap = self.least if self.setup(n) == 0 else least_reversal_ticks(BOARDS["uno"])
            self.low[n] = max(self.low[n], self.low[n - 1] + gap if n else self.setup(n))
        self.sizes = {}
        for n in range(len(self.ticks)):
            for m in range(n + 1, len(self.ticks) + 1):
                size = self._coefficient_bytes(n, m)
                if size is None:
                    break
                self.sizes[n, m] = size

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
        interval = max(self.least, self.low[n + 1] - self.high[n] - 1.0)
        if interval > LONGEST_INTERVAL_TICKS:
            return None
        add_q16 = 0.0 if m - n == 2 else self._least_add(n, m)
        if add_q16 is None:
            return None
        unit = 256.0 if m - n <= MAX_COARSE_STEPS else 1.0
        return varuint_bytes(256.0 * interval) + varuint_bytes(2.0 * max(0.0, (add_q16 - 1.0) / unit))

    def _least_add(self, n, m):
        """The size of the smallest add that makes the steps, in 2^-16 ticks; None when none does."""
        count = m - n
        k = np.arange(count, dtype=float)
        still = np.zeros(count)
        rows = np.column_stack([np.ones(count), k, 0.5 * k * (k - 1), still])
        last = np.array([0.0, 1.0, count - 2.0, 0.0])
        size = np.array([[0.0, 0.0, 1.0, -1.0], [0.0, 0.0, -1.0, -1.0]])
        a = np.vstack([rows, -rows, -last, last, [0, -1, 0, 0], [0, 1, 0, 0], size])
        limits = [-self.least, LONGEST_INTERVAL_TICKS]
        b = np.r_[self.high[n:m] + 1 - self.ticks[n], self.ticks[n] - self.low[n:m], limits, limits, 0.0, 0.0]
        found = linprog([0, 0, 0, 1], a, b, bounds=[(None, None)] * 4)
        return 65536.0 * found.fun if found.status == 0 else None
