"""What is known of a run while it goes on, for any thread; and what people ask of it meanwhile."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from itertools import accumulate
from queue import SimpleQueue
from typing import Any, Final

import numpy as np

from planarm.link.clock import Clock
from planarm.link.stream import Stream, StreamProgress
from planarm.model.transmission import Transmission
from planarm.plan import Plan
from planarm_wire.messages import TICKS_HZ
from planarm_wire.steps import duration_ticks

ORDERS: Final = ("start", "hold", "resume", "stop", "override")
LONGEST_NAP_S = 0.05
"""The loop that streams goes on this often at least, however far the emulator is ahead of the clock on the wall."""


class LiveRun:
    """One run, between the thread that streams it and those that show it.

    The streaming thread calls `begin`, `note` and `steer`, and `end` when all is over; any other reads `state` and
    gives orders. `begin` comes back when somebody has ordered "start".

    Args:
        announce: told when the plan is there, before the start is waited for.
        now_s: the clock on the wall, which an emulated board is held to.
        nap: waits so many seconds.
    """

    def __init__(
        self,
        announce: Callable[[Plan], None] = lambda _plan: None,
        now_s: Callable[[], float] = time.monotonic,
        nap: Callable[[float], None] = time.sleep,
    ) -> None:
        self._announce = announce
        self._now_s = now_s
        self._nap = nap
        self._orders: SimpleQueue[tuple[str, int]] = SimpleQueue()
        self._started = threading.Event()
        self._paced: Clock | None = None
        self._ahead_s: float | None = None
        self._state: dict[str, Any] = {"state": "waiting for the start", "over": False}

    # -- the streaming thread -----------------------------------------------------------------------------------------

    def begin(self, plan: Plan, clock: Clock, *, emulated: bool) -> None:
        """Take the plan, and wait for the order to start.

        Args:
            plan: what will be streamed.
            clock: the transport's.
            emulated: whether its time is an emulator's, which is then held to the clock on the wall.
        """
        self._transmission = Transmission.of(plan.scene)
        self._start_usteps = np.array(plan.segments.start_usteps)
        self._ends = (0, *accumulate(duration_ticks(segment) for segment in plan.segments.segments))
        self._paced = clock if emulated else None
        self._tell(q_deg=self._q_deg((0,) * len(self._start_usteps)), total_s=self._ends[-1] / TICKS_HZ, path_s=0.0)
        self._announce(plan)
        self._started.wait()
        self._tell(state="starting")

    def note(self, told: StreamProgress) -> None:
        """Keep what the device told."""
        last = len(self._ends) - 1
        sent = min(told.executed_segments + told.queued_segments, last)
        self._tell(
            state=told.state.name.lower(),
            path_s=round(told.path_s, 4),
            total_s=round(told.total_s, 4),
            remaining_s=round(told.total_s - told.path_s, 4),
            executed_segments=told.executed_segments,
            total_segments=told.total_segments,
            queued_segments=told.queued_segments,
            buffered_ms=round(1e3 * (self._ends[sent] - self._ends[min(told.executed_segments, last)]) / TICKS_HZ, 2),
            retransmissions=told.retransmissions,
            moved_usteps=list(told.moved_usteps),
            q_deg=self._q_deg(told.moved_usteps),
        )

    def steer(self, stream: Stream) -> None:
        """Pass on what was ordered, and let the clock on the wall catch up with an emulator."""
        while not self._orders.empty():  # this thread alone takes from it
            order, percent = self._orders.get()
            if order == "override":
                stream.override(percent)
            else:
                {"hold": stream.hold, "resume": stream.resume, "stop": stream.stop}[order]()
        self._keep_pace()

    def end(self, verdict: str, why: str = "") -> None:
        """Tell that the run is over: "done", or what went wrong."""
        self._tell(state=verdict, why=why, over=True)

    # -- any thread ---------------------------------------------------------------------------------------------------

    @property
    def state(self) -> dict[str, Any]:
        """What is known: state, path_s, remaining_s, buffered_ms, q_deg ..., over."""
        return self._state

    def order(self, word: str, percent: int = 100) -> None:
        """Ask for something: one of ORDERS; `percent` goes with "override", 1 to 100.

        Raises:
            ValueError: there is no such order, or the percentage is out of its range.
        """
        if word not in ORDERS or not 1 <= percent <= 100:
            raise ValueError(f"{word!r} with {percent} % is no order; there are {', '.join(ORDERS)}, 1 to 100 %")
        if word == "start":
            self._started.set()
        elif not self._state["over"]:
            self._orders.put((word, percent))

    # -- inside -------------------------------------------------------------------------------------------------------

    def _tell(self, **news: Any) -> None:  # noqa: ANN401 - JSON's values
        self._state = {**self._state, **news}  # one reference is replaced: readers see the old or the new, never a mix

    def _q_deg(self, moved_usteps: tuple[int, ...]) -> list[float]:
        q_rad = self._transmission.q_rad(self._start_usteps + np.array(moved_usteps[: len(self._start_usteps)]))
        return [round(float(angle), 4) for angle in np.degrees(q_rad)]

    def _keep_pace(self) -> None:
        if self._paced is None:
            return
        ahead_s = self._paced.now_s() - self._now_s()
        if self._ahead_s is None:
            self._ahead_s = ahead_s
        nap_s = ahead_s - self._ahead_s
        if nap_s > 0.0:
            self._nap(min(nap_s, LONGEST_NAP_S))
