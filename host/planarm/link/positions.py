"""Which boots of which boards know where their arm stands. A board counts steps from where it was told to be.

Its counters are lost at every restart, and then it counts from nothing. So whoever tells a position - zeroing, homing,
a run that began at a known place - notes the board's boot here, and whoever needs it looks here.
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
        notes = self._read()
        notes.pop(_key(port, boot_nonce), None)
        notes[_key(port, boot_nonce)] = {"arm": arm, "how": how}
        kept = dict(list(notes.items())[-MOST:])
        with writing(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            fresh = self.path.with_suffix(f".{os.getpid()}")
            fresh.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
            fresh.replace(self.path)

    def how(self, port: str, boot_nonce: int, arm: str) -> str | None:
        """By what a boot with this arm knows its position; None: it does not."""
        note = self._read().get(_key(port, boot_nonce))
        return note["how"] if note is not None and note["arm"] == arm else None

    def _read(self) -> dict[str, dict[str, str]]:
        try:
            return dict(json.loads(self.path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return {}


def _key(port: str, boot_nonce: int) -> str:
    return f"{Path(port).resolve() if '://' not in port else port} {boot_nonce:08x}"
