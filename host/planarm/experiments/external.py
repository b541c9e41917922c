"""Anybody's planner on the open benchmark: asked scene by scene, its paths checked exactly and held to the optimum.

docs/benchmark.md is the protocol: one program, JSON lines in and out.
"""

from __future__ import annotations

import csv
import json
import shlex
import subprocess
import threading
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from math import dist
from queue import Empty, Queue
from time import perf_counter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from planarm.errors import SceneError
from planarm.experiments.benchmark_scenes import benchmark_scene, problem, scene_hash
from planarm.experiments.node_optimum import line_is_legal
from planarm.experiments.scenes import example_file
from planarm.experiments.text_table import TextTable, number
from planarm.notice import Notice, silent
from planarm.scene import Scene
from planarm.workspace.free_map import FreeMap

Floats = NDArray[np.float64]

DATA: Final = "open_benchmark.csv"
NO_ANSWER: Final = "no answer"
ON_NODE_CM: Final = 1e-6
"""A way-point this near to a node is the node."""


@dataclass(frozen=True, slots=True)
class Optimum:
    """A line of the data file."""

    hash: str
    optimum_cm: float


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of one scene."""

    scene: int
    verdict: str
    """"solved", or what is wrong."""
    length_cm: float | None
    optimum_cm: float
    seconds: float

    @property
    def gap_percent(self) -> float | None:
        """How much longer than the optimum."""
        return None if self.length_cm is None else 100.0 * (self.length_cm / self.optimum_cm - 1.0)


@dataclass(frozen=True, slots=True)
class Score:
    """All answers of a planner."""

    command: str
    answers: tuple[Answer, ...]

    @property
    def silent(self) -> bool:
        """Whether no scene was answered at all: then there is nothing to score."""
        return all(one.verdict == NO_ANSWER for one in self.answers)

    def fields(self) -> dict[str, Any]:
        """Return the figures for JSON: how many are solved, their gaps and times, what is wrong with the others."""
        gaps = [one.gap_percent for one in self.answers if one.gap_percent is not None]
        times_ms = [1e3 * one.seconds for one in self.answers if one.length_cm is not None]
        return {
            "command": self.command,
            "scenes": len(self.answers),
            "verdicts": dict(Counter(one.verdict for one in self.answers)),
            "optimal": sum(gap < 1e-6 for gap in gaps),
            "gap_percent": _spread(gaps),
            "answer_ms": _spread(times_ms),
            "answers": [
                {"scene": one.scene, "verdict": one.verdict, "length_cm": one.length_cm, "optimum_cm": one.optimum_cm}
                for one in self.answers
            ],
        }


def read_optima() -> tuple[Optimum, ...]:
    """Return the data file's lines in the order of the scenes.

    Raises:
        SceneError: it is missing.
    """
    with example_file(DATA).open(encoding="utf-8", newline="") as file:
        return tuple(Optimum(row["hash"], float(row["optimum_cm"])) for row in csv.DictReader(file))


def score_external(command: str, scenes: int, timeout_s: float, notice: Notice = silent) -> Score:
    """Run a planner on the first scenes and judge its paths.

    Args:
        command: what to run, split as a shell would, without a shell.
        scenes: how many scenes.
        timeout_s: how long an answer may take; after a late one the program is ended, and so is the comparison.
        notice: told the progress.

    Raises:
        SceneError: the program cannot be started, or a scene made here is not that of the data file.
    """
    optima = read_optima()[:scenes]
    answers = []
    with _Program(command) as program:
        for k, optimum in enumerate(optima):
            notice("scenes", k / len(optima))
            scene, free_map = benchmark_scene(k)
            if scene_hash(scene) != optimum.hash:
                raise SceneError(DATA, "", f"scene {k} is not the one that is drawn here; install planarm again")
            began_s = perf_counter()
            told = program.ask({"scene": k, **problem(scene)}, timeout_s)
            seconds = perf_counter() - began_s
            verdict, length_cm = judge(told, scene, free_map)
            answers.append(Answer(k, verdict, length_cm, optimum.optimum_cm, seconds))
    notice("scenes", 1.0)
    return Score(command, tuple(answers))


def judge(told: str, scene: Scene, free_map: FreeMap) -> tuple[str, float | None]:
    """Return (verdict, length in cm) of an answer's line; without a length when it is no legal path."""
    try:
        answer = json.loads(told)
        points = answer["points_cm"]
        if points is None:
            return "no path", None
        array = np.array(points, np.float64)
    except (ValueError, TypeError, KeyError):
        return (NO_ANSWER if not told else "not as docs/benchmark.md says"), None
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < 2 or not np.isfinite(array).all():
        return "not as docs/benchmark.md says", None
    nodes = np.round(array / free_map.cell_cm) * free_map.cell_cm
    wrong = _what_is_wrong(array, nodes, scene, free_map)
    return (wrong, None) if wrong else ("solved", sum(dist(a, b) for a, b in pairwise(nodes)))


def _what_is_wrong(points_cm: Floats, nodes_cm: Floats, scene: Scene, free_map: FreeMap) -> str:
    """Return what makes a polyline illegal, or an empty text; `nodes_cm` are the nodes nearest to its points."""
    if abs(nodes_cm - points_cm).max() > ON_NODE_CM:
        return "off the nodes"
    if (nodes_cm[[0, -1]] != np.array([scene.task.start_cm, scene.task.goal_cm])).any():
        return "not from start to goal"
    legal = all(line_is_legal(free_map.world, *a, *b) for a, b in pairwise(nodes_cm))
    return "" if legal else "not proved free"


def score_table(score: Score) -> TextTable:
    """Return the figures as a table."""
    told = score.fields()
    rows = [("scenes", str(told["scenes"]))]
    rows += [(verdict, str(count)) for verdict, count in sorted(told["verdicts"].items())]
    rows.append(("at the optimum", str(told["optimal"])))
    for name, unit in (("gap_percent", "longer than the optimum, %"), ("answer_ms", "time of an answer, ms")):
        rows += [(f"{unit}: {key}", number(value, 3)) for key, value in told[name].items()]
    return TextTable(f"Open benchmark: {score.command}", ("what", "value"), tuple(rows), words=1)


def _spread(values: list[float]) -> dict[str, float]:
    if not values:
        return {}
    mean, (middle, p99, worst) = np.mean(values), np.percentile(values, (50, 99, 100))
    return {"mean": float(mean), "median": float(middle), "p99": float(p99), "worst": float(worst)}


class _Program:
    """A running planner: a line in, a line out."""

    def __init__(self, command: str) -> None:
        self._command = command
        self._lines: Queue[str] = Queue()

    def __enter__(self) -> _Program:
        try:
            self._process = subprocess.Popen(
                shlex.split(self._command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
            )
        except (OSError, ValueError) as problem:
            raise SceneError(self._command, "", f"cannot be started: {problem}") from problem
        threading.Thread(target=self._read, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(BrokenPipeError):  # what the ended program did not read
                if stream is not None:
                    stream.close()

    def ask(self, question: dict[str, Any], timeout_s: float) -> str:
        """Return the answer's line, or an empty text when there is none in time."""
        try:
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps(question) + "\n")
            self._process.stdin.flush()
            line = self._lines.get(timeout=timeout_s)
        except (Empty, BrokenPipeError):
            self._process.kill()  # a late answer must not be taken for that of the next scene
            return ""
        if not line:
            self._lines.put("")  # it has ended: the next question has no answer either
        return line.strip()

    def _read(self) -> None:
        assert self._process.stdout is not None
        try:
            for line in self._process.stdout:
                self._lines.put(line)
        except ValueError:  # closed at the end
            return
        self._lines.put("")  # it has ended: nobody has to wait for it
