"""Which processes have a device open: what a busy port's error names. Linux tells it in /proc."""

from dataclasses import dataclass
from pathlib import Path

PROC = Path("/proc")


@dataclass(frozen=True, slots=True)
class Holder:
    """A process that has the device open."""

    pid: int
    command: str

    def __str__(self) -> str:
        return f"process {self.pid} ({self.command})"


def holders(device: str, proc: Path = PROC) -> tuple[Holder, ...]:
    """Return the processes that have `device` open, as far as this user may look and the system tells."""
    wanted = Path(device).resolve()
    found = []
    for folder in proc.glob("[0-9]*"):
        if _has_open(folder, wanted):
            found.append(Holder(int(folder.name), _command(folder)))
    return tuple(sorted(found, key=lambda holder: holder.pid))


def _has_open(folder: Path, wanted: Path) -> bool:
    try:
        return any(descriptor.resolve() == wanted for descriptor in (folder / "fd").iterdir())
    except OSError:  # another user's, or gone meanwhile
        return False


def _command(folder: Path) -> str:
    """The process's command line, without the interpreter's path and short enough for a sentence."""
    try:
        words = [word for word in (folder / "cmdline").read_bytes().decode(errors="replace").split("\0") if word]
    except OSError:
        return "gone meanwhile"
    if not words:
        return "unnamed"
    text = " ".join([Path(words[0]).name, *words[1:]])
    return text if len(text) <= 80 else text[:77] + "..."
