"""From a certified plan to the line: how it is streamed, and the journal that is kept of it."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, degrees, radians
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import planarm
from planarm.dynamics.release import falls_on_release
from planarm.errors import CertificateError
from planarm.link.exchange import StreamResult, stream_plan
from planarm.link.journal import JournalWriter
from planarm.link.recording import RecordingTransport
from planarm.link.session import SessionLimits
from planarm.link.stream import Joining, Stream, StreamOptions, StreamProgress
from planarm.link.stream_values import no_soft_limits
from planarm.link.transport import Transport
from planarm.model.transmission import Transmission
from planarm.scene import Scene
from planarm.stepping.certificate import Certificate
from planarm.stepping.plan import SegmentPlan
from planarm.streaming.board_settings import config_of, soft_limits_of
from planarm.streaming.configure import falls_anywhere, faults_kept
from planarm_wire.messages import SPEC_HASH
from planarm_wire.steps import signed_steps

JOURNAL_NAME = "run.journal"
PLAN_NAME = "run.plan"
LOOKED_AT_RAD = radians(2.0)
"""Between two poses of a plan that are looked at; gravity's torque changes by 3 % of its most within that."""
FULL_STEPS_RELEASED = 2
"""A rotor whose driver lost its supply comes to rest within two full steps of where it was, if nothing moves it."""


def options_for(scene: Scene, plan: SegmentPlan, *, known: bool = True) -> StreamOptions:
    """Return how a plan of a scene is streamed; an arm whose place is not `known` has no soft limits."""
    flat, falling = not scene.mechanics.gravity, falls_anywhere(scene)
    resting = plan.board.joints - len(scene.joints)
    spread = (*(FULL_STEPS_RELEASED * joint.microsteps for joint in scene.joints), *(0,) * resting)
    return StreamOptions(
        allowances=plan.allowances,
        config=config_of(scene),
        soft_limits=soft_limits_of(scene) if known else no_soft_limits(plan.board),
        start_usteps=plan.start_usteps if known else (),
        released_spread_usteps=spread if flat else (),
        kept_faults=() if falling is None else faults_kept(scene),
        falling="" if falling is None else str(falling),
        wiring=plan.wiring,
    )


def warn_of_release(scene: Scene, plan: SegmentPlan, warn: Callable[[str], None]) -> None:
    """Say so when the arm would fall anywhere along the plan, once its drivers let go of it; tell where most."""
    falling = falls_on_release(scene, poses_along(scene, plan))
    if falling is None:
        return
    idle_s = scene.board_spec.idle_release_s
    soon = "" if idle_s is None else f"; board.idle_release_s releases them {idle_s:g} s after the motion"
    warn(f"{falling}{soon}")


def warn_of_switches(scene: Scene, plan: SegmentPlan, warn: Callable[[str], None]) -> None:
    """Say so when a plan presses a limit switch: the board ends the motion there. One pressed at its start may open."""
    q_rad = poses_along(scene, plan)
    for switch in scene.limit_switches:
        angles = q_rad[:, switch.joint - 1]
        pressed = angles >= switch.at_rad if switch.above else angles <= switch.at_rad
        left = np.logical_or.accumulate(~pressed)
        if (pressed & left).any():
            side, worst = ("above", angles.max()) if switch.above else ("below", angles.min())
            warn(
                f"joint {switch.joint} presses its limit switch on the way, at {degrees(worst):.1f} degrees: it is"
                f" pressed {side} {degrees(switch.at_rad):.1f}, and the board then ends the motion with a fault; change"
                " arm.joint_limits_deg or the switch's place"
            )


def warn_before(scene: Scene, plan: SegmentPlan, warn: Callable[[str], None]) -> None:
    """Say what may go wrong with a plan on this arm, before it begins."""
    warn_of_release(scene, plan, warn)
    warn_of_switches(scene, plan, warn)


def poses_along(scene: Scene, plan: SegmentPlan) -> NDArray[np.float64]:
    """Return joint angles along a plan, its ends among them, shape (n, joints).

    They are those at its segments' borders, and between them so many more that no motor turns its joint by more than
    about LOOKED_AT_RAD from one to the next.
    """
    transmission, begin = Transmission.of(scene), np.array(plan.start_usteps)
    moved = [[signed_steps(move) for move in segment.moves[: len(begin)]] for segment in plan.segments]
    borders = begin + np.cumsum([np.zeros(len(begin), int), *moved], axis=0)
    turned_rad = np.abs(np.diff(borders, axis=0)) / np.array([joint.usteps_per_rad for joint in scene.joints])
    way = np.concatenate([[0.0], np.cumsum(turned_rad.max(axis=1, initial=0.0))])
    at = np.union1d(way[[0, -1]], np.linspace(0.0, way[-1], 1 + ceil(way[-1] / LOOKED_AT_RAD)))
    usteps = np.column_stack([np.interp(at, way, border) for border in borders.T])
    return transmission.q_rad(usteps)


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
