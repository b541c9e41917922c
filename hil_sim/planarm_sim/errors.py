"""Everything that the emulator raises.

::

    SimError
    ├── ImageError       a program file that cannot be loaded
    ├── PinError         a pin that the board does not have, or a level that no pin takes
    ├── UsageError       a call that asks for something impossible (time backwards, no image, ...)
    ├── RunError         the program cannot go on; carries the cycle
    │   ├── StoppedError bad opcode, BREAK, asleep for ever; carries the cause
    │   └── LimitError   what `run_until` waited for did not come
    ├── FaultError       a schedule of faults that is none, or names what the bench does not have
    ├── TraceError       a waveform file that cannot be written or read
    ├── DefectError      the chip's state contradicts itself: a defect of the emulator, or files of two versions mixed
    └── BridgeError      no pseudo-terminal, or its link cannot be made
"""

from __future__ import annotations

__all__ = [
    "BridgeError",
    "DefectError",
    "FaultError",
    "ImageError",
    "LimitError",
    "PinError",
    "RunError",
    "SimError",
    "StoppedError",
    "TraceError",
    "UsageError",
]


class SimError(Exception):
    """Root of the emulator's errors; the message names cause, place, value and limit."""


class ImageError(SimError):
    """A program file that is damaged, empty, for another chip, or too large."""


class DefectError(SimError):
    """The emulated chip's state contradicts itself, so that its clock would never go on."""


class PinError(SimError):
    """A pin name that an Arduino Uno does not have, or a level other than 0 and 1."""


class UsageError(SimError):
    """A call whose arguments contradict each other or the emulated time."""


class RunError(SimError):
    """The emulated program cannot go on as asked.

    Attributes:
        cycle: clock cycles since power-up at which the run ended.
    """

    def __init__(self, message: str, cycle: int) -> None:
        super().__init__(message)
        self.cycle = cycle


class StoppedError(RunError):
    """The program came to an end that no interrupt will ever leave.

    Attributes:
        cause: name of the stop, as in `StopCause`.
    """

    def __init__(self, message: str, cycle: int, cause: str) -> None:
        super().__init__(message, cycle)
        self.cause = cause


class LimitError(RunError):
    """What `Uno.run_until` waited for did not come within its limit."""


class FaultError(SimError):
    """A schedule of faults that cannot be read, or that names what the bench does not have."""


class TraceError(SimError):
    """A waveform file that cannot be written or read."""


class BridgeError(SimError):
    """The pseudo-terminal, or the link to it, cannot be made."""
