"""Where an arm is known to stand, and the check that a motion begins there.

A board knows its position from the moment that it is told one until it restarts; `planarm.link.positions` keeps which
boots do. An emulated arm stands where its plan begins, because it was put there.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planarm.errors import LinkError, UsageError
from planarm.link.exchange import open_on_board, open_session, request
from planarm.link.positions import Positions
from planarm.link.session import Session
from planarm.link.stream_values import position_of
from planarm.link.transport import Transport
from planarm.model.arm import Arm
from planarm.model.kinematics import forward, inverse_2r
from planarm.model.transmission import Transmission
from planarm.plan_file import arm_hash
from planarm.scene import Scene
from planarm.streaming.configure import POSITION_LOST, configure, require_no_drop_by_clear, stands_no_more
from planarm.streaming.pressed import switch_doubts
from planarm_wire.messages import DEBOUNCE_TICKS, QUEUE_FRAME_BYTES, TICKS_HZ, Clear, Enable, Query, State, Status

SWITCHES_READ_S = 3 * DEBOUNCE_TICKS / TICKS_HZ
"""From CONFIG, which may turn their sense, until the board's word of its switches counts."""


@dataclass(frozen=True, slots=True)
class Standing:
    """Where a board says that its arm is.

    Attributes:
        session: the open session.
        usteps: of each motor, by the ledger.
        how: by what it knows that; None: it was told nothing since it started, or has lost it.
        doubts: what its limit switches read that contradicts it, in words; "": nothing, or nobody looked.
    """

    session: Session
    usteps: tuple[int, ...]
    how: str | None
    doubts: str = ""


def look(transport: Transport, port: str, scene: Scene, positions: Positions) -> Standing:
    """Ask a board where its arm is.

    Raises:
        LinkError: it does not answer, or is not the scene's board.
        DeviceFault: it refuses.
    """
    session, status = open_on_board(transport, scene.board)
    how = known_by(session, status, port, scene, positions)
    return Standing(session, status.ledger.position_usteps[: len(scene.joints)], how)


def known_by(session: Session, status: Status, port: str, scene: Scene, positions: Positions) -> str | None:
    """Return by what a board knows where its arm is; None where it was told nothing, or has lost it since.

    It has lost it by an emergency, or where its drivers are released at a pose from which the arm falls: `tell` and
    `home` leave the drivers of such an arm on.
    """
    assert session.welcome is not None, "an open session has a welcome"
    boot = session.welcome.boot_nonce
    if status.fault in POSITION_LOST or stands_no_more(scene, status):
        positions.forget(port, boot)
    return positions.how(port, boot, arm_hash(asdict(scene)))


def look_and_configure(transport: Transport, port: str, scene: Scene, positions: Positions) -> Standing:
    """Ask a board where its arm is, and make sure that it has the scene's CONFIG before it moves; look at its switches.

    Raises:
        LinkError, DeviceFault: as `look` and `configure`.
    """
    standing = look(transport, port, scene, positions)
    known = standing.usteps if standing.how is not None else None
    configure(transport, standing.session, port, scene, positions, known)
    if known is None or not scene.limit_switches:
        return standing
    transport.clock.wait_until(transport.clock.now_s() + SWITCHES_READ_S)
    inputs = request(transport, standing.session, Query()).inputs
    return replace(standing, doubts=switch_doubts(scene, known, inputs))


def tell(
    transport: Transport, port: str, scene: Scene, positions: Positions, usteps: tuple[int, ...], how: str
) -> None:
    """Tell a board at rest where its arm is, and note that it knows.

    What a program that died while it filled the queue has left there is dropped, and a latched fault is cleared. An arm
    that would fall from there is held from now on: its place is known only as long as the drivers are on.

    Raises:
        LinkError, DeviceFault: it does not take it, or the arm would be dropped for it.
    """
    session, status = open_on_board(transport, scene.board)
    left_behind = status.state is State.READY and status.free_bytes < scene.board.queue_bytes - QUEUE_FRAME_BYTES
    if left_behind or status.state is State.FAULT:
        require_no_drop_by_clear(session, port, scene, positions)
        request(transport, session, Clear())
    if stands_no_more(scene, request(transport, session, position_of(usteps, session.joints))):
        configure(transport, session, port, scene, positions, usteps)
        request(transport, session, Enable(1))
        transport.clock.wait_until(transport.clock.now_s() + scene.board_spec.wake_s)
    assert session.welcome is not None, "an open session has a welcome"
    positions.remember(port, session.welcome.boot_nonce, arm_hash(asdict(scene)), how)


def start_usteps(scene: Scene) -> tuple[int, ...]:
    """Return where the motors stand at the task's start: at its angles, or with the tip at its point.

    Raises:
        UsageError: the point is out of reach.
    """
    task = scene.task
    return usteps_at(scene, task.start_cm) if task.start_rad is None else nearest(scene, np.array(task.start_rad))


def nearest(scene: Scene, q_rad: NDArray[np.float64]) -> tuple[int, ...]:
    """Return where the motors stand nearest to joint angles."""
    return tuple(int(n) for n in np.floor(Transmission.of(scene).usteps(q_rad) + 0.5))


def usteps_at(scene: Scene, tip_cm: tuple[float, float]) -> tuple[int, ...]:
    """Return where the motors of two joints stand with the tip at a point, on the scene's elbow side.

    Raises:
        UsageError: it is out of reach, or the arm has many poses there.
    """
    arm = Arm.from_spec(scene.arm)
    if arm.links != 2:
        raise UsageError(f"an arm with {arm.links} links has not one pose at a point; give joint angles (--deg)")
    q_rad = inverse_2r(arm, tip_cm, "down" if scene.arm.elbow == "down" else "up")
    if np.isnan(q_rad).any():
        raise UsageError(f"({tip_cm[0]:g}, {tip_cm[1]:g}) cm is out of the arm's reach; give a point that it reaches")
    return nearest(scene, q_rad)


def pose_of(scene: Scene, usteps: tuple[int, ...]) -> tuple[NDArray[np.float64], tuple[float, float]]:
    """Return joint angles and the tip's place for motors at `usteps`."""
    q_rad = Transmission.of(scene).q_rad(np.array(usteps))
    x_cm, y_cm = forward(Arm.from_spec(scene.arm), q_rad)[-1]
    return q_rad, (float(x_cm), float(y_cm))


def prepare(transport: Transport, port: str, scene: Scene, positions: Positions, start_usteps: tuple[int, ...]) -> None:
    """Get a board ready for motions that begin where somebody brought its arm; an emulated one is told its place.

    Raises:
        LinkError, DeviceFault: as `look_and_configure`.
    """
    if transport.pins is None:
        require_no_doubts(look_and_configure(transport, port, scene, positions))
        return
    session = open_session(transport)
    session.require_board(scene.board)
    request(transport, session, position_of(start_usteps, session.joints))


def require_no_doubts(standing: Standing) -> None:
    """Check that the limit switches read what they should.

    Raises:
        LinkError: they do not; the message says what to do.
    """
    if standing.doubts:
        raise LinkError(standing.doubts)


def require_standing(standing: Standing, scene: Scene, wanted: tuple[int, ...]) -> None:
    """Check that the arm is known to stand where a plan begins, and that its switches do not contradict.

    Raises:
        LinkError: it is not; the message says what to do.
    """
    x_cm, y_cm = pose_of(scene, wanted)[1]
    if standing.how is None:
        raise LinkError(
            "where the arm stands is not known: since it was told, the board restarted, was stopped in an emergency, or"
            " released its drivers, without which this arm would fall."
            f" The plan starts at ({x_cm:.2f}, {y_cm:.2f}) cm: 'planarm home SCENE' with limit switches, or put the arm"
            " there and 'planarm zero SCENE'"
        )
    require_no_doubts(standing)
    if standing.usteps != wanted:
        at_cm = pose_of(scene, standing.usteps)[1]
        raise LinkError(
            f"the arm stands at ({at_cm[0]:.2f}, {at_cm[1]:.2f}) cm, {standing.usteps} usteps; the plan starts at"
            f" ({x_cm:.2f}, {y_cm:.2f}) cm, {wanted}: 'planarm goto SCENE {x_cm:.4f} {y_cm:.4f}' brings it there"
        )


def settle_start(
    transport: Transport, port: str, scene: Scene, wanted: tuple[int, ...], positions: Positions, *, vouched: bool
) -> None:
    """Make sure that the board and its arm are where a plan begins, before anything of it is sent.

    Args:
        transport: the line.
        port: its name.
        scene: of the arm that is connected.
        wanted: where the plan begins.
        positions: which boots know where they are.
        vouched: somebody says that the arm stands there; the board is told.

    Raises:
        LinkError: it is not, or not known to be; the message says what to do.
        DeviceFault: the board refuses.
    """
    if transport.pins is not None:
        prepare(transport, port, scene, positions, wanted)
        return
    if vouched:
        tell(transport, port, scene, positions, wanted, "vouched for")
    require_standing(look_and_configure(transport, port, scene, positions), scene, wanted)
