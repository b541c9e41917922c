"""The exceptions that planarm raises on purpose, each with its code; the code's first digit is the exit code.

::

    PlanarmError
    ├── UsageError        E201  the words of the command line are wrong
    ├── SceneError        E202  the scene file, or a value given in its place, is wrong
    ├── EmulatorError     E203  the emulator cannot start: image, link or file
    ├── OutputError       E204  a file or folder cannot be written
    ├── PlanFileError     E205  the file is no plan, or cannot be read
    ├── JournalError      E207  a run's journal is damaged, or is none
    ├── CaptureError      E206  the recording of the pins cannot be read, or does not show what is asked
    ├── ClusterError      E208  a campaign's cluster is gone: its scheduler, or all of its workers
    ├── NoPathError       E301  start and goal are fine, but no collision-free path joins them
    ├── TimingError       E401  the path cannot be timed within the joints' limits
    ├── CertificateError  E402  a check of the finished plan failed
    ├── LinkError         E501  the serial line or its protocol failed; link.position.StreamError tells where the arm is
    ├── HostKilledError   E502  a schedule of faults killed the host
    ├── DeviceFault       E601  the firmware latched a fault or refused a command; so does link.position.StreamFault
    └── StepsDifferError  E701  the executed steps are not the planned ones

Every message names the cause, the place, the value, the limit and the setting to change.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar


class PlanarmError(Exception):
    """Base of all errors that planarm raises on purpose; `exit_code` is what the command line returns.

    `code` is what `planarm explain` takes. `advice` are sentences on what would help, `fields` what `--json` prints
    besides; both may be empty.
    """

    exit_code: ClassVar[int] = 1
    code: ClassVar[str] = ""
    advice: tuple[str, ...] = ()
    fields: Mapping[str, Any] = MappingProxyType({})

    def told(self) -> dict[str, Any]:
        """Return the error as plain values: kind, code, message, exit code, its fields, and its notes."""
        notes = {"notes": list(self.__notes__)} if hasattr(self, "__notes__") else {}
        return {
            **self.fields,
            "kind": type(self).__name__,
            **({"code": self.code} if self.code else {}),
            "message": str(self),
            "exit_code": self.exit_code,
            **notes,
        }


class UsageError(PlanarmError):
    """The words of the command line are wrong, or what they name is not there."""

    exit_code: ClassVar[int] = 2
    code: ClassVar[str] = "E201"


class SceneError(PlanarmError):
    """A scene is wrong; `source` names the file and `key` the dotted key, tables counted from 1.

    The message reads ``source: key: problem``, for example
    ``arm.toml: obstacles[2].diameter_cm: -3.0 is not above 0; give the diameter in centimetres``.
    """

    exit_code: ClassVar[int] = 2
    code: ClassVar[str] = "E202"

    def __init__(self, source: str, key: str, problem: str) -> None:
        super().__init__(f"{source}: {key}: {problem}" if key else f"{source}: {problem}")
        self.source = source
        self.key = key
        self.problem = problem


class EmulatorError(PlanarmError):
    """The emulator cannot start: a bad flash image, a link or a file that cannot be made."""

    exit_code: ClassVar[int] = 2
    code: ClassVar[str] = "E203"


class OutputError(PlanarmError):
    """A file or folder that was asked for cannot be written."""

    exit_code: ClassVar[int] = 2
    code: ClassVar[str] = "E204"


class PlanFileError(PlanarmError):
    """What was given as a plan is none, or cannot be read."""

    exit_code: ClassVar[int] = 2
    code: ClassVar[str] = "E205"


class JournalError(PlanarmError):
    """What was given as a run has no journal, or it cannot be read."""

    exit_code: ClassVar[int] = 2
    code: ClassVar[str] = "E207"


class CaptureError(PlanarmError):
    """A recording of the pins is damaged, cannot be read, or does not hold what is asked of it."""

    exit_code: ClassVar[int] = 2
    code: ClassVar[str] = "E206"


class ClusterError(PlanarmError):
    """A campaign's cluster is gone: its scheduler, or all of its workers."""

    exit_code: ClassVar[int] = 2
    code: ClassVar[str] = "E208"


class NoPathError(PlanarmError):
    """No collision-free path joins start and goal on the given grid."""

    exit_code: ClassVar[int] = 3
    code: ClassVar[str] = "E301"


class TimingError(PlanarmError):
    """A path cannot be timed within the joints' speed and acceleration."""

    exit_code: ClassVar[int] = 4
    code: ClassVar[str] = "E401"


class CertificateError(PlanarmError):
    """A finished plan failed one of its checks, or carries no certificate."""

    exit_code: ClassVar[int] = 4
    code: ClassVar[str] = "E402"


class LinkError(PlanarmError):
    """The serial line or its protocol failed."""

    exit_code: ClassVar[int] = 5
    code: ClassVar[str] = "E501"


class HostKilledError(PlanarmError):
    """A schedule of faults killed the host: its program ends here, the board and the arm go on."""

    exit_code: ClassVar[int] = 5
    code: ClassVar[str] = "E502"


class DeviceFault(PlanarmError):  # noqa: N818 - the protocol's own word for it
    """The firmware latched a fault or refused a command."""

    exit_code: ClassVar[int] = 6
    code: ClassVar[str] = "E601"


class StepsDifferError(PlanarmError):
    """The executed steps are not the planned ones."""

    exit_code: ClassVar[int] = 7
    code: ClassVar[str] = "E701"
