"""Value change dumps (IEEE Std 1364-2005, clause 18): planarm's own, GTKWave's, PulseView's, simavr's and Wokwi's."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planarm.analysis.capture import BLOCK_BYTES, Chunk, channel_indices
from planarm.analysis.vcd_kernel import DIRECT_CODES, ERROR_AT, STATE, TIME, code_number, parse_block
from planarm.errors import CaptureError

HEADER_END = b"$enddefinitions"
LONGEST_HEADER = 1 << 24
WIDEST_BITS = 8

_SECTION = re.compile(r"\$(\w+)\s+(.*?)\s*\$end", re.S)
_TIMESCALE = re.compile(r"(1|10|100)\s*(s|ms|us|ns|ps|fs)$")
_UNIT_FS = {"s": 10**15, "ms": 10**12, "us": 10**9, "ns": 10**6, "ps": 10**3, "fs": 1}


def is_vcd(head: bytes) -> bool:
    """Tell whether a file that begins like this is a value change dump."""
    return head.lstrip().startswith(b"$")


@dataclass(frozen=True, slots=True)
class VcdCapture:
    """A value change dump.

    Attributes:
        path: the file.
        channels: names of its variables of 1 to 8 bits, with their scopes before them where a name stands twice.
        codes: the identifier code of each.
        unit_fs: the unit of its times.
        data_offset: where the header ends.
    """

    path: Path
    channels: tuple[str, ...]
    codes: tuple[str, ...]
    unit_fs: int
    data_offset: int

    @property
    def resolution_ps(self) -> int:
        """The file's unit of time, at least 1."""
        return max(self.unit_fs // 1000, 1)

    @classmethod
    def open(cls, path: Path) -> VcdCapture:
        """Read the header.

        Raises:
            CaptureError: it is damaged, or no variable is narrow enough.
        """
        header, offset = _read_header(path)
        unit_fs = None
        scopes: list[str] = []
        found: list[tuple[str, str, str]] = []
        for keyword, body in _SECTION.findall(header):
            words = body.split()
            if keyword == "timescale":
                unit_fs = _unit_fs(path, body)
            elif keyword == "scope" and len(words) >= 2:
                scopes.append(words[1])
            elif keyword == "upscope" and scopes:
                scopes.pop()
            elif keyword == "var" and len(words) >= 4 and words[1].isdigit() and 1 <= int(words[1]) <= WIDEST_BITS:
                found.append((words[3], ".".join((*scopes, words[3])), words[2]))
        if unit_fs is None:
            raise CaptureError(f"{path}: has no $timescale, so its times mean nothing")
        if not found:
            raise CaptureError(f"{path}: holds no variable of 1 to {WIDEST_BITS} bits")
        names = [name for name, _, _ in found]
        channels = tuple(name if names.count(name) == 1 else full for name, full, _ in found)
        return cls(path, channels, tuple(code for _, _, code in found), unit_fs, offset)

    def chunks(self, wanted: Sequence[str]) -> Iterator[Chunk]:
        """See `planarm.analysis.capture.Capture`."""
        codes = [self.codes[i] for i in channel_indices(self.path, self.channels, wanted)]
        numbers = np.array([code_number(code.encode()) for code in codes], np.int64)
        direct = np.full(DIRECT_CODES, -1, np.int16)
        for channel, number in enumerate(numbers.tolist()):
            if number < DIRECT_CODES:
                direct[number] = channel
        state = np.zeros(STATE, np.int64)
        with self.path.open("rb") as file:
            file.seek(self.data_offset)
            rest = b""
            before = self.data_offset
            while True:
                block = file.read(BLOCK_BYTES)
                text = rest + block if block else rest + b"\n"
                chunk, used = self._parse(text, direct, numbers, state, before)
                if len(chunk.times_ps):
                    yield chunk
                if not block:
                    return
                rest = text[used:]
                before += used

    def _parse(
        self, text: bytes, direct: np.ndarray, numbers: np.ndarray, state: np.ndarray, before: int
    ) -> tuple[Chunk, int]:
        """Parse whole words; return their edges and how many bytes they took."""
        room = len(text) // 2 + 1
        times, channels, levels = np.empty(room, np.int64), np.empty(room, np.uint8), np.empty(room, np.int16)
        began = int(state[TIME])
        count, used = parse_block(np.frombuffer(text, np.uint8), direct, numbers, state, times, channels, levels)
        if state[ERROR_AT] >= 0:
            at = int(state[ERROR_AT])
            word = text[at : at + 20].split(maxsplit=1)[0].decode("ascii", "replace")
            raise CaptureError(f"{self.path}: byte {before + at}: {word!r} is no time and no change of value")
        times = times[:count]
        if count and (int(times[0]) < began or (np.diff(times) < 0).any()):
            raise CaptureError(f"{self.path}: its times run backwards near byte {before}")
        scaled = times * (self.unit_fs // 1000) if self.unit_fs >= 1000 else times * self.unit_fs // 1000
        return Chunk(scaled, channels[:count], levels[:count]), used


def _read_header(path: Path) -> tuple[str, int]:
    """Return the header's text and where the changes begin."""
    text = b""
    with path.open("rb") as file:
        while HEADER_END not in text:
            block = file.read(1 << 16)
            if not block or len(text) > LONGEST_HEADER:
                raise CaptureError(f"{path}: begins like a VCD but has no $enddefinitions")
            text += block
    end = text.index(HEADER_END)
    tail = text.find(b"$end", end + len(HEADER_END))
    return text[:end].decode("ascii", "replace"), (tail + 4 if tail >= 0 else end + len(HEADER_END))


def _unit_fs(path: Path, body: str) -> int:
    found = _TIMESCALE.match(body.strip())
    if not found:
        raise CaptureError(f"{path}: $timescale {body!r} is not 1, 10 or 100 of s, ms, us, ns, ps or fs")
    return int(found[1]) * _UNIT_FS[found[2]]
