"""Parses the changes of a value change dump, block by block, at some hundred megabytes a second."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from planarm.analysis.capture import UNKNOWN
from planarm_wire.kernel_cache import kernel

Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int64]
Slots = npt.NDArray[np.int16]

# What one block leaves for the next, in the file's units.
STATE = 4
TIME, MODE, VECTOR, ERROR_AT = range(STATE)
PLAIN, CODE_FOLLOWS, CODE_IGNORED, IN_COMMENT = range(4)

# What a word of a dump is, by its first character (clause 18.2).
_WRONG, _MOMENT, _LEVEL, _BITS, _OTHER_VALUE, _COMMAND = range(6)
_STARTS = {"#": _MOMENT, "01xXzZ": _LEVEL, "bB": _BITS, "rRsS": _OTHER_VALUE, "$": _COMMAND}
_KINDS = np.full(256, _WRONG, np.int64)
for _characters, _kind in _STARTS.items():
    _KINDS[list(_characters.encode())] = _kind

CODE_BASE = 95  # identifier codes are printable ASCII, 33 to 126 (clause 18.2.1)
DIRECT_CODES = CODE_BASE + CODE_BASE * CODE_BASE
LONGEST_CODE = 9


def code_number(code: bytes) -> int:
    """Return the number of an identifier code; different codes have different ones."""
    number = 0
    for character in code[:LONGEST_CODE]:
        number = number * CODE_BASE + (character - 32)
    return number


@kernel
def _channel_of(text: Bytes, begin: int, end: int, direct: Slots, numbers: Ints) -> np.int64:
    """Return the channel of the identifier code text[begin:end], or -1."""
    number = np.int64(0)
    for i in range(begin, min(end, begin + LONGEST_CODE)):
        number = number * CODE_BASE + (np.int64(text[i]) - 32)
    if 0 <= number < DIRECT_CODES:
        return np.int64(direct[number])
    for channel in range(len(numbers)):
        if numbers[channel] == number:
            return np.int64(channel)
    return np.int64(-1)


@kernel
def _number_at(text: Bytes, begin: int, end: int) -> np.int64:
    """Return the decimal number text[begin:end], or -1 where it is none."""
    if begin == end:
        return np.int64(-1)
    number = np.int64(0)
    for i in range(begin, end):
        digit = np.int64(text[i]) - 48
        if digit < 0 or digit > 9:
            return np.int64(-1)
        number = number * 10 + digit
    return number


@kernel
def _bits_at(text: Bytes, begin: int, end: int) -> np.int64:
    """Return the last eight bits of a binary number, or UNKNOWN where one of them is x or z."""
    value = np.int64(0)
    for i in range(begin, end):
        digit = np.int64(text[i]) - 48
        if digit < 0 or digit > 1:
            return np.int64(UNKNOWN)
        value = (value * 2 + digit) & 0xFF
    return value


@kernel
def _spells(text: Bytes, begin: int, end: int, second: int, length: int) -> bool:
    """Tell a command by its length and second character: $end and $comment are the only such ones here."""
    return end - begin == length and text[begin + 1] == second


@kernel
def _read_plain(text: Bytes, begin: int, end: int, state: Ints) -> bool:
    """Take in a word that stands alone and is no level; tell whether it may stand there."""
    kind = _KINDS[text[begin]]
    if kind == _MOMENT:
        number = _number_at(text, begin + 1, end)
        state[TIME] = number
        return bool(number >= 0)
    if kind == _BITS:
        state[VECTOR] = _bits_at(text, begin + 1, end)
        state[MODE] = CODE_FOLLOWS
    elif kind == _OTHER_VALUE:
        state[MODE] = CODE_IGNORED
    elif kind == _COMMAND and _spells(text, begin, end, ord("c"), 8):
        state[MODE] = IN_COMMENT
    return bool(kind != _WRONG)


@kernel
def parse_block(
    text: Bytes, direct: Slots, numbers: Ints, state: Ints, times: Ints, channels: Bytes, levels: Slots
) -> tuple[int, int]:
    """Parse the whole words of `text`; return the number of edges and of bytes taken.

    Args:
        text: uint8[n]; the word that its end may cut is left for the next block.
        direct: channel of each short identifier code, -1 for others, int16[DIRECT_CODES].
        numbers: the code number of each channel, int64[channels].
        state: int64[STATE], 0 before the first block; ERROR_AT is -1, or where a word is wrong.
        times: receives the edges' moments, in the file's unit of time.
        channels: receives their channels.
        levels: receives their levels.
    """
    state[ERROR_AT] = -1
    count = 0
    at = 0
    size = len(text)
    while True:
        while at < size and text[at] <= 32:
            at += 1
        end = at
        while end < size and text[end] > 32:
            end += 1
        if end >= size:  # the end may have cut this word
            return count, at
        channel = np.int64(-1)
        level = np.int64(0)
        mode = state[MODE]
        if mode == PLAIN:
            if _KINDS[text[at]] == _LEVEL:
                channel = _channel_of(text, at + 1, end, direct, numbers)
                level = np.int64(text[at]) - 48 if text[at] <= 49 else np.int64(UNKNOWN)
            elif not _read_plain(text, at, end, state):
                state[ERROR_AT] = at
                return count, at
        elif mode == CODE_FOLLOWS:
            channel = _channel_of(text, at, end, direct, numbers)
            level = state[VECTOR]
            state[MODE] = PLAIN
        elif mode == CODE_IGNORED or _spells(text, at, end, ord("e"), 4):
            state[MODE] = PLAIN
        if channel >= 0:
            times[count] = state[TIME]
            channels[count] = channel
            levels[count] = level
            count += 1
        at = end
