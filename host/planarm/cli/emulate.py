"""`planarm emulate`: a flash image on the emulated Uno, behind a virtual serial port."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from planarm.cli.scenes import tell_first_compile
from planarm.errors import DeviceFault, EmulatorError
from planarm.link.released_image import released_image
from planarm.scene import Scene, load_scene
from planarm_wire.boards import Board
from planarm_wire.messages import BOARDS

if TYPE_CHECKING:
    from planarm_sim import Bench, Uno


def execute(options: argparse.Namespace) -> int:
    """Emulate until stopped; the pty's path is printed first, on stderr when --json keeps stdout for the result."""
    tell_first_compile("planarm_sim")
    from planarm_sim.__main__ import summary, watch_of
    from planarm_sim.emulate import emulate
    from planarm_sim.errors import SimError

    scene = load_scene(options.scene) if options.scene else None
    named = options.board or (scene.board.name if scene else "uno")
    around = _arm_around(options, scene, BOARDS[named])
    talk = sys.stderr if options.json else sys.stdout
    try:
        result = emulate(
            options.firmware or released_image(named),
            bootloader=options.bootloader,
            link=options.link,
            watch=watch_of(options),
            speed=options.speed,
            usb=options.usb,
            seconds=options.seconds,
            around=around,
            announce=lambda path: print(path, file=talk, flush=True),
            say=lambda text: print(f"note: {text}", file=sys.stderr, flush=True),
        )
    except SimError as error:
        raise EmulatorError(str(error)) from error
    for warning in result.warnings:
        print(f"note: {warning}", file=sys.stderr)
    print(json.dumps(asdict(result)) if options.json else summary(result))
    return DeviceFault.exit_code if result.program_failed else 0


def _arm_around(options: argparse.Namespace, scene: Scene | None, board: Board) -> Callable[[Uno], Bench] | None:
    """Choose what stands around the board: the scene's arm; else, with our own firmware, a light arm on a desk.

    Raises:
        EmulatorError: --faults, with an image of which nobody said how drivers are wired to it.
    """
    from planarm.link.sim_bench import arm_at_its_start, desk_arm_around

    faults = Path(options.faults) if options.faults else None
    if scene is not None:
        return arm_at_its_start(scene, faults, options.fault_seed)
    if options.firmware is None and not options.bare:
        return desk_arm_around(board, faults, options.fault_seed)
    if faults is not None:
        raise EmulatorError("--faults needs drivers and an arm around the board: give --scene FILE, too")
    return None
