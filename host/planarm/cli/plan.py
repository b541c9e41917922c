"""`planarm plan SCENE -o FILE.plan`, or `--alternatives K` to see what there is to choose from."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planarm.cli.progress import progress
from planarm.cli.scenes import chosen_scene, compile_first
from planarm.cli.terminal import terminal
from planarm.errors import UsageError

if TYPE_CHECKING:
    from rich.table import Table

    from planarm.routes.alternatives import Alternative
    from planarm.scene import Scene


def execute(options: argparse.Namespace) -> int:
    """Plan, certify and write; a red certificate is written too, and told by the exit code."""
    if not options.alternatives and not options.output:
        raise UsageError("give -o FILE.plan for a plan, or --alternatives K to see the routes")
    scene = chosen_scene(options)
    if options.alternatives:
        _require_alternatives(scene)
    compile_first("planarm")
    if options.alternatives:
        routes = _alternatives(scene, options)
        if not options.output:
            if options.json:
                print(json.dumps({"routes": routes}))
            return 0
    from planarm.errors import CertificateError
    from planarm.output import require_place
    from planarm.pipeline import plan_scene, stored
    from planarm.plan_file import save_plan
    from planarm.report.tables import certificate_table
    from planarm.warm_up import warm_up

    target = Path(options.output)
    require_place(target)
    with progress(options.json) as notice:
        notice("kernels", 0.0)
        warm_up(on_roadmap=scene.planner.on_roadmap, moving=scene.moving is not None)
        notice("kernels", 1.0)
        plan = plan_scene(scene, notice, advise=True)
        if plan.note:
            notice.warn(plan.note)
    save_plan(stored(plan), target)
    rows = [asdict(check) for check in plan.certificate.checks]
    if not options.json:
        terminal().print(certificate_table(rows))
    if not plan.certificate.ok:
        raise CertificateError(f"{target}: {plan.certificate.explain()}")
    told: dict[str, Any] = {
        "plan": str(target),
        **plan.length_figures(),
        **plan.timing.figures(),
        "segments": len(plan.segments.segments),
        "plan_ms": plan.plan_ms,
        "certificate": rows,
    }
    if plan.moving is not None:
        told["rules"] = [run.figures() for run in plan.moving.rules]
    if options.alternatives:
        told["routes"] = routes
    if options.json:
        print(json.dumps(told))
    else:
        print(f"{target}: {plan.path.length_cm:.4f} cm in {plan.trajectory.duration_s:.3f} s")
        print(plan.timing.words())
        for run in told.get("rules", ()):
            print(f"by the rule, {run['rule']} D*: {run['what']}")
    return 0


def _require_alternatives(scene: Scene) -> None:
    """Check that a scene's routes can be told apart.

    Raises:
        UsageError: they cannot.
    """
    links = len(scene.arm.link_lengths_cm)
    if scene.planner.on_roadmap or links != 2:
        raise UsageError(
            f"--alternatives tells routes of two-link arms apart that are not planned on a roadmap; {scene.source} has"
            f" {links} links and planner.algorithm = {scene.planner.algorithm!r}: leave the option out"
        )


def _alternatives(scene: Scene, options: argparse.Namespace) -> list[dict[str, object]]:
    """Find the routes, print them as a table unless JSON is wanted, and return their figures."""
    from planarm.motions.margin import planning_margin_cm
    from planarm.routes.alternatives import alternatives

    with progress(options.json) as notice:
        notice("routes", 0.0)
        found = alternatives(
            scene, planning_margin_cm(scene), options.alternatives, lambda share: notice("routes", share)
        )
        notice("routes", 1.0)
    if not options.json:
        terminal().print(_table(found, scene.name))
    return [one.fields() for one in found]


def _table(found: Sequence[Alternative], title: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("route", "elbow", "length (cm)", "time (s)", "clearance (cm)"):
        table.add_column(name, justify="left" if name in ("route", "elbow") else "right")
    table.add_column("past obstacle, elbow", overflow="fold")
    for number, one in enumerate(found, start=1):
        elbow = one.elbow[0] if one.elbow[0] == one.elbow[1] else f"{one.elbow[0]} to {one.elbow[1]}"
        time = "none" if one.motion_s is None else f"{one.motion_s:.3f}"
        clearance = "none" if one.clearance_cm is None else f"{one.clearance_cm:.3f}"
        passes = ", ".join(one.passes).replace("obstacles[", "").replace("]", "")
        table.add_row(str(number), elbow, f"{one.path.length_cm:.3f}", time, clearance, passes)
    return table
