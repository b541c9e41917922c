"""What one run does: the kinds of sweeps and campaigns. Each is a function of scene, settings and options alone."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import lru_cache
from typing import Any

import numpy as np

from planarm.campaign.fault_runs import run_faults
from planarm.campaign.line_faults import run_line
from planarm.campaign.task import Figures, SceneText, Value
from planarm.errors import CertificateError, NoPathError, SceneError, TimingError
from planarm.notice import silent
from planarm.pipeline import plan_scene
from planarm.scene import Scene
from planarm.scene.load import scene_from_toml
from planarm.search.grid_search import find_path
from planarm.workspace.free_map import FreeMap, build_free_map
from planarm.workspace.world import FREE, LIMIT, OBSTACLE

Outcome = tuple[str, str, Figures]
"""Verdict, reason, figures."""

OK, NO_PATH, FAILED = "ok", "no path", "failed"


def run_kind(kind: str, scene: SceneText, settings: Mapping[str, Value], options: Mapping[str, Value]) -> Outcome:
    """Carry out one run.

    Raises:
        SceneError: a setting is wrong.
    """
    work: dict[str, Callable[..., Outcome]] = {
        "map": run_map,
        "search": run_search,
        "plan": run_plan,
        "line": run_line_kind,
        "faults": run_faults_kind,
    }
    return work[kind](scene, settings, options)


def run_map(scene: SceneText, settings: Mapping[str, Value], _options: Mapping[str, Value]) -> Outcome:
    """Build the free Cartesian space: how much of it is free, and what forbids the rest."""
    parsed = scene_of(scene, settings)
    began_s = time.perf_counter()
    free_map = build_free_map(parsed, parsed.margin_cm)
    map_ms = 1e3 * (time.perf_counter() - began_s)
    nodes = free_map.region.size
    share = np.bincount(free_map.region.ravel(), minlength=LIMIT + 1) / nodes
    figures: Figures = {
        "nodes": nodes,
        "free_nodes": free_map.free_nodes,
        "free_share": float(share[FREE]),
        "obstacle_share": float(share[OBSTACLE]),
        "limit_share": float(share[LIMIT]),
        "whole_share": float(np.mean(free_map.whole)),
        "map_ms": map_ms,
    }
    return OK, "", figures


def run_search(scene: SceneText, settings: Mapping[str, Value], _options: Mapping[str, Value]) -> Outcome:
    """Search a path on the free map, which runs of the same scene and cell share."""
    parsed = scene_of(scene, settings)
    free_map = _map_of(scene, _frozen({k: v for k, v in settings.items() if not k.startswith("planner.")}))
    found = find_path(free_map, parsed.task.start_cm, parsed.task.goal_cm, parsed.planner)
    figures: Figures = {
        "length_cm": found.path.length_cm if found.path else None,
        "search_ms": 1e3 * found.plan_s,
        "expanded": found.expanded,
    }
    return (OK, "", figures) if found.path else (NO_PATH, found.reason, figures)


def run_plan(scene: SceneText, settings: Mapping[str, Value], _options: Mapping[str, Value]) -> Outcome:
    """Plan, time, quantise, compress and certify."""
    parsed = scene_of(scene, settings)
    try:
        plan = plan_scene(parsed, silent)
    except NoPathError as error:
        return NO_PATH, str(error), {}
    except (TimingError, CertificateError) as error:
        return "not timed", str(error), {}
    figures: Figures = {
        "length_cm": plan.path.length_cm,
        "motion_s": plan.trajectory.duration_s,
        "segments": len(plan.segments.segments),
        "steps": sum(len(joint.ticks) for joint in plan.train.steps),
        "plan_ms": plan.plan_ms,
        "search_ms": plan.search_ms,
    }
    if not plan.certificate.ok:
        return "red", plan.certificate.explain(), figures
    return OK, "", figures


def run_line_kind(scene: SceneText, settings: Mapping[str, Value], options: Mapping[str, Value]) -> Outcome:
    """Play a recorded stream to the emulated board with the line damaged, and judge the pins."""
    return run_line(_recordable(scene, _frozen(settings)), settings, options)


def run_faults_kind(scene: SceneText, settings: Mapping[str, Value], options: Mapping[str, Value]) -> Outcome:
    """Stream live with one mishap, resume, and hold pins and verdicts against each other."""
    return run_faults(_recordable(scene, _frozen(settings)), settings, options)


def scene_of(scene: SceneText, settings: Mapping[str, Value]) -> Scene:
    """Return the scene with the dotted settings put in; words without a dot are the kind's own.

    Raises:
        SceneError: the scene or a setting is wrong.
    """
    data = deepcopy(_tables_of(scene))
    for key, value in settings.items():
        if "." in key:
            _put(data, key, value, scene.source)
    return scene_from_toml(data, scene.source)


def _put(data: dict[str, Any], key: str, value: Value, source: str) -> None:
    *tables, last = key.split(".")
    place: Any = data
    for name in tables:
        if isinstance(place, list):
            if not name.isdigit() or not 1 <= int(name) <= len(place):
                raise SceneError(source, key, f"{name!r} is no entry; there are {len(place)}, counted from 1")
            place = place[int(name) - 1]
        else:
            place = place.setdefault(name, {})
    if not isinstance(place, dict):
        raise SceneError(source, key, f"{tables[-1]!r} is no table")
    place[last] = value


@lru_cache(maxsize=64)
def _tables_of(scene: SceneText) -> dict[str, Any]:
    try:
        return tomllib.loads(scene.text)
    except ValueError as error:
        raise SceneError(scene.source, "", f"is not valid TOML: {error}") from error


def _frozen(settings: Mapping[str, Value]) -> tuple[tuple[str, Any], ...]:
    """Return settings as a key of a cache."""
    return tuple((key, tuple(value) if isinstance(value, list) else value) for key, value in sorted(settings.items()))


@lru_cache(maxsize=4)
def _map_of(scene: SceneText, settings: tuple[tuple[str, Any], ...]) -> FreeMap:
    parsed = scene_of(scene, dict(settings))
    return build_free_map(parsed, parsed.margin_cm)


def _recordable(scene: SceneText, settings: tuple[tuple[str, Any], ...]) -> Scene:
    """Return the scene to record, without what varies from run to run."""
    return scene_of(scene, {key: value for key, value in settings if "." in key})
