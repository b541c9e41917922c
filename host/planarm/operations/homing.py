"""Homing: every joint to its limit switch; and the proof of lost steps, which is the same motion, counted.

The device counts on while a joint is moved to its switch. What it counted where the switch closed, less where the
switch is, are the steps that the motor was told and did not make. A rotor falls back into step only by whole turns of
its field, four full steps each; so a difference tells their number without doubt as long as the switch repeats within
two full steps, and what is left over is the switch's own play.

Switches lie beyond the joints' limits, as no lawful motion presses one; so at the end the arm moves to within them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np

from planarm.errors import DeviceFault, LinkError, NoPathError, SceneError
from planarm.link.exchange import open_on_board, request
from planarm.link.position import moved_usteps
from planarm.link.positions import Positions
from planarm.link.session import Session, fault_words
from planarm.link.stream_values import position_of
from planarm.link.transport import Transport
from planarm.model.transmission import Transmission
from planarm.operations.arm_moves import move_straight
from planarm.plan_file import arm_hash
from planarm.scene import JointSpec, LimitSwitchSpec, Scene
from planarm.stepping.windows import start_stop_ticks
from planarm.streaming.configure import configure, falls_anywhere, require_no_drop_by_clear
from planarm.streaming.standing import Standing, known_by, pose_of
from planarm_wire.messages import DEBOUNCE_TICKS, MIN_HOMING_TICKS, Clear, Enable, Fault, Home, Query, State, Stop

Warn = Callable[[str], None]

FIELD_FULL_STEPS = 4
"""A turn of the field: where a rotor that lost its step can fall in again."""
HOMING_SLOWER = 4
SETTLED_TICKS = 3 * DEBOUNCE_TICKS
"""Least interval of the steps onto the switch: it is believed before the next step, also after bouncing."""
INSIDE_RAD = np.radians(1.0)
"""So far within its limits a joint is brought from a switch beyond them."""
BACK_RAD = np.radians(15.0)
HOMING_POLL_S = 0.05
HOMING_LIMIT_S = 120.0
HOMED = "homed"


@dataclass(frozen=True, slots=True)
class Touched:
    """One joint at its switch.

    Attributes:
        joint: from 1.
        counted_usteps: the device's count where the switch closed.
        switch_usteps: where the switch is, by the scene.
        field_usteps: micro-steps of a turn of the motor's field.
    """

    joint: int
    counted_usteps: int
    switch_usteps: int
    field_usteps: int

    @property
    def off_usteps(self) -> int:
        """The count is so much farther than the joint is."""
        return self.counted_usteps - self.switch_usteps

    @property
    def lost_usteps(self) -> int:
        """Steps lost: the nearest whole number of the field's turns, with the sign of the steps that were told."""
        return self.field_usteps * round(self.off_usteps / self.field_usteps)

    @property
    def play_usteps(self) -> int:
        """What is left of the difference: how well the switch repeats."""
        return self.off_usteps - self.lost_usteps


@dataclass(frozen=True, slots=True)
class Homed:
    """Every joint's touch, in the order of the joints.

    Attributes:
        touched: the touches.
        known_by: by what the count was known before; None: it was not.
        inside_usteps: where the motors stand after the move to within the joints' limits; (): there was none.
    """

    touched: tuple[Touched, ...]
    known_by: str | None
    inside_usteps: tuple[int, ...] = ()

    @property
    def usteps(self) -> tuple[int, ...]:
        """Where the motors stood at their switches."""
        return tuple(touch.switch_usteps for touch in self.touched)

    @property
    def kept_usteps(self) -> tuple[int, ...]:
        """Where the motors stood there by the old count less what was lost: free of the switches' play."""
        return tuple(touch.counted_usteps - touch.lost_usteps for touch in self.touched)

    @property
    def lost_usteps(self) -> tuple[int, ...] | None:
        """Steps lost since the arm was homed, each joint's; None: it was not, and hand and eye tell no single steps."""
        return tuple(touch.lost_usteps for touch in self.touched) if self.known_by == HOMED else None


def home(transport: Transport, port: str, scene: Scene, positions: Positions, warn: Warn | None = None) -> Homed:
    """Move every joint to its limit switch, in the scene's order of switches, and take the position from there.

    Where switches lie beyond the joints' limits the arm then moves straight to within them, if that is proved free.
    `warn` is told when it is not, and when the arm would fall once its drivers let go of it. Drivers that hold it are
    released only where the board has other settings than the scene's, and the arm does not fall.

    Raises:
        SceneError: a joint has no switch, or motors move several joints.
        DeviceFault: a switch was not found; the drivers hold.
        LinkError: the line failed, or the board needs other settings and the arm would fall.
    """
    session, known_by = _meet(transport, port, scene, positions)
    _warn_of_release(scene, warn)
    _make_ready(transport, session, port, scene, positions, known_by)
    homed = Homed(_touch_all(transport, session, scene), known_by)
    return _settle(transport, port, scene, positions, session, homed, homed.usteps, warn)


def prove_steps(transport: Transport, port: str, scene: Scene, positions: Positions, warn: Warn | None = None) -> Homed:
    """Touch every switch again and tell the steps lost since homing; the count is corrected by exactly those.

    Raises:
        SceneError, DeviceFault: as `home`.
        LinkError: the line failed, or the board has restarted since the arm was homed, so that nothing can be told.
    """
    session, known_by = _meet(transport, port, scene, positions)
    if known_by != HOMED:
        raise LinkError(
            f"nothing to compare with: the arm was not homed since the board's last start, or was let go, its place is"
            f" {known_by or 'not known'}; 'planarm home SCENE' before the run, then ask again after it"
        )
    _warn_of_release(scene, warn)
    _make_ready(transport, session, port, scene, positions, known_by)
    homed = Homed(_touch_all(transport, session, scene), known_by)
    return _settle(transport, port, scene, positions, session, homed, homed.kept_usteps, warn)


def _warn_of_release(scene: Scene, warn: Warn | None) -> None:
    """Say so when the arm would fall between its limits: a switch that is not found ends in letting it go."""
    falling = falls_anywhere(scene)
    if falling is not None and warn is not None:
        warn(f"{falling}; where homing finds no switch, support the arm and reset the board")


def _meet(transport: Transport, port: str, scene: Scene, positions: Positions) -> tuple[Session, str | None]:
    """Say hello, and nothing that lets go of the arm; return by what the device's count is known, too."""
    switched = {switch.joint for switch in scene.limit_switches}
    missing = [number for number in range(1, len(scene.joints) + 1) if number not in switched]
    if missing or not np.array_equal(np.array(scene.coupling), np.eye(len(scene.joints))):
        raise SceneError(
            scene.source,
            "limit_switches",
            f"joints {missing} have none; write one for each joint, or tell the place: 'planarm zero SCENE'"
            if missing
            else "homing is for motors that each move one joint; tell the place: 'planarm zero SCENE'",
        )
    session, status = open_on_board(transport, scene.board)
    return session, known_by(session, status, port, scene, positions)


def _make_ready(
    transport: Transport, session: Session, port: str, scene: Scene, positions: Positions, known_by: str | None
) -> None:
    """Tell the device of its motors and switches, unless it was told, and switch its drivers on."""
    status = request(transport, session, Query())
    if status.state is not State.IDLE:
        require_no_drop_by_clear(session, port, scene, positions)
        status = request(transport, session, Clear())
    known = status.ledger.position_usteps[: len(scene.joints)] if known_by is not None else None
    configure(transport, session, port, scene, positions, known)
    request(transport, session, Enable(1))


def _touch_all(transport: Transport, session: Session, scene: Scene) -> tuple[Touched, ...]:
    touched = {}
    for switch in scene.limit_switches:
        number, axis = switch.joint - 1, scene.joints[switch.joint - 1]
        holds = request(transport, session, Query()).holds
        request(transport, session, _home_order(scene, switch))
        _wait_for_switch(transport, session, switch, holds)
        assert session.status is not None, "a session that was answered has a status"
        counted = session.status.ledger.position_usteps[number]
        touched[number] = Touched(switch.joint, counted, _place_usteps(scene, switch), _field_usteps(axis))
    return tuple(touched[number] for number in sorted(touched))


def _settle(
    transport: Transport,
    port: str,
    scene: Scene,
    positions: Positions,
    session: Session,
    homed: Homed,
    usteps: tuple[int, ...],
    warn: Warn | None,
) -> Homed:
    """Tell the device where its arm stands, note that it knows, and bring the arm to within its limits."""
    request(transport, session, position_of(usteps, session.joints))
    assert session.welcome is not None, "an open session has a welcome"
    positions.remember(port, session.welcome.boot_nonce, arm_hash(asdict(scene)), HOMED)
    return replace(homed, inside_usteps=_move_inside(transport, scene, Standing(session, usteps, HOMED), warn))


def _move_inside(transport: Transport, scene: Scene, standing: Standing, warn: Warn | None) -> tuple[int, ...]:
    """Move joints from outside their limits to within them; return where the motors stand, () without a move."""
    at_rad = pose_of(scene, standing.usteps)[0]
    low, high = np.array(scene.arm.joint_limits_rad).T
    inside_rad = np.minimum(INSIDE_RAD, 0.5 * (high - low))
    end_rad = np.where((low < at_rad) & (at_rad < high), at_rad, np.clip(at_rad, low + inside_rad, high - inside_rad))
    if np.array_equal(end_rad, at_rad):
        return ()
    try:
        _, done = move_straight(transport, scene, standing, end_rad, lambda _told: None)
    except NoPathError as error:
        if warn is None:
            raise
        warn(
            "the arm was homed, but stands outside arm.joint_limits_deg at its switches, and the straight way inside"
            f" is not free ({error}); jog its joints inside, or change limit_switches.at_deg"
        )
        return ()
    moved = moved_usteps(done.ledger_before, done.ledger_after)
    return tuple(at + by for at, by in zip(standing.usteps, moved, strict=False))


def _place_usteps(scene: Scene, switch: LimitSwitchSpec) -> int:
    """Where a switch is, in its motor's micro-steps."""
    at_rad = np.zeros(len(scene.joints))
    at_rad[switch.joint - 1] = switch.at_rad
    return int(np.floor(Transmission.of(scene).usteps(at_rad)[switch.joint - 1] + 0.5))


def _field_usteps(axis: JointSpec) -> int:
    return FIELD_FULL_STEPS * axis.microsteps


def _home_order(scene: Scene, switch: LimitSwitchSpec) -> Home:
    """Go to the switch at the start-stop speed, where motors may stop dead, and slowly off it and on again.

    No faster than the board hands over single steps.
    """
    number = switch.joint - 1
    axis = scene.joints[number]
    low, high = scene.arm.joint_limits_rad[number]
    fast = max(start_stop_ticks(axis), MIN_HOMING_TICKS)
    return Home(
        joint=number,
        positive=int(switch.above != axis.reversed),
        fast_ticks=fast,
        slow_ticks=max(HOMING_SLOWER * fast, SETTLED_TICKS),
        most_usteps=int((min(high - low, 4.0 * np.pi) + 2.0 * BACK_RAD) * axis.usteps_per_rad),
        back_usteps=int(BACK_RAD * axis.usteps_per_rad),
    )


def _wait_for_switch(transport: Transport, session: Session, switch: LimitSwitchSpec, holds: int) -> None:
    """Wait until the joint rests at its switch; a hold, which may be a disturbed byte, ends homing elsewhere."""
    clock = transport.clock
    limit_s = clock.now_s() + HOMING_LIMIT_S
    while (status := request(transport, session, Query())).state is State.HOMING:
        if clock.now_s() > limit_s:
            request(transport, session, Stop(1))
            raise LinkError(f"joint {switch.joint}: no switch within {HOMING_LIMIT_S:g} s; it was stopped")
        clock.wait_until(clock.now_s() + HOMING_POLL_S)
    if status.fault is not Fault.NONE:
        raise DeviceFault(fault_words(status.fault, status.detail))
    if status.holds != holds:
        raise LinkError(f"joint {switch.joint}: homing was broken off before its switch; start it again")
