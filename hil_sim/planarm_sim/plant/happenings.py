"""What happens to an arm that its drivers do not see: lost steps, touches, hard stops, limit switches."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Contact", "Slip", "StopHit", "SwitchChange"]


@dataclass(frozen=True, slots=True)
class Slip:
    """A rotor lost its step: it stays a whole electrical turn behind its driver, or gets one ahead.

    Attributes:
        cycle: clock cycle.
        motor: number from 0.
        full_steps: 4 when it fell behind in the positive sense, -4 in the negative.
        speed_rad_s: of the rotor then.
    """

    cycle: int
    motor: int
    full_steps: int
    speed_rad_s: float


@dataclass(frozen=True, slots=True)
class Contact:
    """A link touched an obstacle.

    Attributes:
        cycle: clock cycle of the first touch.
        link: number from 0.
        obstacle: number from 0.
        place: where on the link, as a share of its length.
    """

    cycle: int
    link: int
    obstacle: int
    place: float


@dataclass(frozen=True, slots=True)
class StopHit:
    """A joint ran into its hard stop, at an angle."""

    cycle: int
    joint: int
    q_rad: float


@dataclass(frozen=True, slots=True)
class SwitchChange:
    """A limit switch was pressed or let go of."""

    cycle: int
    switch: int
    pressed: bool
