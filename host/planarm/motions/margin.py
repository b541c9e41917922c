"""The margin that plans keep from obstacles."""

from planarm.model.arm import Arm
from planarm.routes.gentle import ROOM_CM, jerk_limits
from planarm.scene import Scene
from planarm.stepping.quantise import quantisation_bound_cm


def planning_margin_cm(scene: Scene) -> float:
    """Return the margin that plans keep: the scene's, and half a micro-step in every joint (docs/decisions/0005).

    With a limit of jerk there is room for what the motion then cuts (docs/decisions/0087).
    """
    steps_cm = quantisation_bound_cm(Arm.from_spec(scene.arm), scene.joints, scene.coupling)
    return scene.margin_cm + steps_cm + (0.0 if jerk_limits(scene) is None else ROOM_CM)
