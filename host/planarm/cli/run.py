"""`planarm run SCENE`: plan, stream, verify, report."""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path

from planarm.cli.live import live_view
from planarm.cli.progress import progress
from planarm.cli.scenes import chosen_scene, compile_first, require_file
from planarm.cli.terminal import terminal
from planarm.errors import EmulatorError, PlanarmError
from planarm.output import require_folder_place


def execute(options: argparse.Namespace) -> int:
    """Run the whole flow and print its summary."""
    scene = chosen_scene(options)
    out = Path(options.out or Path("out") / f"{Path(scene.source).stem}-{scene.planner.algorithm}")
    require_folder_place(out)
    if options.faults:
        require_file(options.faults, EmulatorError, "give the path of a schedule of faults (docs/faults.md)")
    from planarm.link.transport import require_port

    port = scene.link.port if options.port is None else options.port
    require_port(port, scene.board)
    compile_first("planarm", "planarm_sim")
    from planarm.pipeline import run_scene
    from planarm.warm_up import warm_up

    with progress(options.json or options.live == "terminal") as notice:
        notice("kernels", 0.0)
        warm_up(on_roadmap=scene.planner.on_roadmap, moving=scene.moving is not None)
        notice("kernels", 1.0)
        faults = Path(options.faults) if options.faults else None
        try:
            with live_view(options.live) as onlooker:
                summary = run_scene(
                    scene,
                    port,
                    out,
                    notice,
                    faults=faults,
                    fault_seed=options.fault_seed,
                    onlooker=onlooker,
                    watch=notice.watch,
                    warn=notice.warn,
                    at_start=options.at_start,
                )
        except PlanarmError as error:
            if faults is not None:
                error.add_note(f"replay: {replay_line(options)}")
            raise
    if options.json:
        print(json.dumps(summary))
    else:
        _print(summary, out)
    return 0


def replay_line(options: argparse.Namespace) -> str:
    """Return the command that does the same run again: emulated time and seeded faults leave nothing to chance."""
    words = ["planarm", "run", options.scene, "--faults", options.faults]
    for name in ("planner", "neighbours", "seed", "port", "fault_seed"):
        value = getattr(options, name, None)
        if value is not None:
            words += [f"--{name.replace('_', '-')}", str(value)]
    return shlex.join(words)


def _print(summary: dict[str, object], out: Path) -> None:
    from planarm.report import summary_table

    console = terminal()
    console.print(summary_table(summary))
    if "path_note" in summary:
        console.print(f"note: {summary['path_note']}", markup=False)
    console.print(f"report: {out / 'report.html'}; beside it plan, trace, summary and pictures", markup=False)
