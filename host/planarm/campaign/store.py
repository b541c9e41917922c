"""Rows as Parquet files in a folder: written as they come, whole or not at all; a killed process loses what ran.

Each batch of rows becomes one file, made under another name and renamed. At the end they are joined into one. The
folder also holds campaign.json: what was run, by which code, on which flash image.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import planarm
from planarm.campaign.spec import Campaign
from planarm.campaign.task import Row
from planarm.errors import OutputError, UsageError
from planarm.link.released_image import released_image
from planarm.output import writing
from planarm_wire.messages import BOARDS

if TYPE_CHECKING:
    import pyarrow as pa

ABOUT = "campaign.json"
JOINED = "rows.parquet"
MOST_JOINED = 5_000_000
"""More rows stay in their files, which together are a Parquet data set as well."""


@dataclass(frozen=True, slots=True)
class About:
    """What a results folder holds.

    Attributes:
        source: the campaign's file; it may move.
        name, kind, size: the campaign's.
        spec_sha256: hash of its file and scenes.
        code: planarm's version, and the commit where it runs from a checkout.
        image_sha256: hash of the flash image.
    """

    source: str
    name: str
    kind: str
    size: int
    spec_sha256: str
    code: str
    image_sha256: str


def about(campaign: Campaign) -> About:
    """Return what this code would write for a campaign."""
    told = json.dumps([campaign.kind, [s.text for s in campaign.scenes], list(campaign.options.items())])
    axes = repr(campaign.axes)
    return About(
        source=campaign.source,
        name=campaign.name,
        kind=campaign.kind,
        size=campaign.size,
        spec_sha256=hashlib.sha256((told + axes).encode()).hexdigest(),
        code=f"{planarm.__version__} {_commit()}".strip(),
        image_sha256=hashlib.sha256(b"".join(released_image(name).read_bytes() for name in BOARDS)).hexdigest(),
    )


class ResultStore:
    """A folder of results.

    Args:
        folder: where; made when it is not there.
        told: what will be written.
        resume: go on with what is there.

    Raises:
        UsageError: pyarrow is missing, or the folder holds results and `resume` is not asked for, or holds others.
        OutputError: the folder cannot be written.
    """

    def __init__(self, folder: Path, told: About, resume: bool) -> None:
        self._arrow = arrow()
        self._folder = folder
        self._part = 0
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        before = _read_about(folder)
        if before is not None and not resume:
            raise UsageError(f"{folder}: holds results already; --resume goes on with them, or give another folder")
        if before is not None and replace(before, source=told.source) != told:
            changed = [name for name in About.__dataclass_fields__ if getattr(before, name) != getattr(told, name)]
            raise UsageError(f"{folder}: holds results of another {', '.join(changed)}; give another folder")
        with writing(folder / ABOUT):
            _write_whole(folder / ABOUT, json.dumps(_as_dict(told), indent=1).encode())
        self._told = told

    def done(self) -> frozenset[str]:
        """Return the keys of the rows that are there; those that failed for a dead worker are not tried again."""
        table = read_rows(self._folder, ["key"])
        return frozenset(table.column("key").to_pylist()) if table is not None else frozenset()

    def add(self, rows: Sequence[Row], scenes: Sequence[str]) -> None:
        """Write some rows."""
        pa, parquet = self._arrow
        table = pa.Table.from_pylist([_columns(row, scenes, self._told) for row in rows])
        while (target := self._folder / f"part-{self._part:08d}.parquet").exists():
            self._part += 1
        with writing(target):
            partial = target.with_suffix(".partial")
            parquet.write_table(table, partial)
            partial.replace(target)

    def join(self) -> Path:
        """Join all files into one, in the order of the runs; return it, or the folder when there are too many rows."""
        _, parquet = self._arrow
        table = read_rows(self._folder)
        target = self._folder / JOINED
        if table is None:
            raise OutputError(f"{self._folder}: no row was written")
        if len(table) > MOST_JOINED:
            return self._folder
        with writing(target):
            parts = sorted(self._folder.glob("part-*.parquet"))
            partial = target.with_suffix(".partial")
            parquet.write_table(table.sort_by("number"), partial)
            partial.replace(target)
            for part in parts:
                part.unlink()
        return target


def arrow() -> tuple[Any, Any]:
    """Return pyarrow and its Parquet module.

    Raises:
        UsageError: it is not installed.
    """
    try:
        import pyarrow as pa  # noqa: PLC0415 - an optional package
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError as error:
        raise UsageError("results are Parquet files: pip install 'planarm[campaign]' brings pyarrow") from error
    return pa, parquet


def read_rows(folder: Path, columns: list[str] | None = None) -> pa.Table | None:
    """Return all rows of a results folder, each key once, or None when there is none."""
    pa, parquet = arrow()
    files = [path for path in (folder / JOINED, *sorted(folder.glob("part-*.parquet"))) if path.exists()]
    if not files:
        return None
    wanted = None if columns is None else sorted({*columns, "key"})
    table = pa.concat_tables([parquet.read_table(file, columns=wanted) for file in files], promote_options="permissive")
    first: dict[str, int] = {}
    for place, key in enumerate(table.column("key").to_pylist()):
        first.setdefault(key, place)
    return table if len(first) == len(table) else table.take(list(first.values()))


def read_about(folder: Path) -> About:
    """Return what a results folder holds.

    Raises:
        UsageError: it is none.
    """
    found = _read_about(folder)
    if found is None:
        raise UsageError(
            f"{folder}: has neither a run's record.json nor a campaign's {ABOUT}; give a folder that run, sweep or"
            " campaign wrote (--out)"
        )
    return found


def _read_about(folder: Path) -> About | None:
    path = folder / ABOUT
    if not path.exists():
        return None
    try:
        return About(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise UsageError(f"{path}: is damaged ({error}); give another folder") from error


def _columns(row: Row, scenes: Sequence[str], told: About) -> Mapping[str, Any]:
    settings = {f"set.{key}": _flat(value) for key, value in row.task.settings.items()}
    return {
        "number": row.task.number,
        "key": row.key,
        "scene": scenes[row.task.scene],
        **settings,
        "verdict": row.verdict,
        "reason": row.reason,
        "took_s": row.took_s,
        **row.figures,
        "code": told.code,
        "image_sha256": told.image_sha256[:16],
    }


def _flat(value: Any) -> Any:  # noqa: ANN401 - whatever a scene may hold
    return json.dumps(value) if isinstance(value, (list, dict)) else value


def _as_dict(told: About) -> dict[str, Any]:
    return {name: getattr(told, name) for name in About.__dataclass_fields__}


def _write_whole(path: Path, data: bytes) -> None:
    partial = path.with_suffix(".partial")
    partial.write_bytes(data)
    partial.replace(path)


def _commit() -> str:
    """Return the commit of the checkout that this runs from, with a + when files were changed; empty elsewhere."""
    here = Path(__file__).resolve().parent
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0"}
    try:
        commit, changes = (
            subprocess.run(
                ["git", *words], cwd=here, env=environment, capture_output=True, text=True, check=True, timeout=10
            ).stdout.strip()
            for words in (("rev-parse", "--short=12", "HEAD"), ("status", "--porcelain", "-uno"))
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return commit + ("+" if changes else "")
