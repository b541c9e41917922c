"""What the flash images differ in: the joints they step, the pins these are wired to, and how fast they may go."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Board:
    """A wiring of the Uno; the image of its name is made for it. Pins are named as printed on the board."""

    name: str
    doc: str
    pin_map: str
    """A name of the wire's pin maps."""
    joints: int
    """Entries of every field that is there for each joint."""
    queue_bytes: int
    """What the firmware holds of queued segments."""
    min_interval_ticks: int
    """Least time between two steps of one joint."""
    min_step_high_ticks: int
    """Least high time of a step pulse."""
    min_step_low_ticks: int
    """Least low time between two of them."""
    step_pins: tuple[str, ...]
    """One a joint; the step is the rising edge."""
    dir_pins: tuple[str, ...]
    """One a joint; high is the positive direction."""
    enable_pin: str
    """Active low."""
    stop_pin: str
    """The stop input, closed to ground while all is well."""
    limit_pins: tuple[str, ...]
    """One a joint."""

    @property
    def driver_pins(self) -> tuple[str, ...]:
        """All that drivers hang on: STEP of each joint, DIR of each, ENABLE."""
        return (*self.step_pins, *self.dir_pins, self.enable_pin)

    @property
    def joint_pins(self) -> tuple[tuple[str, str], ...]:
        """STEP and DIR of each joint."""
        return tuple(zip(self.step_pins, self.dir_pins, strict=True))
