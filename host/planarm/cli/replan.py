"""`planarm replan SCENE`: carry a scene out while obstacles may appear, and plan again when one does."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import perf_counter
from typing import Any

from planarm.cli.progress import progress
from planarm.cli.scenes import chosen_scene, tell_first_compile
from planarm.cli.terminal import terminal
from planarm.errors import NoPathError, SceneError, UsageError


def execute(options: argparse.Namespace) -> int:
    """Plan, stream, watch; print what came and what was done."""
    if (options.arrivals is None) == (options.watch is None):
        raise UsageError("give --arrivals FILE or --watch FILE")
    scene = chosen_scene(options)
    if not scene.planner.on_roadmap:
        raise SceneError(scene.source, "planner.algorithm", "planning again takes a planner on a roadmap")
    tell_first_compile("planarm", "planarm_sim")
    from contextlib import closing

    from planarm.link.arm_record import ArmSetup
    from planarm.link.positions import Positions, default_path
    from planarm.link.transport import open_transport, require_port
    from planarm.operations.arrivals import Listed, Watched
    from planarm.operations.replanning import first_plan, run_live
    from planarm.scene.arrivals import load_arrivals
    from planarm.streaming.standing import prepare
    from planarm.warm_up import warm_up

    port = scene.link.port if options.port is None else options.port
    require_port(port, scene.board)
    source = Watched(Path(options.watch)) if options.watch else Listed(load_arrivals(Path(options.arrivals)))
    with progress(options.json) as notice:
        notice("kernels", 0.0)
        warm_up(on_roadmap=True, replanning=True)
        notice("kernels", 1.0)
        first = first_plan(scene, notice)
        start = first[1].segments.start_usteps
        with closing(open_transport(port, scene.link.baud, ArmSetup(scene, start))) as transport:
            prepare(transport, port, scene, Positions(default_path()), start)
            result = run_live(scene, transport, source, notice, perf_counter, first, warn=notice.warn)
    told = result.figures()
    if not options.json:
        _print(told)
    elif result.reached:
        print(json.dumps(told))
    if not result.reached:
        error = NoPathError(result.reason)
        error.fields = told
        raise error
    return 0


def _print(told: dict[str, Any]) -> None:
    console = terminal()
    for one in told["encounters"]:
        console.print(
            f"{one['at_s']:.3f} s: {one['obstacle']}: {one['verdict']}; {one['closed_edges']} edges closed, "
            f"{one['repair_ms']:.2f} ms" + (f"; stopped: {because}" if (because := one["stopped_because"]) else ""),
            highlight=False,
        )
    for one in told["new_plans"]:
        console.print(_made(one), highlight=False)
    console.print("goal reached" if told["reached"] else f"stopped: {told['reason']}", highlight=False)


def _made(new: dict[str, Any]) -> str:
    """Say how a new plan came about."""
    if new["spliced_at_s"] is None:
        return f"at rest after {new['rest_s']:.3f} s, certified {new['plan_ms']:.0f} ms later"
    return (
        f"certified after {new['plan_ms']:.0f} ms; left the motion at {new['spliced_at_s']:.3f} s of it, without a stop"
    )
