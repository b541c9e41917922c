"""The scene's table [motion]."""

from planarm.scene.strict_toml import Table
from planarm.scene.types import Corners, MotionSpec

MOTION_KEYS = ("corners", "tolerance_cm", "acceleration_share", "torque_share")
CORNERS: tuple[Corners, ...] = ("blend", "stop")
SMALLEST_TOLERANCE_CM = 1e-3
LARGEST_TOLERANCE_CM = 100.0
SMALLEST_SHARE = 0.05


def read_motion(table: Table) -> MotionSpec:
    """Return the table's values; every key has a default."""
    default = MotionSpec()
    return MotionSpec(
        corners=table.choice("corners", CORNERS, default.corners),
        tolerance_cm=table.number(
            "tolerance_cm", default.tolerance_cm, at_least=SMALLEST_TOLERANCE_CM, at_most=LARGEST_TOLERANCE_CM
        ),
        acceleration_share=table.number(
            "acceleration_share", default.acceleration_share, at_least=SMALLEST_SHARE, at_most=1.0
        ),
        torque_share=table.number("torque_share", default.torque_share, at_least=SMALLEST_SHARE, at_most=1.0),
    )
