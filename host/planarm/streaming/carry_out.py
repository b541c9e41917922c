"""A plan carried out on a board: streamed, and kept to its appointments among moving obstacles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from planarm.link.exchange import StreamResult
from planarm.link.stream import Stream, StreamProgress
from planarm.link.transport import Transport
from planarm.notice import Notice
from planarm.plan import Plan
from planarm.scene import Scene
from planarm.streaming.moving_run import KeptTime, Timekeeper, stream_on_time
from planarm.streaming.plan_stream import options_for, stream, telling


def carry_out(
    plan: Plan,
    transport: Transport,
    notice: Notice,
    watch: Sequence[Callable[[StreamProgress], None]],
    steer: Callable[[Stream], None] | None,
    warn: Callable[[str], None] | None,
    plan_again: Callable[[Scene], Plan],
) -> tuple[Plan, StreamResult, KeptTime | None]:
    """Stream a plan; one among moving obstacles by its clock, planned again where it falls behind.

    Returns:
        (the plan that arrived, its stream, how time was kept).
    """
    if plan.moving is None:
        options = options_for(plan.scene, plan.segments)
        tell = telling(notice, *watch)
        return plan, stream(plan.segments, plan.certificate, transport, tell, options, steer=steer, warn=warn), None

    def on_time(now: Plan, keeper: Timekeeper) -> StreamResult:
        def steered(running: Stream) -> None:
            keeper.steer(running)
            if steer is not None:
                steer(running)

        options = replace(options_for(now.scene, now.segments), start_at_s=keeper.start_at_s)
        tell = telling(notice, keeper.watch, *watch)
        return stream(now.segments, now.certificate, transport, tell, options, steer=steered, limits=keeper.limits)

    kept = stream_on_time(plan, transport.clock, on_time, plan_again)
    return kept.plan, kept.streamed, kept
