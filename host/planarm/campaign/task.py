"""One run of a sweep or campaign, and the row it leaves."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

Value: TypeAlias = "str | int | float | bool | list[Any]"
Figures: TypeAlias = "dict[str, str | int | float | bool | None]"


@dataclass(frozen=True, slots=True)
class Task:
    """One run.

    Attributes:
        number: its place in the campaign, from 0.
        scene: which of the campaign's scenes it takes, from 0.
        settings: dotted scene keys and their values, for example {"planner.seed": 7}.
    """

    number: int
    scene: int
    settings: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SceneText:
    """A scene file as text, so that it travels to workers that do not have the file."""

    source: str
    text: str


@dataclass(frozen=True, slots=True)
class Limits:
    """What one run may take before it is a failed row: seconds, and megabytes of its worker's address space or 0."""

    task_s: float
    memory_mb: int


@dataclass(frozen=True, slots=True)
class Batch:
    """Runs that travel to a worker together."""

    kind: str
    scenes: tuple[SceneText, ...]
    tasks: tuple[Task, ...]
    limits: Limits
    options: Mapping[str, Value]

    def single(self, task: Task) -> Batch:
        """Return the batch of one of its runs."""
        return Batch(self.kind, self.scenes, (task,), self.limits, self.options)


@dataclass(frozen=True, slots=True)
class Row:
    """What one run left.

    Attributes:
        task: the run.
        key: hash of everything that decides its result, the code apart.
        verdict: "ok", another word of its kind, or "failed".
        reason: what went wrong, empty when nothing did.
        took_s: how long it took on its worker.
        figures: numbers and words of its kind.
    """

    task: Task
    key: str
    verdict: str
    reason: str
    took_s: float
    figures: Figures


def task_key(kind: str, scene: SceneText, task: Task, options: Mapping[str, Value]) -> str:
    """Return the hash by which a finished run is known again."""
    told = {"kind": kind, "scene": scene.text, "settings": dict(task.settings), "options": dict(options)}
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:20]
