"""What the arm behind an emulated board really did, as plain values; and what is put there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from planarm.scene import Scene
from planarm_wire.boards import Board
from planarm_wire.messages import BOARDS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class ArmSetup:
    """What stands around an emulated board.

    Attributes:
        scene: arm, motors, drivers and obstacles.
        start_usteps: where the motors stand.
        faults: a schedule of what goes wrong; None: nothing.
        fault_seed: seed of the schedule's random draws; None takes the schedule's own.
    """

    scene: Scene
    start_usteps: tuple[int, ...]
    faults: Path | None = None
    fault_seed: int | None = None


@dataclass(frozen=True, slots=True)
class LostSteps:
    """A rotor lost an electrical turn: `full_steps` is 4 or -4; `motor` counts from 1."""

    ticks: int
    motor: int
    full_steps: int


@dataclass(frozen=True, slots=True)
class BrokenRule:
    """A driver's timing rule that the board's pins broke; `motor` counts from 1."""

    ticks: int
    motor: int
    rule: str
    measured_us: float
    limit_us: float


@dataclass(frozen=True, slots=True)
class Touch:
    """A link touched an obstacle; numbers count from 1, `obstacle` 0 is the stop of the joint of that number."""

    ticks: int
    link: int
    obstacle: int


@dataclass(frozen=True, slots=True)
class ArmRecord:
    """What the arm did.

    Attributes:
        ticks: moments of the samples, int64[n].
        q_rad: joint angles at them, shape (n, joints).
        lost_full_steps: how far each motor ended behind what its pulses asked for.
        lost: every loss, in order of time.
        broken_rules: every broken rule, in order of time.
        touches: every touch, in order of time.
        faults: what the schedule of faults did, one line each.
    """

    ticks: NDArray[np.int64]
    q_rad: NDArray[np.float64]
    lost_full_steps: tuple[int, ...]
    lost: tuple[LostSteps, ...]
    broken_rules: tuple[BrokenRule, ...]
    touches: tuple[Touch, ...]
    faults: tuple[str, ...] = ()


class ArmTrace(Protocol):
    """The arm behind an emulated board."""

    def record(self) -> ArmRecord:
        """Return what it did so far."""
        ...

    def settle(self, seconds: float) -> None:
        """Let emulated time pass, so that the arm comes to rest."""
        ...


def emulated_board(setup: ArmSetup | None) -> Board:
    """Return the board that is emulated where nobody names one: that of the scene around it, or the usual one."""
    return BOARDS["uno"] if setup is None else setup.scene.board
