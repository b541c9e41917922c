"""From a certified plan to the line: how it is streamed, and the journal that is kept of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

import planarm
from planarm.dynamics.release import falls_on_release
from planarm.errors import CertificateError
from planarm.link.exchange import StreamResult, stream_plan
from planarm.link.journal import JournalWriter
from planarm.link.recording import RecordingTransport
from planarm.link.session import SessionLimits
from planarm.link.stream import Joining, Stream, StreamOptions, StreamProgress
from planarm.link.transport import Transport
from planarm.model.transmission import Transmission, motor_axes
from planarm.scene import Scene
from planarm.stepping.certificate import Certificate
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.windows import start_stop_ticks
from planarm_wire.messages import SPEC_HASH
from planarm_wire.steps import signed_steps

JOURNAL_NAME = "run.journal"
PLAN_NAME = "run.plan"
FULL_STEPS_RELEASED = 2
"""A rotor whose driver lost its supply comes to rest within two full steps of where it was, if nothing moves it."""


def options_for(scene: Scene, plan: SegmentPlan) -> StreamOptions:
    """Return how a plan of a scene is streamed."""
    flat, resting = not scene.mechanics.gravity, plan.board.joints - len(scene.joints)
    spread = (*(FULL_STEPS_RELEASED * joint.microsteps for joint in scene.joints), *(0,) * resting)
    return StreamOptions(
        allowances=plan.allowances,
        start_stop_ticks=tuple(start_stop_ticks(axis) for axis in motor_axes(scene.joints, scene.coupling)),
        released_spread_usteps=spread if flat else (),
        wiring=plan.wiring,
    )


def warn_of_release(scene: Scene, plan: SegmentPlan, warn: Callable[[str], None]) -> None:
    """Say so when the arm would fall where the plan begins or ends, once its drivers let go of it."""
    begin = np.array(plan.start_usteps)
    moved = [[signed_steps(move) for move in segment.moves] for segment in plan.segments]
    end = begin + np.array(moved).sum(axis=0)[: len(begin)] if moved else begin
    arm = Transmission.of(scene)
    falling = falls_on_release(scene, (arm.q_rad(begin), arm.q_rad(end)))
    if falling is not None:
        warn(str(falling))


def record(transport: Transport, out: Path, port: str, scene: Scene) -> RecordingTransport:
    """Return the transport with a new journal in the folder `out`.

    Raises:
        OutputError: it cannot be written.
    """
    path = out / JOURNAL_NAME
    path.unlink(missing_ok=True)
    journal = JournalWriter(path)
    about = {
        "planarm": planarm.__version__,
        "spec_hash": SPEC_HASH,
        "port": port,
        "baud": scene.link.baud,
        "board": scene.board.name,
    }
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
    limits: SessionLimits | None = None,
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
    options = options or StreamOptions(allowances=plan.allowances, wiring=plan.wiring)
    return stream_plan(transport, plan.segments, on_progress, options, limits, joining, steer, warn)


def telling(
    notice: Callable[[str, float], None], *watchers: Callable[[StreamProgress], None]
) -> Callable[[StreamProgress], None]:
    """Return what tells a stream's progress as the share of its path time, and all of it to the watchers."""

    def tell(told: StreamProgress) -> None:
        notice("stream", told.path_s / told.total_s)
        for watch in watchers:
            watch(told)

    return tell
