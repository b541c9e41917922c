"""Which boots of which boards know where their arm stands. A board counts steps from where it was told to be.

Its counters are lost at every restart, and then it counts from nothing. So whoever tells a position - zeroing, homing,
a run that began at a known place - notes the board's boot here, and whoever needs it looks here. So with CONFIG, which
a board keeps as long.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path

from planarm.output import writing

MOST = 50
FOLDER_VARIABLE = "PLANARM_STATE"


def default_path() -> Path:
    """Where the notes are: in $PLANARM_STATE, else in the user's state folder (XDG base directories)."""
    own = os.environ.get(FOLDER_VARIABLE)
    if own:
        return Path(own) / "positions.json"
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "planarm" / "positions.json"


@dataclass(frozen=True, slots=True)
class Positions:
    """The notes in a file; a missing or damaged one knows nothing."""

    path: Path

    def remember(self, port: str, boot_nonce: int, arm: str, how: str) -> None:
        """Note that a boot knows its position, and by what; the oldest notes are dropped.

        Raises:
            OutputError: it cannot be written.
        """
        self._note(port, boot_nonce, {"arm": arm, "how": how})

    def note_config(self, port: str, boot_nonce: int, config: str) -> None:
        """Note what CONFIG a boot was told, as the payload's hexadecimal digits.

        Raises:
            OutputError: it cannot be written.
        """
        self._note(port, boot_nonce, {"config": config})

    def forget(self, port: str, boot_nonce: int) -> None:
        """Note that a boot knows its position no more; what CONFIG it was told it keeps.

        Raises:
            OutputError: it cannot be written.
        """
        if "how" in self._read().get(_key(port, boot_nonce), {}):
            self._note(port, boot_nonce, {"arm": "", "how": ""})

    def _note(self, port: str, boot_nonce: int, told: dict[str, str]) -> None:
        notes = self._read()
        before = notes.pop(_key(port, boot_nonce), {})
        notes[_key(port, boot_nonce)] = before | told
        kept = dict(list(notes.items())[-MOST:])
        with writing(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            fresh = self.path.with_suffix(f".{os.getpid()}")
            fresh.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
            fresh.replace(self.path)

    def how(self, port: str, boot_nonce: int, arm: str) -> str | None:
        """By what a boot with this arm knows its position; None: it does not."""
        note = self._read().get(_key(port, boot_nonce))
        return note.get("how") if note is not None and note.get("arm") == arm else None

    def config(self, port: str, boot_nonce: int) -> str | None:
        """What CONFIG a boot was told, as `note_config` was given it; None: nothing is noted."""
        return self._read().get(_key(port, boot_nonce), {}).get("config")

    def _read(self) -> dict[str, dict[str, str]]:
        try:
            return dict(json.loads(self.path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return {}


def _key(port: str, boot_nonce: int) -> str:
    return f"{Path(port).resolve() if '://' not in port else port} {boot_nonce:08x}"
