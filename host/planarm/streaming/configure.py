"""Giving a board the scene's CONFIG, which it takes only while its drivers are released, without dropping an arm.

A board keeps what it was told until it restarts, and does not tell it. So whoever tells it notes the boot, as with
positions; a board whose drivers are on is left alone where the note says that it has the scene's CONFIG already.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planarm.dynamics.release import Falling, falls_on_release
from planarm.errors import LinkError
from planarm.link.exchange import request
from planarm.link.positions import Positions
from planarm.link.session import Session
from planarm.link.stream_values import clear_drops_words
from planarm.link.transport import Transport
from planarm.model.transmission import Transmission
from planarm.scene import Scene
from planarm.streaming.board_settings import config_of
from planarm_wire.codec import encode
from planarm_wire.messages import Clear, Enable, Fault, State, Status

POSITION_LOST = (Fault.EMERGENCY_STOP, Fault.STOP_INPUT, Fault.HOMING_FAILED)
"""Faults after which the count is not the arm's place; CLEAR then releases the drivers."""
POSES_A_JOINT = 7
"""Where an arm may be, when nobody knows where it is: so many angles of each joint, between its limits."""


def configure(
    transport: Transport,
    session: Session,
    port: str,
    scene: Scene,
    positions: Positions,
    usteps: Sequence[int] | None,
) -> None:
    """Make sure that a board at rest has the scene's CONFIG; one in motion keeps what it has.

    Drivers that are on are released for that, unless it is noted that the board has been told the same. Latched faults
    are cleared where that is needed; one whose clearing would drop the arm is refused whatever is noted.

    Args:
        transport: the line.
        session: an open session whose device has told its status.
        port: the line's name.
        scene: what the board is told.
        positions: the notes of its boots.
        usteps: where the motors stand; None: not known.

    Raises:
        LinkError: the drivers hold the arm, and it would fall; or the line failed.
        DeviceFault: it refuses.
    """
    status, welcome, told = session.status, session.welcome, config_of(scene)
    assert status is not None and welcome is not None, "the device has told"
    if status.state not in (State.IDLE, State.READY, State.FAULT):
        return
    noted = encode(told)[1].hex()
    require_no_drop_by_clear(session, port, scene, positions)
    if status.state is not State.IDLE and positions.config(port, welcome.boot_nonce) == noted:
        return
    if status.state is State.FAULT:
        status = request(transport, session, Clear())
    if status.state is State.READY:
        falling = falls_anywhere(scene) if usteps is None else falls_on_release(scene, [pose_at(scene, usteps)])
        if falling is not None:
            raise LinkError(_falling_words(falling, positions.config(port, welcome.boot_nonce) is not None))
        request(transport, session, Enable(0))
    request(transport, session, told)
    positions.note_config(port, welcome.boot_nonce, noted)


def faults_kept(scene: Scene) -> tuple[Fault, ...]:
    """Return the faults in which drivers hold the arm until CLEAR releases them; of a board with the scene's CONFIG."""
    released = (Fault.EMERGENCY_STOP, Fault.STOP_INPUT) if scene.board_spec.emergency_releases else ()
    return tuple(fault for fault in POSITION_LOST if fault not in released)


def require_no_drop_by_clear(session: Session, port: str, scene: Scene, positions: Positions) -> None:
    """Check, before CLEAR is sent, that it drops no arm: it releases the drivers after a fault that lost the place.

    Raises:
        LinkError: the arm would fall; the message says what to do.
    """
    status, welcome = session.status, session.welcome
    assert status is not None and welcome is not None, "the device has told"
    if status.state is not State.FAULT or status.fault not in POSITION_LOST:
        return
    same = positions.config(port, welcome.boot_nonce) == encode(config_of(scene))[1].hex()
    if same and status.fault not in faults_kept(scene):
        return
    falling = falls_anywhere(scene)
    if falling is not None:
        raise LinkError(clear_drops_words(status.fault, str(falling)))


def stands_no_more(scene: Scene, status: Status) -> bool:
    """Return whether an arm has left the place that is counted: its drivers are released, and there it falls."""
    usteps = status.ledger.position_usteps[: len(scene.joints)]
    return status.state is State.IDLE and falls_on_release(scene, [pose_at(scene, usteps)]) is not None


def pose_at(scene: Scene, usteps: Sequence[int]) -> NDArray[np.float64]:
    """Return the joint angles for motors at `usteps`."""
    return Transmission.of(scene).q_rad(np.array(usteps))


def falls_anywhere(scene: Scene) -> Falling | None:
    """Return the joint that falls worst on release all over the joints' limits, for an arm whose place is not known."""
    angles = [np.linspace(low, high, POSES_A_JOINT) for low, high in scene.arm.joint_limits_rad]
    return falls_on_release(scene, map(np.array, itertools.product(*angles)))


def _falling_words(falling: Falling, told_before: bool) -> str:
    why = "has other settings than the scene" if told_before else "may have other settings than the scene"
    return (
        f"the board {why}, and takes the scene's only while its drivers are released; {falling}. Support the arm, press"
        " the board's reset button (its drivers let go), and try again: it is then told the scene's settings, and"
        " has to be told where the arm stands"
    )
