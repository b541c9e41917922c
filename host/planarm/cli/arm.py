"""What `zero`, `home`, `jog`, `goto`, `status` and `stop` share: the scene, the line, and how a position is told."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from planarm.errors import UsageError

if TYPE_CHECKING:
    from planarm.link.positions import Positions
    from planarm.link.transport import Transport
    from planarm.scene import Scene


NOT_KNOWN = (
    "the board does not know where its arm stands: it was told nothing since it started, or has lost it since: it was"
    " stopped in an emergency, or its drivers were released and the arm falls without; it is moved without soft"
    " limits"
)


@dataclass(frozen=True, slots=True)
class Reached:
    """An arm that a command can talk to."""

    scene: Scene
    port: str
    transport: Transport
    positions: Positions


@contextmanager
def reached(options: argparse.Namespace) -> Iterator[Reached]:
    """Open the line to the scene's arm."""
    from planarm.link.positions import Positions, default_path
    from planarm.link.transport import open_transport
    from planarm.scene import load_scene

    scene = load_scene(Path(options.scene))
    port = scene.link.port if options.port is None else options.port
    with closing(open_transport(port, scene.link.baud, board=scene.board)) as transport:
        yield Reached(scene, port, transport, Positions(default_path()))


def pose_rad(scene: Scene, angles_deg: Sequence[float]) -> NDArray[np.float64]:
    """Return joint angles as they are given to --deg.

    Raises:
        UsageError: they are not one a joint.
    """
    if len(angles_deg) != len(scene.joints):
        raise UsageError(f"--deg: {len(angles_deg)} angles given, one a joint expected, {len(scene.joints)}")
    return np.radians(np.array(angles_deg, np.float64))


def tell_standing(as_json: bool, scene: Scene, usteps: tuple[int, ...], how: str | None, **more: Any) -> None:  # noqa: ANN401 - figures
    """Print where the arm stands, and by what that is known."""
    from planarm.streaming.standing import pose_of

    q_rad, tip_cm = pose_of(scene, usteps)
    told = {
        "known_by": how,
        "usteps": list(usteps),
        "joints_deg": [round(float(angle), 4) for angle in np.degrees(q_rad)],
        "tip_cm": [round(tip_cm[0], 4), round(tip_cm[1], 4)],
        **more,
    }
    if as_json:
        print(json.dumps(told))
        return
    if how is None:
        print(NOT_KNOWN)
    for name, value in told.items():
        print(f"{name}: {value}")
