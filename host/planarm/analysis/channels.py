"""Which channel of a recording is which joint's line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from planarm.analysis.step_scan import INTERRUPT_ROLE
from planarm.errors import CaptureError

Pins = Sequence[tuple[str, str]]

INTERRUPT_CHANNEL = "isr"
"""The emulator's line of the interrupt that runs; see docs/emulator.md."""

_WORD = re.compile(r"(step|dir)([1-9])=(.+)")


@dataclass(frozen=True, slots=True)
class ChannelMap:
    """The channels to read, in order, and what each is.

    Attributes:
        names: the recording's channels.
        lines: for each the joint's line ("step1", "dir1" ...), or "isr".
        joints: number of joints.
    """

    names: tuple[str, ...]
    lines: tuple[str, ...]
    joints: int

    @property
    def roles(self) -> npt.NDArray[np.int64]:
        """See `planarm.analysis.step_scan.scan_chunk`."""
        return np.array([_role(line) for line in self.lines], np.int64)


def map_channels(path: Path, recorded: Sequence[str], words: Sequence[str], pins: Pins) -> ChannelMap:
    """Decide which channel is which line: by the words given, else by the board's pin names.

    Args:
        path: the recording, for messages.
        recorded: its channels.
        words: like "step1=Channel 0" and "dir1=Channel 1"; every joint needs both.
        pins: the board's STEP and DIR pin of each joint, whose names count without words.

    Raises:
        CaptureError: a word is none of these, names no channel, or a joint lacks a line.
    """
    lines = _from_words(path, recorded, words) if words else _from_pins(recorded, pins)
    if not lines:
        raise CaptureError(
            f"{path}: none of the board's step pins ({', '.join(step for step, _ in pins)}) is among its channels "
            f"({', '.join(recorded)}); name the lines, as in --map 'step1={recorded[0]}' --map 'dir1=...'"
        )
    joints = max(int(line[-1]) for line in lines)
    for joint in range(1, joints + 1):
        for line in (f"step{joint}", f"dir{joint}"):
            if line not in lines:
                raise CaptureError(f"{path}: {line} is mapped to no channel; add --map '{line}=CHANNEL'")
    if INTERRUPT_CHANNEL in recorded:
        lines[INTERRUPT_CHANNEL] = INTERRUPT_CHANNEL
    return ChannelMap(tuple(lines.values()), tuple(lines), joints)


def _from_pins(recorded: Sequence[str], pins: Pins) -> dict[str, str]:
    """Take the channels that are named like the board's pins, with or without scopes before them."""
    last_words = {name.rpartition(".")[2]: name for name in recorded}
    found: dict[str, str] = {}
    for joint, (step, direction) in enumerate(pins, start=1):
        if step in last_words and direction in last_words:
            found[f"step{joint}"] = last_words[step]
            found[f"dir{joint}"] = last_words[direction]
    return found


def _from_words(path: Path, recorded: Sequence[str], words: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for word in words:
        match = _WORD.fullmatch(word)
        if not match:
            raise CaptureError(f"--map {word!r} is not like 'step1=CHANNEL' or 'dir1=CHANNEL', joints 1 to 9")
        line, channel = f"{match[1]}{match[2]}", match[3]
        if channel not in recorded:
            raise CaptureError(f"{path}: --map {word!r}: no channel {channel!r}; it has {', '.join(recorded)}")
        if line in found or channel in found.values():
            raise CaptureError(f"--map {word!r}: the line or the channel stands in another --map already")
        found[line] = channel
    return found


def _role(line: str) -> int:
    if line == INTERRUPT_CHANNEL:
        return INTERRUPT_ROLE
    return 2 * (int(line[-1]) - 1) + int(line.startswith("dir"))
