"""SWEEP.toml and CAMPAIGN.toml: what varies, over what, and within what limits (docs/scale.md)."""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from planarm.campaign.task import Batch, Limits, SceneText, Task, Value, task_key
from planarm.errors import SceneError
from planarm.scene.strict_toml import Table

ROOT_KEYS = ("name", "kind", "scenes", "batch", "limits", "vary", "options")
LIMIT_KEYS = ("task_s", "memory_mb", "cluster_s")
RANGE_KEYS = ("first", "count")
KINDS = ("map", "search", "plan", "line", "faults", "self-test")
OPTION_KEYS: Mapping[str, tuple[str, ...]] = {
    "map": (),
    "search": (),
    "plan": (),
    "line": ("seconds",),
    "faults": (),
    "self-test": (),
}
MOST_TASKS = 10**9


@dataclass(frozen=True, slots=True)
class Campaign:
    """A sweep or campaign: every scene with every combination of the values.

    Attributes:
        name, source: what it is called, and its file.
        kind: what one run does; see `planarm.campaign.work`.
        scenes: the scene files, as text.
        axes: dotted scene keys (or "seed") and their values, the last varies fastest.
        batch: runs that travel together.
        limits: of one run.
        cluster_s: how long a cluster may be without any worker.
        options: of the kind.
    """

    name: str
    source: str
    kind: str
    scenes: tuple[SceneText, ...]
    axes: tuple[tuple[str, range | tuple[Value, ...]], ...]
    batch: int
    limits: Limits
    cluster_s: float
    options: Mapping[str, Value]

    @property
    def size(self) -> int:
        """How many runs there are."""
        return len(self.scenes) * math.prod(len(values) for _, values in self.axes)

    def tasks(self) -> Iterator[Task]:
        """Yield the runs in order, without keeping them all."""
        names = [name for name, _ in self.axes]
        numbers = itertools.count()
        for scene in range(len(self.scenes)):
            for values in itertools.product(*(values for _, values in self.axes)):
                yield Task(next(numbers), scene, dict(zip(names, values, strict=True)))

    def batches(self, done: frozenset[str]) -> Iterator[Batch]:
        """Yield the runs whose key is not among `done`, some at a time."""
        waiting: list[Task] = []
        for task in self.tasks():
            if done and task_key(self.kind, self.scenes[task.scene], task, self.options) in done:
                continue
            waiting.append(task)
            if len(waiting) == self.batch:
                yield Batch(self.kind, self.scenes, tuple(waiting), self.limits, self.options)
                waiting = []
        if waiting:
            yield Batch(self.kind, self.scenes, tuple(waiting), self.limits, self.options)


def load_campaign(path: Path) -> Campaign:
    """Read a sweep or campaign file; scenes are found from its folder.

    Raises:
        SceneError: it cannot be read, or is none.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(
            str(path), "", f"cannot be read: {error.strerror}; give the path of a sweep or campaign (docs/scale.md)"
        ) from error
    except ValueError as error:
        raise SceneError(str(path), "", f"is not valid TOML: {error}") from error
    root = Table.with_keys(str(path), "", data, ROOT_KEYS)
    kind = root.choice("kind", KINDS)
    limits = root.table("limits", LIMIT_KEYS, optional=True)
    campaign = Campaign(
        name=root.text("name", path.stem),
        source=str(path),
        kind=kind,
        scenes=tuple(_scene_text(root, path.parent, name) for name in _names(root)),
        axes=tuple(_axis(root, key, values) for key, values in _vary(root).items()),
        batch=root.integer("batch", 20, at_least=1, at_most=100_000),
        limits=Limits(
            limits.number("task_s", 60.0, above=0.0, at_most=86_400.0),
            limits.integer("memory_mb", 0, at_least=0, at_most=10**7),
        ),
        cluster_s=limits.number("cluster_s", 60.0, above=0.0, at_most=86_400.0),
        options=_options(root.table("options", OPTION_KEYS[kind], optional=True)),
    )
    if campaign.size > MOST_TASKS:
        root.fail("vary", f"{campaign.size} runs; {MOST_TASKS} are the most")
    return campaign


def _options(table: Table) -> dict[str, Value]:
    """Return the kind's options; all of them are numbers above 0."""
    return {key: table.number(key, above=0.0, at_most=3600.0) for key in table.data}


def _names(root: Table) -> list[str]:
    names = root.data.get("scenes")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        root.reject("scenes", names, "a list of scene files")
    return names


def _scene_text(root: Table, folder: Path, name: str) -> SceneText:
    path = folder / name
    try:
        return SceneText(name, path.read_text(encoding="utf-8"))
    except OSError as error:
        root.fail("scenes", f"{path} cannot be read: {error.strerror}")


def _vary(root: Table) -> Mapping[str, object]:
    data = root.data.get("vary", {})
    if not isinstance(data, dict):
        root.reject("vary", data, "a table of dotted scene keys in quotes")
    return data


def _axis(root: Table, key: str, values: object) -> tuple[str, range | tuple[Value, ...]]:
    """Return a key with its values: a list, or { first, count } for whole numbers in a row."""
    if isinstance(values, list) and values:
        return key, tuple(values)
    if not isinstance(values, dict) or "count" not in values:
        root.reject(f"vary.{key}", values, "a list, or { first = 0, count = 100 } (dotted keys in quotes)")
    table = Table.with_keys(root.source, f"vary.{key}", values, RANGE_KEYS)
    first = table.integer("first", 0, at_least=0, at_most=2**62)
    return key, range(first, first + table.integer("count", at_least=1, at_most=MOST_TASKS))
