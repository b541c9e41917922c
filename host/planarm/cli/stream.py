"""`planarm stream FILE.plan --port URL`."""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from pathlib import Path

from planarm.cli.progress import progress
from planarm.cli.scenes import require_file, tell_first_compile
from planarm.errors import PlanFileError


def execute(options: argparse.Namespace) -> int:
    """Stream a certified plan and tell what the device executed."""
    require_file(options.plan, PlanFileError, "make a plan with 'planarm plan'")
    tell_first_compile("planarm", "planarm_sim")
    from planarm.link.position import moved_usteps
    from planarm.link.positions import Positions, default_path
    from planarm.link.transport import open_transport
    from planarm.plan_file import load_plan, require_arm
    from planarm.run_folder.folder import begin_run_folder
    from planarm.scene import load_scene
    from planarm.scene.rebuild import scene_from_mapping
    from planarm.streaming.plan_stream import options_for, record, stream, telling, warn_before
    from planarm.streaming.standing import settle_start

    plan = load_plan(Path(options.plan))
    if options.arm is not None:
        require_arm(plan, load_scene(Path(options.arm)), options.plan)
    scene = scene_from_mapping(plan.scene)
    port = scene.link.port if options.port is None else options.port
    out = Path(options.out) if options.out else Path("out") / Path(options.plan).stem
    begin_run_folder(out, plan)
    with (
        progress(options.json) as notice,
        closing(open_transport(port, scene.link.baud, board=scene.board)) as transport,
    ):
        positions = Positions(default_path())
        line = record(transport, out, port, scene)
        settle_start(line, port, scene, plan.segments.start_usteps, positions, vouched=options.at_start)
        warn_before(scene, plan.segments, notice.warn)
        watch, how = telling(notice, notice.watch), options_for(scene, plan.segments)
        result = stream(plan.segments, plan.certificate, line, watch, how, warn=notice.warn)
    moved = moved_usteps(result.ledger_before, result.ledger_after)[: len(scene.joints)]
    told = {"moved_usteps": list(moved), "retransmissions": result.retransmissions, "run": str(out)}
    print(json.dumps(told) if options.json else f"executed {told['moved_usteps']} micro-steps")
    return 0
