"""`planarm run SCENE`: plan, stream, verify, report."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from planarm.cli.progress import progress
from planarm.cli.scenes import chosen_scene, tell_first_compile
from planarm.cli.terminal import terminal


def execute(options: argparse.Namespace) -> int:
    """Run the whole flow and print its summary."""
    scene = chosen_scene(options)
    tell_first_compile("planarm", "planarm_sim")
    from planarm.pipeline import run_scene
    from planarm.warm_up import warm_up

    out = Path(options.out or Path("out") / f"{Path(scene.source).stem}-{scene.planner.algorithm}")
    with progress(options.json) as notice:
        notice("kernels", 0.0)
        warm_up()
        notice("kernels", 1.0)
        summary = run_scene(scene, scene.link.port if options.port is None else options.port, out, notice)
    if options.json:
        print(json.dumps(summary))
    else:
        _print(summary, out)
    return 0


def _print(summary: dict[str, object], out: Path) -> None:
    from planarm.report import summary_table

    console = terminal()
    console.print(summary_table(summary))
    console.print(f"plan, trace, summary and pictures: {out}", markup=False)  # brackets in names are names
