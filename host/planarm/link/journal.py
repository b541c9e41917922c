"""The journal of a run: every byte on the line with its time, on disk before it is sent.

A file of records, each ``kind (1 byte), length (4), time in seconds (8), data, CRC-32 (4)``, little-endian, behind one
line of text. Records are only ever added, and each is written in one piece: what a killed program or a lost supply
leaves is whole records and at most one that is cut short, which its length and CRC-32 tell.

A record "sent" stands before its bytes go out. It may therefore tell of bytes that never left; what the device executed
cannot be more than it tells, and the device's own ledger says how much of it.
"""

import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

from planarm.errors import JournalError, OutputError

MAGIC = b"planarm journal 1\n"
_HEAD = struct.Struct("<BId")
_CRC = struct.Struct("<I")
MOST_BYTES = 1 << 26
"""64 MiB: beyond it questions and answers are left out, which move nothing; a plan of ten minutes takes a quarter."""


class Kind(IntEnum):
    """What a record tells of."""

    NOTE = 1
    """A JSON object; the first one of a file tells the run."""
    SENT = 2
    """Bytes to the device."""
    RECEIVED = 3
    """Bytes from the device."""


@dataclass(frozen=True, slots=True)
class Record:
    """One record; `t_s` is the transport's clock."""

    kind: Kind
    t_s: float
    data: bytes

    def note(self) -> dict[str, Any]:
        """The object of a note."""
        return dict(json.loads(self.data))


@dataclass(frozen=True, slots=True)
class Journal:
    """A journal as read: its records, and whether the last one was cut short."""

    records: tuple[Record, ...]
    torn: bool

    @property
    def about(self) -> dict[str, Any]:
        """What the file tells of its run."""
        return self.records[0].note()


class JournalWriter:
    """Adds records to a run's journal.

    Args:
        path: the file; what is there is gone on with.

    Raises:
        OutputError: it cannot be opened or written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = -1
        with self._told():
            is_new = not path.exists()
            self._file = os.open(path, os.O_CREAT | os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0), 0o644)
            self.size = os.fstat(self._file).st_size
        if is_new:
            self._append(MAGIC)
            self.sync()
            _sync_folder(path.parent)

    def note(self, t_s: float, told: Mapping[str, Any]) -> None:
        """Add a note and have it on disk."""
        self.add(Kind.NOTE, t_s, json.dumps(told, sort_keys=True).encode())
        self.sync()

    def add(self, kind: Kind, t_s: float, data: bytes) -> None:
        """Add a record; a killed program leaves it, a lost supply only after `sync`."""
        head = _HEAD.pack(kind, len(data), t_s)
        self._append(head + data + _CRC.pack(zlib.crc32(head + data)))

    def sync(self) -> None:
        """Come back when everything added is on the disk."""
        with self._told():
            getattr(os, "fdatasync", os.fsync)(self._file)

    def close(self) -> None:
        """Have everything on disk and close the file; closing twice is fine."""
        if self._file >= 0:
            self.sync()
            os.close(self._file)
            self._file = -1

    def _append(self, data: bytes) -> None:
        with self._told():
            written = os.write(self._file, data)
        if written != len(data):
            raise OutputError(f"{self.path}: only {written} of {len(data)} bytes were written; make room on the disk")
        self.size += written

    def _told(self) -> "_Told":
        return _Told(self.path)


class _Told:
    """Turns an OSError into an OutputError; lighter than a generator, for it stands around every frame."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        return None

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        if isinstance(error, OSError):
            cause = error.strerror or str(error)
            raise OutputError(f"{self._path}: cannot be written: {cause}; nothing more is sent") from error


def _sync_folder(folder: Path) -> None:
    """Have the new file's name on the disk, where a folder can be opened for that (not on Windows)."""
    if os.name != "posix":
        return
    opened = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


def read_journal(path: Path) -> Journal:
    """Read a journal, up to a record that was cut short or damaged.

    Raises:
        JournalError: it cannot be read, or is none, or not even its first record is whole.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise JournalError(f"{path}: cannot be read: {error.strerror}; give the folder of a run") from error
    if not data.startswith(MAGIC):
        raise JournalError(f"{path}: is no journal of this version; give the folder of a run that planarm made")
    records = tuple(_records(data))
    if not records or records[0].kind is not Kind.NOTE:
        raise JournalError(f"{path}: the journal's first record is not whole, so nothing was sent; start the run anew")
    whole = len(MAGIC) + sum(_HEAD.size + len(record.data) + _CRC.size for record in records)
    return Journal(records, whole < len(data))


def _records(data: bytes) -> Iterator[Record]:
    at = len(MAGIC)
    while at + _HEAD.size <= len(data):
        kind, length, t_s = _HEAD.unpack_from(data, at)
        end = at + _HEAD.size + length
        if end + _CRC.size > len(data) or _CRC.unpack_from(data, end)[0] != zlib.crc32(data[at:end]):
            return
        yield Record(Kind(kind), t_s, data[at + _HEAD.size : end])
        at = end + _CRC.size
