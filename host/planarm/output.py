"""Writing files and folders that a user named: whatever goes wrong is one sentence with the path and the cause."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from planarm.errors import OutputError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError from writing `path` into an OutputError that says what to change."""
    try:
        yield
    except (FileExistsError, NotADirectoryError) as error:
        raise OutputError(f"{path}: cannot be written: {_there(path)} is a file; give the path of a folder") from error
    except OSError as error:
        cause = error.strerror or str(error)
        raise OutputError(f"{path}: cannot be written: {cause}; give another place, or make room for it") from error


def require_folder_place(path: Path) -> None:
    """Refuse a folder's path that cannot become one, before any work is done for it.

    Raises:
        OutputError: `path`, or what it would lie in, is a file, or may not be written into.
    """
    there = _there(path)
    if not there.is_dir():
        raise OutputError(f"{path}: cannot be written: {there} is a file; give the path of a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise OutputError(f"{path}: cannot be written: {there} may not be written into; give another place")


def require_place(path: Path) -> None:
    """Refuse a file's path that cannot be written whatever its content, before any work is done for it.

    Raises:
        OutputError: `path` is a folder, or its folder does not exist; or it may not be written.
    """
    if path.is_dir():
        raise OutputError(f"{path}: cannot be written: is a folder; give the path of a file")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: cannot be written: {path.parent} is no folder; make it first")
    there = _there(path)
    if not os.access(there, os.W_OK):
        raise OutputError(f"{path}: cannot be written: {there} may not be written; give another place")


def _there(path: Path) -> Path:
    """Return the path, or the nearest of the folders around it that exists."""
    return next(one for one in (path, *path.absolute().parents) if one.exists())
