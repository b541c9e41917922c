"""Which processes have a device open: what a busy port's error names. Linux tells it in /proc."""

from dataclasses import dataclass
from pathlib import Path

PROC = Path("/proc")


@dataclass(frozen=True, slots=True)
class Holder:
    """A process that has the device open; `is_planarm` tells whether it is one of ours, which knows how to stop."""

    pid: int
    command: str
    is_planarm: bool = False

    def __str__(self) -> str:
        return f"process {self.pid} ({self.command})"


def holders(device: str, proc: Path = PROC) -> tuple[Holder, ...]:
    """Return the processes that have `device` open, as far as this user may look and the system tells."""
    wanted = Path(device).resolve()
    found = []
    for folder in proc.glob("[0-9]*"):
        if _has_open(folder, wanted):
            words = _words(folder)
            found.append(Holder(int(folder.name), _command(words), _is_planarm(words)))
    return tuple(sorted(found, key=lambda holder: holder.pid))


def _has_open(folder: Path, wanted: Path) -> bool:
    try:
        return any(descriptor.resolve() == wanted for descriptor in (folder / "fd").iterdir())
    except OSError:  # another user's, or gone meanwhile
        return False


def _words(folder: Path) -> list[str]:
    """The process's command line; empty when it has gone meanwhile, or has none."""
    try:
        return [word for word in (folder / "cmdline").read_bytes().decode(errors="replace").split("\0") if word]
    except OSError:
        return []


def _command(words: list[str]) -> str:
    """A command line without the interpreter's path, on one line and short enough for a sentence."""
    if not words:
        return "unnamed"
    text = " ".join(" ".join([Path(words[0]).name, *words[1:]]).split())
    return text if len(text) <= 80 else text[:77] + "..."


def _is_planarm(words: list[str]) -> bool:
    """Whether the program is `planarm`: the script, `python -m planarm`, or Python told to import its command line."""
    program = words[:3]
    return any(Path(word).name == "planarm" for word in program) or any("planarm.cli" in word for word in program)
