"""`planarm envelope SCENE`: maps of the workspace, the goal on the micro-step lattice, largest payload and feed."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, replace
from itertools import count
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planarm.cli.progress import progress
from planarm.cli.scenes import chosen_scene, compile_first
from planarm.cli.terminal import terminal
from planarm.notice import silent
from planarm.output import require_folder_place, writing

if TYPE_CHECKING:
    from planarm.envelope.largest import Certify
    from planarm.envelope.maps import EnvelopeMaps
    from planarm.model.kinematics import ElbowSide
    from planarm.scene import Scene
    from planarm.stepping.certificate import Certificate

NAMES = ("tip_error_mm", "hz_per_cm_s", "largest_cm_s", "manipulability_cm2")


def execute(options: argparse.Namespace) -> int:
    """Compute, write maps, print figures."""
    import numpy as np

    scene = chosen_scene(options)
    out = Path(options.out or Path("out") / f"{Path(scene.source).stem}-envelope")
    require_folder_place(out)
    compile_first("planarm")
    from planarm.envelope.largest import MOST_TRIALS, largest_feed, largest_payload_kg
    from planarm.envelope.maps import envelope_maps
    from planarm.envelope.snap import snap
    from planarm.pipeline import plan_scene
    from planarm.warm_up import warm_up

    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
    side: ElbowSide = "down" if scene.arm.elbow == "down" else "up"
    with progress(options.json) as notice:
        notice("maps", 0.0)
        maps = envelope_maps(scene, side)
        notice("maps", 1.0)
    told: dict[str, Any] = {"scene": scene.name, "elbow": side}
    for name in NAMES:
        values = getattr(maps, name)
        finite = values[np.isfinite(values)]
        told[name] = {"least": float(finite.min()), "median": float(np.median(finite)), "most": float(finite.max())}
    told["goal"] = asdict(snap(scene, scene.task.goal_cm, side))
    if not options.maps_only:
        # The planner as the scene has it, but not for time: a bisection needs the same answer twice.
        one = replace(scene, planner=replace(scene.planner, objective="length"))

        with progress(options.json) as notice:
            notice("kernels", 0.0)
            warm_up(on_roadmap=scene.planner.on_roadmap, moving=scene.moving is not None)
            notice("kernels", 1.0)

            def certify_at(stage: str) -> Certify:
                """Return what plans a scene for one bisection, and tells how many of the most trials are done."""
                trial = count()

                def certify(changed: Scene) -> Certificate:
                    notice(stage, next(trial) / MOST_TRIALS)
                    return plan_scene(changed, silent).certificate

                return certify

            told["payload_kg"] = asdict(largest_payload_kg(one, certify_at("payload")))
            notice("payload", 1.0)
            told["feed"] = asdict(largest_feed(one, certify_at("feed")))
            notice("feed", 1.0)
    _write(out, scene, maps, told)
    if options.json:
        print(json.dumps(told, default=float).replace("Infinity", "null"))
    else:
        from planarm.report import summary_table

        terminal().print(summary_table(told))
        terminal().print(f"maps: {out}", markup=False)
    return 0


def _number(value: float) -> float | None:
    """Return a number that JSON can hold: nothing in the place of NaN."""
    return round(value, 6) if isfinite(value) else None


def _write(out: Path, scene: Scene, maps: EnvelopeMaps, told: dict[str, Any]) -> None:
    """Write envelope.json, with every cell, and envelope.png."""
    from planarm.report.envelope import draw_envelope

    cells = {name: [[_number(v) for v in row] for row in getattr(maps, name).tolist()] for name in NAMES}
    body = {**told, "x_cm": maps.x_cm.tolist(), "y_cm": maps.y_cm.tolist(), "cells": cells}
    with writing(out):
        (out / "envelope.json").write_text(json.dumps(body, default=float).replace("Infinity", "null") + "\n", "utf-8")
        draw_envelope(out / "envelope.png", maps, scene.name, scene.arm.base_cm)
