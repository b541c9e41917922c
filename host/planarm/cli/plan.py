"""`planarm plan SCENE -o FILE.plan`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from planarm.cli.progress import progress
from planarm.cli.scenes import chosen_scene, tell_first_compile


def execute(options: argparse.Namespace) -> int:
    """Plan, certify and write; a red certificate is written too, and told by the exit code."""
    scene = chosen_scene(options)
    tell_first_compile("planarm")
    from planarm.errors import CertificateError
    from planarm.output import require_place
    from planarm.pipeline import plan_scene, stored
    from planarm.plan_file import save_plan
    from planarm.warm_up import warm_up

    target = Path(options.output)
    require_place(target)
    with progress(options.json) as notice:
        notice("kernels", 0.0)
        warm_up()
        notice("kernels", 1.0)
        plan = plan_scene(scene, notice)
    save_plan(stored(plan), target)
    if not plan.certificate.ok:
        raise CertificateError(f"{target}: {plan.certificate.explain()}")
    told = {
        "plan": str(target),
        "path_length_cm": plan.path.length_cm,
        **plan.timing.figures(),
        "segments": len(plan.segments.segments),
        "plan_ms": plan.plan_ms,
    }
    if options.json:
        print(json.dumps(told))
    else:
        print(f"{target}: {plan.path.length_cm:.4f} cm in {plan.trajectory.duration_s:.3f} s")
        print(plan.timing.words())
    return 0
