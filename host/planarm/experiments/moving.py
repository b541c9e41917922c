"""Paper B's two environments, computed anew: plain D*, the paper's modified D*, the exact search, and the swarm.

The paper gives positions in pictures only; the shipped examples state what is assumed. Samples are the paper's unit of
time: its Ts of 0.01 s and the examples' Ts change every speed alike and no result here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import median
from time import perf_counter
from typing import Final, Literal

import numpy as np

from planarm.errors import SceneError
from planarm.experiments.scenes import example_file
from planarm.model.arm import Arm
from planarm.notice import Notice, silent
from planarm.scene import Scene, load_scene
from planarm.search.moving.rules import Rule, RuleRun, first_contact, run_rule
from planarm.search.moving.space_time import search_space_time
from planarm.search.moving.timed_path import TimedPath
from planarm.smoothing.swarm import PAPER, SwarmResult, SwarmSettings, fly
from planarm.smoothing.timed_spline import delay_margin_s, from_nodes
from planarm.workspace.moving_map import MovingMap, build_moving_map, moving_spec

ENVIRONMENTS: Final = (1, 2)
REPEATS: Final = 7
"""Of which the median time is told, after one that is not counted."""

Way = Literal["plain", "modified", "exact"]


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One way of planning in one environment."""

    way: Way
    outcome: str
    contact: str
    """What touched and when; empty when nothing did."""
    path: TimedPath | None
    """Where the tip was, up to the end or the contact."""
    time_ms: float
    """Search and simulation, warm, the map being there."""


@dataclass(frozen=True, slots=True, eq=False)
class Swarm:
    """A swarm's result."""

    name: str
    settings: SwarmSettings
    result: SwarmResult


@dataclass(frozen=True, slots=True, eq=False)
class Environment:
    """Everything about one environment."""

    number: int
    scene: Scene
    moving_map: MovingMap
    """Of the scene's elbow side, as plans take it."""
    d_star_cm: float
    """Length of D*'s path of the first map."""
    columns: tuple[Column, ...]
    base: TimedPath
    """The path that the swarms start from: the modified rule's run, the exact path where that touches something."""
    swarms: tuple[Swarm, ...]
    map_ms: float
    """The map at the samples, poses included."""
    proof_ms: float
    """What the map between the samples takes besides."""
    delay_margin_s: float
    """Of the exact plan."""


@dataclass(frozen=True, slots=True)
class Moving:
    """The whole comparison."""

    environments: tuple[Environment, ...]
    seed: int


def compare_moving(seed: int = 1, notice: Notice = silent) -> Moving:
    """Compute everything.

    Args:
        seed: of the swarms.
        notice: told the progress.
    """
    found = []
    for number in ENVIRONMENTS:
        notice("compare", (number - 1) / len(ENVIRONMENTS))
        found.append(environment(number, load_scene(example_file(f"moving_env{number}.toml")), seed))
    notice("compare", 1.0)
    return Moving(tuple(found), seed)


def environment(number: int, scene: Scene, seed: int) -> Environment:
    """Compute one environment.

    Raises:
        SceneError: the scene leaves the elbow's side open, or start or goal is no node.
    """
    if scene.arm.elbow == "either":
        raise SceneError(scene.source, "arm.elbow", "'either' stands for two maps: take one for a comparison")
    side = scene.arm.elbow
    moving_map = build_moving_map(scene, side)
    start, goal = moving_map.cell_at(scene.task.start_cm), moving_map.cell_at(scene.task.goal_cm)
    columns = tuple(_by_rule(rule, moving_map, start, goal) for rule in ("plain", "modified"))
    exact = search_space_time(moving_map, start, goal)
    exact_ms = _median_ms(lambda: search_space_time(moving_map, start, goal))
    contact = first_contact(moving_map, exact.path) if exact.path else None
    columns += (Column("exact", exact.status.value, contact.words() if contact else "", exact.path, exact_ms),)
    if exact.path is None:
        raise SceneError(scene.source, "obstacles", "leave no way at all; nothing can be compared")
    base = next(c.path for c in columns[1:] if c.path is not None and not c.contact)
    d_star_cm = d_star_length_cm(scene, moving_map)
    map_ms = _median_ms(lambda: build_moving_map(scene, side, between=False))
    whole_ms = _median_ms(lambda: build_moving_map(scene, side))
    margin = delay_margin_s(moving_map, from_nodes(Arm.from_spec(scene.arm), exact.path, moving_map.clock.sample_s))
    return Environment(
        number=number,
        scene=scene,
        moving_map=moving_map,
        d_star_cm=d_star_cm,
        columns=columns,
        base=base,
        swarms=_swarms(scene, moving_map, base, d_star_cm, seed),
        map_ms=map_ms,
        proof_ms=max(0.0, whole_ms - map_ms),
        delay_margin_s=margin,
    )


def d_star_length_cm(scene: Scene, moving_map: MovingMap) -> float:
    """Return the length of D*'s path of the first map: what is left of the rule when nothing moves."""
    rested = replace(scene, obstacles=tuple(replace(obstacle, motion=None) for obstacle in scene.obstacles))
    still = build_moving_map(
        replace(rested, moving=replace(moving_spec(scene), samples=4 * moving_map.poses.columns)),
        moving_map.elbow,
        between=False,
    )
    run = run_rule("modified", still, still.cell_at(scene.task.start_cm), still.cell_at(scene.task.goal_cm))
    return run.path.length_cm if run.path is not None else float("nan")


def _by_rule(rule: Rule, moving_map: MovingMap, start: int, goal: int) -> Column:
    """Run a rule, several times for its time."""
    runs: list[RuleRun] = [run_rule(rule, moving_map, start, goal) for _ in range(REPEATS + 1)]
    run = runs[0]
    contact = run.contact.words() if run.contact else ""
    return Column(rule, run.outcome, contact, run.path, 1e3 * median(one.run_s for one in runs[1:]))


def _swarms(scene: Scene, moving_map: MovingMap, base: TimedPath, bar_cm: float, seed: int) -> tuple[Swarm, ...]:
    """Fly with the paper's settings, its way, with the default, and with the default within the joints' limits."""
    bare = build_moving_map(scene, moving_map.elbow, limited=False, delay_s=0.0)
    kinds = (
        ("paper", PAPER, bare, False),
        ("default", SwarmSettings(), bare, False),
        ("default, joints limited", SwarmSettings(), moving_map, True),
    )
    return tuple(
        Swarm(
            name,
            settings,
            fly(scene, on, base, np.random.default_rng(seed), settings, limited=limited, bar_cm=bar_cm),
        )
        for name, settings, on, limited in kinds
    )


def _median_ms(work: Callable[[], object]) -> float:
    """Return the median time of a piece of work, warm."""
    times = []
    for _ in range(REPEATS + 1):
        began_s = perf_counter()
        work()
        times.append(1e3 * (perf_counter() - began_s))
    return median(times[1:])
