"""Who looks on while a motion streams."""

from __future__ import annotations

from typing import Protocol

from planarm.link.clock import Clock
from planarm.link.stream import Stream, StreamProgress
from planarm.plan import Plan


class Onlooker(Protocol):
    """Who watches a run while it goes on, and may hold, resume and stop it."""

    def begin(self, plan: Plan, clock: Clock, *, emulated: bool) -> None:
        """Take the plan; the motion begins when this comes back. `emulated`: the clock is an emulator's."""
        ...

    def note(self, told: StreamProgress) -> None:
        """Take what the device tells."""
        ...

    def steer(self, stream: Stream) -> None:
        """Called again and again while the motion goes on; may call the stream's hold, resume, override and stop."""
        ...
