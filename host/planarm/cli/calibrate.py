"""`planarm calibrate SCENE [POINTS]`: link lengths and zero angles from points that the tip has touched."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from planarm.cli.scenes import tell_first_compile
from planarm.cli.setup import Terminal, moving
from planarm.errors import UsageError
from planarm.output import require_place, writing
from planarm.scene import load_scene, parse_scene

if TYPE_CHECKING:
    from planarm.bringup.calibrate import Calibration, TouchedPoint
    from planarm.scene import Scene

POINTS_A_LINK = 2


def execute(options: argparse.Namespace) -> int:
    """Read or touch the points, fit, tell, and write the scene anew."""
    from planarm.bringup.calibrate import calibrate, calibrated_text, read_points

    scene = load_scene(options.scene)
    if options.output:
        require_place(Path(options.output))
    if (options.points is None) == (options.port is None):
        raise UsageError("give a file of touched points, or --port to touch some now; not both")
    points = read_points(Path(options.points), len(scene.joints)) if options.points else _touch(scene, options)
    found = calibrate(scene, points)
    if options.output:
        text = calibrated_text(Path(options.scene).read_text(encoding="utf-8"), found)
        parse_scene(text, options.output)  # what is written can be read again
        with writing(Path(options.output)):
            Path(options.output).write_text(text, encoding="utf-8")
    _tell(options, found)
    return 0


def _touch(scene: Scene, options: argparse.Namespace) -> list[TouchedPoint]:
    tell_first_compile("planarm", "planarm_sim")
    from planarm.bringup.calibrate import MORE_POINTS
    from planarm.bringup.guided import touch_points, touching_poses

    person = Terminal()
    count = options.count or POINTS_A_LINK * len(scene.joints) + MORE_POINTS
    first = touching_poses(scene, count)[0]
    angles = ", ".join(f"{angle:.1f}" for angle in np.degrees(first))
    person.ask(f"Bring the joints to about ({angles}) degrees; Enter goes on", "")
    with moving(scene, options.port, tuple(map(float, first))) as mover:
        return touch_points(person, scene, mover, count)


def _tell(options: argparse.Namespace, found: Calibration) -> None:
    told = {
        "link_lengths_cm": [round(length, 6) for length in found.link_lengths_cm],
        "link_lengths_std_cm": [round(std, 6) for std in found.lengths_std_cm],
        "zero_offsets_deg": [round(float(zero), 6) for zero in np.degrees(found.zero_offsets_rad)],
        "zero_offsets_std_deg": [round(float(std), 6) for std in np.degrees(found.zeros_std_rad)],
        "rms_mm": round(found.rms_mm, 6),
        "residuals_mm": [round(residual, 6) for residual in found.residuals_mm],
        "scene": options.output,
    }
    if options.json:
        print(json.dumps(told))
        return
    for number, (length, std) in enumerate(zip(found.link_lengths_cm, found.lengths_std_cm, strict=True), start=1):
        zero, zero_std = np.degrees(found.zero_offsets_rad[number - 1]), np.degrees(found.zeros_std_rad[number - 1])
        print(f"link {number}: {length:.3f} +- {std:.3f} cm, zero of joint {number} {zero:+.3f} +- {zero_std:.3f} deg")
    print(found.explain())
    if options.output:
        print(f"{options.output}: written")
