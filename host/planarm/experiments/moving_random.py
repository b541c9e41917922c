"""Random scenes with moving obstacles: how often each way of planning arrives, touches, and how late it is.

Everything but the obstacles and the task is that of the first example: the paper's arm and world. Start and goal are
free at time 0; whether a motion exists at all is the exact search's to say.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from statistics import fmean, median
from typing import Final, Literal

import numpy as np
from numpy.random import Generator

from planarm.experiments.scenes import example_file
from planarm.experiments.text_table import TextTable, number
from planarm.model.arm import Arm
from planarm.model.kinematics import ElbowSide, forward
from planarm.model.moving import first_touches, moving_set
from planarm.notice import Notice, silent
from planarm.scene import Obstacle, ObstacleMotion, Scene, TaskSpec, load_scene
from planarm.search.moving.rules import run_rule
from planarm.search.moving.space_time import search_space_time
from planarm.search.moving.timed_path import TimedPath
from planarm.smoothing.timed_spline import from_nodes, judge
from planarm.workspace.moving_map import MovingMap, build_moving_map, moving_spec

CELL_CM: Final = 2.0
SAMPLES: Final = 120
LOOK_S: Final = 0.01
"""How often an executed plan is looked at again."""

Way = Literal["plain", "modified", "exact"]
WAYS: Final[tuple[Way, ...]] = ("plain", "modified", "exact")


@dataclass(frozen=True, slots=True)
class Tally:
    """What became of one way of planning."""

    way: Way
    outcomes: dict[str, int]
    late_samples: tuple[int, ...]
    """How much later than the exact search it arrived, where it arrived without a contact."""
    times_ms: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RandomMoving:
    """The whole campaign."""

    scenes: int
    seed: int
    tallies: tuple[Tally, ...]
    executed: int
    """Exact plans, each judged as a motion and looked at again."""
    touched: tuple[int, ...]
    """Numbers of the scenes whose executed plan touched something: none is expected."""


def compare_random(count: int, seed: int = 1, notice: Notice = silent) -> RandomMoving:
    """Plan so many random scenes in all three ways.

    Args:
        count: scenes.
        seed: scene n is drawn from (seed, n).
        notice: told the progress.
    """
    outcomes: dict[Way, Counter[str]] = {way: Counter() for way in WAYS}
    late: dict[Way, list[int]] = {way: [] for way in WAYS}
    times: dict[Way, list[float]] = {way: [] for way in WAYS}
    touched, executed = [], 0
    for n in range(count):
        notice("scenes", n / count)
        scene, side = random_scene(np.random.default_rng((seed, n)))
        moving_map = build_moving_map(scene, side)
        start, goal = moving_map.cell_at(scene.task.start_cm), moving_map.cell_at(scene.task.goal_cm)
        exact = search_space_time(moving_map, start, goal)
        outcomes["exact"][exact.status.value] += 1
        times["exact"].append(1e3 * exact.search_s)
        if exact.path is not None:
            late["exact"].append(0)
            executed += 1
            if not is_clear(scene, moving_map, exact.path):
                touched.append(n)
        for rule in ("plain", "modified"):
            run = run_rule(rule, moving_map, start, goal)
            outcomes[rule][run.outcome] += 1
            times[rule].append(1e3 * run.run_s)
            if run.outcome == "reached" and run.path is not None and exact.path is not None:
                late[rule].append(run.path.arrival - exact.path.arrival)
    notice("scenes", 1.0)
    tallies = tuple(Tally(way, dict(outcomes[way]), tuple(late[way]), tuple(times[way])) for way in WAYS)
    return RandomMoving(count, seed, tallies, executed, tuple(touched))


def random_scene(rng: Generator) -> tuple[Scene, ElbowSide]:
    """Return a scene whose start and goal are free at time 0 on the elbow side that is told."""
    first = load_scene(example_file("moving_env1.toml"))
    side: ElbowSide = "up" if rng.random() < 0.5 else "down"
    spec = replace(moving_spec(first), samples=SAMPLES)
    base = replace(
        first,
        arm=replace(first.arm, elbow=side),
        workspace=replace(first.workspace, cell_cm=CELL_CM),
        moving=spec,
    )
    while True:
        obstacles = tuple(_obstacle(rng, spec.sample_s) for _ in range(int(rng.integers(2, 6))))
        scene = replace(base, obstacles=obstacles, task=TaskSpec(_point(rng), _point(rng)))
        still = replace(scene, moving=replace(spec, samples=1))
        moving_map = build_moving_map(still, side, between=False)
        ends = [moving_map.cell_at(point) for point in (scene.task.start_cm, scene.task.goal_cm)]
        nodes = moving_map.nodes(0).ravel()
        if ends[0] != ends[1] and all(nodes[end] for end in ends):
            return scene, side


def _point(rng: Generator) -> tuple[float, float]:
    """Return a node in the annulus, in the upper half, where joint 1 need not turn across its limits."""
    radius, angle = rng.uniform(74.0, 97.0), rng.uniform(0.15, 0.85) * np.pi
    x, y = (CELL_CM * round(float(radius * f(angle)) / CELL_CM) for f in (np.cos, np.sin))
    return x, y


def _obstacle(rng: Generator, sample_s: float) -> Obstacle:
    """Return a disc or a square that moves straight, in a square, or along a polyline, or rests."""
    radius, angle = rng.uniform(30.0, 115.0), rng.uniform(0.0, 1.0) * np.pi
    center = float(radius * np.cos(angle)), float(radius * np.sin(angle))
    shape: Literal["circle", "square"] = "circle" if rng.random() < 0.7 else "square"
    return Obstacle(shape, center, float(rng.uniform(6.0, 16.0)), motion=_motion(rng, sample_s))


def _motion(rng: Generator, sample_s: float) -> ObstacleMotion | None:
    kind = rng.integers(0, 8)
    if kind == 0:
        return None
    if kind <= 2:
        side, leg_s = float(rng.uniform(8.0, 30.0)), sample_s * int(rng.integers(6, 20))
        corners = ((0.0, 0.0), (side, 0.0), (side, side), (0.0, side), (0.0, 0.0))
        return ObstacleMotion(tuple(leg_s * i for i in range(5)), corners, True)
    legs = int(rng.integers(1, 4))
    times = sample_s * np.cumsum(rng.integers(8, 30, legs))
    places = np.cumsum(rng.uniform(-35.0, 35.0, (legs, 2)), axis=0)
    return ObstacleMotion(
        (0.0, *(float(t) for t in times)), ((0.0, 0.0), *((float(x), float(y)) for x, y in places)), False
    )


def is_clear(scene: Scene, moving_map: MovingMap, path: TimedPath) -> bool:
    """Tell whether a plan's motion is proved, and touches nothing when it is looked at again pose by pose."""
    arm, clock = Arm.from_spec(scene.arm), moving_map.clock
    spline = from_nodes(arm, path, clock.sample_s)
    if judge(scene, moving_map, spline).problem:
        return False
    times = np.arange(0.0, clock.samples * clock.sample_s, LOOK_S)
    q_rad = spline.evaluate(np.minimum(times, spline.borders_s[-1]), "left").q_rad
    touches = first_touches(moving_set(scene, float(times[-1])), times, forward(arm, q_rad), scene.margin_cm)
    return bool((touches[:, 0] < 0).all())


def tables(result: RandomMoving) -> tuple[TextTable, ...]:
    """Return what became of each way."""
    rows = []
    for tally in result.tallies:
        reached = tally.outcomes.get("reached", 0) + tally.outcomes.get("found", 0)
        contacts, proved = tally.outcomes.get("contact", 0), tally.outcomes.get("impossible", 0)
        goal = tally.outcomes.get("goal taken", 0)
        rest = result.scenes - reached - contacts - proved - goal
        late = number(fmean(tally.late_samples), 2) if tally.late_samples else "none"
        counts = (f"{reached} ({100.0 * reached / result.scenes:.1f} %)", contacts, rest, proved, goal)
        rows.append((tally.way, *map(str, counts), late, number(median(tally.times_ms), 2)))
    header = ("way", "reached", "contact", "gave up", "proved none", "goal taken", "late", "ms")
    return (TextTable(f"{result.scenes} random scenes, seed {result.seed}", header, tuple(rows), 1),)


def findings(result: RandomMoving) -> tuple[str, ...]:
    """Say what the counts mean."""
    return (
        f"{result.executed} plans of the exact search were judged as motions and looked at again every {LOOK_S:g} s: "
        + (f"scenes {result.touched} touched something." if result.touched else "none touches anything."),
        "'proved none' is the exact search's proof that no motion on the grid arrives within the horizon; 'goal taken' "
        "that an obstacle is at the goal at its end, or, by a rule, that the arm got there and is touched as it rests. "
        "'late' is the mean of the samples after the exact arrival, of runs that reached the goal and can stay.",
    )
