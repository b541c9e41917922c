"""From a certified plan to the line: how it is streamed, and the journal that is kept of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import planarm
from planarm.errors import CertificateError
from planarm.link.exchange import StreamResult, stream_plan
from planarm.link.journal import JournalWriter
from planarm.link.recording import RecordingTransport
from planarm.link.stream import Joining, Stream, StreamOptions, StreamProgress
from planarm.link.transport import Transport
from planarm.model.transmission import motor_axes
from planarm.scene import Scene
from planarm.stepping.certificate import Certificate
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.windows import start_stop_ticks
from planarm_wire.messages import SPEC_HASH

JOURNAL_NAME = "run.journal"
PLAN_NAME = "run.plan"
FULL_STEPS_RELEASED = 2
"""A rotor whose driver lost its supply comes to rest within two full steps of where it was, if nothing moves it."""


def options_for(scene: Scene, plan: SegmentPlan) -> StreamOptions:
    """Return how a plan of a scene is streamed."""
    flat = not scene.mechanics.gravity
    return StreamOptions(
        allowances=plan.allowances,
        start_stop_ticks=tuple(start_stop_ticks(axis) for axis in motor_axes(scene.joints, scene.coupling)),
        released_spread_usteps=tuple(FULL_STEPS_RELEASED * j.microsteps for j in scene.joints) if flat else (),
    )


def record(transport: Transport, out: Path, port: str, scene: Scene) -> RecordingTransport:
    """Return the transport with a new journal in the folder `out`.

    Raises:
        OutputError: it cannot be written.
    """
    path = out / JOURNAL_NAME
    path.unlink(missing_ok=True)
    journal = JournalWriter(path)
    about = {"planarm": planarm.__version__, "spec_hash": SPEC_HASH, "port": port, "baud": scene.link.baud}
    journal.note(transport.clock.now_s(), about)
    return RecordingTransport(transport, journal)


def stream(
    plan: SegmentPlan,
    certificate: Certificate,
    transport: Transport,
    on_progress: Callable[[StreamProgress], None] | None,
    options: StreamOptions | None = None,
    joining: Joining | None = None,
    steer: Callable[[Stream], None] | None = None,
    warn: Callable[[str], None] | None = None,
) -> StreamResult:
    """Stream a certified plan and wait until it is executed; `steer` may hold, resume and stop it meanwhile.

    Raises:
        CertificateError: The certificate is red; nothing is sent.
        LinkError: The line or its protocol failed.
        DeviceFault: The firmware latched a fault.
        StepsDifferError: The device's ledger is not the plan.
    """
    if not certificate.ok:
        raise CertificateError(certificate.explain())
    options = options or StreamOptions(allowances=plan.allowances)
    return stream_plan(transport, plan.segments, on_progress, options, joining=joining, steer=steer, warn=warn)
