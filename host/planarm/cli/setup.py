"""`planarm setup FILE`: asks for an arm, tries its joints when a port is given, and writes its scene."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING

from planarm.cli.scenes import tell_first_compile
from planarm.errors import UsageError
from planarm.output import require_place, writing

if TYPE_CHECKING:
    from planarm.bringup.nudge import Mover
    from planarm.scene import Scene
    from planarm.stepping.certificate import Certificate
    from planarm.stepping.plan import SegmentPlan

STRETCHED_DEG = (90.0, -45.0, -30.0, -30.0)
"""Where the arm should stand when its joints are tried; only the turning counts."""


class Terminal:
    """A person at a terminal: questions on stderr, so that stdout stays for results."""

    def ask(self, question: str, default: str) -> str:
        """Ask on the terminal; an empty answer is the default."""
        shown = f" [{default}]" if default else ""
        print(f"{question}{shown}: ", end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if not line:
            raise UsageError("the dialogue ended before its last question; answer them all, or write the scene by hand")
        return line.strip() or default

    def tell(self, text: str) -> None:
        """Say it on the terminal."""
        print(text, file=sys.stderr, flush=True)


def execute(options: argparse.Namespace) -> int:
    """Ask, try the joints, write the file."""
    target = Path(options.file)
    require_place(target)
    if target.exists() and not options.force:
        raise UsageError(f"{target}: is there already; give another name, or --force to write over it")
    if options.port:
        tell_first_compile("planarm", "planarm_sim")
    from planarm.bringup.arm_answers import scene_text
    from planarm.bringup.setup import ask_arm, remarks_of, try_joints

    person = Terminal()
    arm = ask_arm(person, target.stem, options.port or "sim://")
    if options.port:
        stretched_deg = STRETCHED_DEG[: arm.links]
        angles = ", ".join(f"{angle:g}" for angle in stretched_deg)
        person.ask(f"Bring the joints to about ({angles}) degrees, with room all around; Enter goes on", "")
        with moving(arm.scene(), options.port, tuple(radians(angle) for angle in stretched_deg)) as mover:
            arm = try_joints(person, arm, mover)
    with writing(target):
        target.write_text(scene_text(arm), encoding="utf-8")
    remarks = remarks_of(arm)
    if options.json:
        print(json.dumps({"scene": str(target), "remarks": remarks}))
    else:
        print(*remarks, f"{target}: written; 'planarm run {target}' moves it", sep="\n")
    return 0


@contextmanager
def moving(scene: Scene, port: str, q_rad: tuple[float, ...]) -> Iterator[Mover]:
    """Give what moves the arm at a port, which is thought to stand at `q_rad`."""
    import numpy as np

    from planarm.bringup.nudge import Mover
    from planarm.link.arm_record import ArmSetup
    from planarm.link.positions import Positions, default_path
    from planarm.link.transport import open_transport
    from planarm.model.transmission import Transmission
    from planarm.streaming.plan_stream import options_for, stream
    from planarm.streaming.standing import prepare

    usteps = np.floor(Transmission.of(scene).usteps(np.array(q_rad)) + 0.5)
    setup = ArmSetup(scene, tuple(int(n) for n in usteps))
    with closing(open_transport(port, scene.link.baud, setup)) as line:
        prepare(line, port, scene, Positions(default_path()), setup.start_usteps)

        def carry_out(plan: SegmentPlan, certificate: Certificate) -> None:
            stream(plan, certificate, line, None, options_for(scene, plan, known=False))

        yield Mover(carry_out, q_rad)
