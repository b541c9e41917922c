"""Value change dumps: waveforms of single-bit signals, exact to the clock cycle.

Format: IEEE Std 1364-2005, clause 18 (four-state VCD). One clock cycle at 16 MHz lasts 62.5 ns. VCD allows time
units of 1, 10 or 100 of a decimal unit only; the coarsest of them that divides a cycle is 100 ps, with exactly
625 units a cycle. So cycles are written and read back without rounding. GTKWave opens such a file as it is; in
PulseView (sigrok) set the import option "downsample" to 625, which gives one sample a cycle.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

import numpy as np
from numpy.typing import NDArray

from planarm_sim.errors import TraceError

__all__ = ["EDGE", "UNITS_PER_CYCLE", "Vcd", "VcdWriter", "read_vcd"]

EDGE = np.dtype([("cycle", np.int64), ("level", np.uint8)])
"""One level change of one signal: the clock cycle since power-up at which it holds, and the new level."""

TIMESCALE = "100 ps"
UNITS_PER_CYCLE = 625
FEMTOSECONDS = {"s": 10**15, "ms": 10**12, "us": 10**9, "ns": 10**6, "ps": 10**3, "fs": 1}
CYCLE_FS = 62_500_000
FIRST_CODE, CODES = ord("!"), 94
LEVELS = {"0": 0, "1": 1}


def _code(index: int) -> str:
    """The index-th identifier code: printable ASCII, shortest first (clause 18.2.1)."""
    text = chr(FIRST_CODE + index % CODES)
    return text if index < CODES else _code(index // CODES - 1) + text


class VcdWriter:
    """Writes level changes as they come; use it as a context manager, so that the last moment is written.

    Args:
        path: file to make or overwrite.
        signals: names, in the order of the indices that `change` takes.
        levels: their levels at `cycle`.
        cycle: moment at which the recording starts.
        numbers: names of signals of eight bits, 0 at the start, which `number` changes; they come after the others.

    Raises:
        TraceError: the file cannot be written, or the names are empty, repeated or hold white space.
    """

    def __init__(
        self,
        path: str | Path,
        signals: Sequence[str],
        levels: Sequence[int],
        cycle: int = 0,
        numbers: Sequence[str] = (),
    ) -> None:
        if not signals or len(set(signals)) != len(signals) or any(not n or n.split() != [n] for n in signals):
            raise TraceError(f"{path}: signal names must be given, differ and hold no white space: {list(signals)}")
        if len(levels) != len(signals):
            raise TraceError(f"{path}: {len(levels)} levels for {len(signals)} signals")
        self._path = path
        self._codes = [_code(index) for index in range(len(signals) + len(numbers))]
        self._first_number = len(signals)
        self._cycle = cycle
        try:
            self._file: IO[str] = Path(path).open("w", encoding="ascii", newline="\n")  # noqa: SIM115 - closed in close()
        except OSError as error:
            raise TraceError(f"{path}: cannot be written: {error.strerror}") from error
        self._write_header(signals, levels, numbers)

    def _write_header(self, signals: Sequence[str], levels: Sequence[int], numbers: Sequence[str]) -> None:
        widths = [1] * len(signals) + [8] * len(numbers)
        variables = "".join(
            f"$var wire {width} {code} {name} $end\n"
            for width, code, name in zip(widths, self._codes, (*signals, *numbers), strict=True)
        )
        values = [str(level) for level in levels] + ["b0 "] * len(numbers)
        initial = "".join(f"{value}{code}\n" for code, value in zip(self._codes, values, strict=True))
        self._file.write(
            f"$comment {UNITS_PER_CYCLE} time units are one cycle of a 16 MHz clock $end\n"
            f"$timescale {TIMESCALE} $end\n$scope module uno $end\n{variables}$upscope $end\n$enddefinitions $end\n"
            f"#{self._cycle * UNITS_PER_CYCLE}\n$dumpvars\n{initial}$end\n"
        )

    def change(self, cycle: int, signal: int, level: int) -> None:
        """Write that a signal has a level from a cycle on.

        Raises:
            TraceError: `cycle` lies before the latest one written.
        """
        if cycle != self._cycle:
            self._advance(cycle)
        self._file.write(f"{level}{self._codes[signal]}\n")

    def number(self, cycle: int, number: int, value: int) -> None:
        """Write that a signal of eight bits, counted among its kind, has a value from a cycle on.

        Raises:
            TraceError: `cycle` lies before the latest one written.
        """
        if cycle != self._cycle:
            self._advance(cycle)
        self._file.write(f"b{value:b} {self._codes[self._first_number + number]}\n")

    def write(self, edges: NDArray[Any], signal_of: Mapping[int, int], numbers: Iterable[tuple[int, int]] = ()) -> None:
        """Write recorded edges, and values of the first number with the cycles from which they hold, in order of time.

        Args:
            edges: structured array with fields cycle, pin and level.
            signal_of: index of the signal of each pin; edges of other pins are passed over.
            numbers: in order of time; at the same cycle they come after the edges.

        Raises:
            TraceError: edges before the latest moment written.
        """
        done = 0
        for cycle, value in numbers:
            until = int(np.searchsorted(edges["cycle"], cycle, side="right"))
            self._write_edges(edges[done:until], signal_of)
            self.number(cycle, 0, value)
            done = until
        self._write_edges(edges[done:], signal_of)

    def _write_edges(self, edges: NDArray[Any], signal_of: Mapping[int, int]) -> None:
        for cycle, pin, level in edges[["cycle", "pin", "level"]].tolist():
            if pin in signal_of:
                self.change(cycle, signal_of[pin], level)

    def _advance(self, cycle: int) -> None:
        if cycle < self._cycle:
            raise TraceError(f"{self._path}: cycle {cycle} comes after cycle {self._cycle}; time runs forward only")
        self._cycle = cycle
        self._file.write(f"#{cycle * UNITS_PER_CYCLE}\n")

    def close(self, cycle: int | None = None) -> None:
        """Close the file; `cycle` is the moment at which the recording ends, else its last change."""
        if self._file.closed:
            return
        if cycle is not None and cycle != self._cycle:
            self._advance(cycle)
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


@dataclass(frozen=True, slots=True)
class Vcd:
    """A recording.

    Attributes:
        edges: for each signal its level at the start, as a first entry, and then every change; dtype EDGE.
        start_cycle: first moment of the recording.
        end_cycle: last moment of the recording.
    """

    edges: dict[str, NDArray[Any]]
    start_cycle: int
    end_cycle: int


def read_vcd(path: str | Path) -> Vcd:
    """Read a recording of single-bit signals, strictly.

    Raises:
        TraceError: unreadable, damaged, signals wider than one bit, levels other than 0 and 1, or moments that
            are no whole cycles of 62.5 ns; the message names file, line and value.
    """
    try:
        lines = Path(path).read_text("ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TraceError(f"{path}: cannot be read: {error}") from error
    return _Reader(str(path)).read(lines)


class _Reader:
    """The state of one pass over a file."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._line = 0
        self._unit_fs = 0
        self._names: dict[str, str] = {}
        self._changes: dict[str, list[tuple[int, int]]] = {}
        self._moments: list[int] = []

    def read(self, lines: list[str]) -> Vcd:
        words = iter(
            [(number, word) for number, line in enumerate(lines, start=1) for word in line.split()],
        )
        in_header = True
        for self._line, word in words:
            if in_header and word.startswith("$"):
                body = self._body(words)
                in_header = word != "$enddefinitions"
                self._declare(word, body)
            elif in_header:
                raise self._error(f"{word!r} stands outside of any declaration")
            elif word == "$comment":
                self._body(words)
            elif word not in ("$dumpvars", "$end"):
                self._change(word)
        if in_header:
            raise TraceError(f"{self._path}: $enddefinitions is missing; the file may be cut off")
        if not self._moments:
            raise TraceError(f"{self._path}: holds no moment (#...); the file may be cut off")
        edges = {name: np.array(self._changes[code], dtype=EDGE) for code, name in self._names.items()}
        return Vcd(edges, self._moments[0], self._moments[-1])

    def _error(self, problem: str) -> TraceError:
        return TraceError(f"{self._path}, line {self._line}: {problem}")

    def _body(self, words: Iterator[tuple[int, str]]) -> list[str]:
        body: list[str] = []
        for self._line, word in words:
            if word == "$end":
                return body
            body.append(word)
        raise self._error("$end is missing; the file may be cut off")

    def _declare(self, keyword: str, body: list[str]) -> None:
        if keyword == "$timescale":
            text = "".join(body)
            number, unit = text.rstrip("munpfs"), text.lstrip("0123456789")
            if number not in ("1", "10", "100") or unit not in FEMTOSECONDS:
                raise self._error(f"timescale {text!r}; a number 1, 10 or 100 and a unit s to fs is allowed")
            self._unit_fs = int(number) * FEMTOSECONDS[unit]
        elif keyword == "$var":
            if len(body) != 4 or body[1] != "1":
                raise self._error(f"variable {' '.join(body)!r}; only single-bit signals are read")
            _, _, code, name = body
            if code in self._names or name in self._names.values():
                raise self._error(f"signal {name!r} with code {code!r} is declared twice")
            self._names[code] = name
            self._changes[code] = []
        elif keyword == "$enddefinitions" and not self._unit_fs:
            raise self._error("$timescale is missing")

    def _change(self, word: str) -> None:
        if word.startswith("#"):
            self._moments.append(self._cycle(word[1:]))
            return
        level, code = LEVELS.get(word[0]), word[1:]
        if level is None or code not in self._changes:
            raise self._error(f"{word!r} is no change of a declared signal to 0 or 1")
        if not self._moments:
            raise self._error(f"{word!r} stands before the first moment (#...)")
        self._changes[code].append((self._moments[-1], level))

    def _cycle(self, text: str) -> int:
        if not text.isdecimal():
            raise self._error(f"moment {text!r} is not a number")
        cycle, rest = divmod(int(text) * self._unit_fs, CYCLE_FS)
        if rest:
            raise self._error(f"moment {text} is no whole number of cycles of 62.5 ns")
        if self._moments and cycle <= self._moments[-1]:
            raise self._error(f"moment {text} does not come after the one before")
        return cycle
