"""The exceptions that planarm raises on purpose, and the exit code of the command line for each.

::

    PlanarmError
    ├── UsageError        2  the words of the command line are wrong
    ├── SceneError        2  the scene file, or a value given in its place, is wrong
    ├── EmulatorError     2  the emulator cannot start: image, link or file
    ├── OutputError       2  a file or folder cannot be written
    ├── PlanFileError     2  the file is no plan, or cannot be read
    ├── CaptureError      2  the recording of the pins cannot be read, or does not show what is asked
    ├── NoPathError       3  start and goal are fine, but no collision-free path joins them
    ├── TimingError       4  the path cannot be timed within the joints' limits
    ├── CertificateError  4  a check of the finished plan failed
    ├── LinkError         5  the serial line or its protocol failed; link.position.StreamError tells where the arm is
    ├── HostKilledError   5  a schedule of faults killed the host
    ├── DeviceFault       6  the firmware latched a fault or refused a command; so does link.position.StreamFault
    └── StepsDifferError  7  the executed steps are not the planned ones

Every message names the cause, the place, the value, the limit and the setting to change.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar


class PlanarmError(Exception):
    """Base of all errors that planarm raises on purpose; `exit_code` is what the command line returns.

    `advice` are sentences on what would help, `fields` what `--json` prints besides; both may be empty.
    """

    exit_code: ClassVar[int] = 1
    advice: tuple[str, ...] = ()
    fields: Mapping[str, Any] = MappingProxyType({})


class UsageError(PlanarmError):
    """The words of the command line are wrong, or what they name is not there."""

    exit_code: ClassVar[int] = 2


class SceneError(PlanarmError):
    """A scene is wrong; `source` names the file and `key` the dotted key, tables counted from 1.

    The message reads ``source: key: problem``, for example
    ``arm.toml: obstacles[2].diameter_cm: -3.0 is not above 0; give the diameter in centimetres``.
    """

    exit_code: ClassVar[int] = 2

    def __init__(self, source: str, key: str, problem: str) -> None:
        super().__init__(f"{source}: {key}: {problem}" if key else f"{source}: {problem}")
        self.source = source
        self.key = key
        self.problem = problem


class EmulatorError(PlanarmError):
    """The emulator cannot start: a bad flash image, a link or a file that cannot be made."""

    exit_code: ClassVar[int] = 2


class OutputError(PlanarmError):
    """A file or folder that was asked for cannot be written."""

    exit_code: ClassVar[int] = 2


class PlanFileError(PlanarmError):
    """What was given as a plan is none, or cannot be read."""

    exit_code: ClassVar[int] = 2


class CaptureError(PlanarmError):
    """A recording of the pins is damaged, cannot be read, or does not hold what is asked of it."""

    exit_code: ClassVar[int] = 2


class NoPathError(PlanarmError):
    """No collision-free path joins start and goal on the given grid."""

    exit_code: ClassVar[int] = 3


class TimingError(PlanarmError):
    """A path cannot be timed within the joints' speed and acceleration."""

    exit_code: ClassVar[int] = 4


class CertificateError(PlanarmError):
    """A finished plan failed one of its checks, or carries no certificate."""

    exit_code: ClassVar[int] = 4


class LinkError(PlanarmError):
    """The serial line or its protocol failed."""

    exit_code: ClassVar[int] = 5


class HostKilledError(PlanarmError):
    """A schedule of faults killed the host: its program ends here, the board and the arm go on."""

    exit_code: ClassVar[int] = 5


class DeviceFault(PlanarmError):  # noqa: N818 - the protocol's own word for it
    """The firmware latched a fault or refused a command."""

    exit_code: ClassVar[int] = 6


class StepsDifferError(PlanarmError):
    """The executed steps are not the planned ones."""

    exit_code: ClassVar[int] = 7
