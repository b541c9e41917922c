"""`planarm home SCENE`: every joint to its limit switch; `--prove` tells the steps lost since."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from planarm.cli.arm import reached, tell_standing
from planarm.cli.progress import progress
from planarm.errors import StepsDifferError

if TYPE_CHECKING:
    from planarm.operations.homing import Homed


def execute(options: argparse.Namespace) -> int:
    """Home, or prove the steps since homing; tell where the arm stands then."""
    from planarm.operations.homing import home, prove_steps

    act = prove_steps if options.prove else home
    with progress(options.json) as notice, reached(options) as arm:
        homed = act(arm.transport, arm.port, arm.scene, arm.positions, notice.warn)
    if options.prove and not options.json:
        _tell(homed)
    stands = homed.inside_usteps or (homed.kept_usteps if options.prove else homed.usteps)
    told = {} if options.prove and not options.json else _figures(homed)  # else told already, in sentences
    tell_standing(options.json, arm.scene, stands, "homed", **told)
    return StepsDifferError.exit_code if options.prove and any(homed.lost_usteps or ()) else 0


def _figures(homed: Homed) -> dict[str, Any]:
    """What the touches told; nothing of losses where the count was not known before."""
    if homed.lost_usteps is None:
        return {}
    return {
        "lost_usteps": list(homed.lost_usteps),
        "counted_usteps": [touch.counted_usteps for touch in homed.touched],
        "switch_usteps": [touch.switch_usteps for touch in homed.touched],
        "switch_play_usteps": [touch.play_usteps for touch in homed.touched],
    }


def _tell(homed: Homed) -> None:
    for touch in homed.touched:
        lost = f"{touch.lost_usteps:+d} micro-steps lost" if touch.lost_usteps else "no step lost"
        where = f"counted {touch.counted_usteps} at the switch, which is at {touch.switch_usteps}"
        print(f"joint {touch.joint}: {lost} ({where}; it repeats within {abs(touch.play_usteps)})")
        if touch.play_usteps and 4 * abs(touch.play_usteps) >= touch.field_usteps:
            print("  the switch repeats by no better than a full step, so this may be a turn of the field off; mend it")
