"""From a path of the tip to a smooth path: corners blended or stops, through full stretch where it has to be."""

from planarm.errors import NoPathError, TimingError
from planarm.model.arm import Arm
from planarm.search.path import Path
from planarm.smoothing.blend import DEFAULT_TOLERANCE_CM, bends_everywhere, blend_corners, stretched_place, way_points
from planarm.smoothing.smooth_path import SmoothPath
from planarm.smoothing.stretched import follow_stretched
from planarm.workspace.free_map import FreeMap
from planarm.workspace.joint_proof import JointWorld


def smooth_path(
    path: Path,
    free_map: FreeMap,
    arm: Arm,
    world: JointWorld,
    tolerance_cm: float = DEFAULT_TOLERANCE_CM,
    *,
    stop: bool = False,
) -> SmoothPath:
    """Return the path with corners rounded within the tolerance, or with a stop at each.

    A path whose elbow stays bent is one of the tip. One that meets full stretch or full fold is followed in joint
    space, the tip within the tolerance.

    Args:
        path: way-points of the tip, with straight moves between them that are free.
        free_map: where the tip may be; its margin is kept.
        arm: the arm, with two links.
        world: the same arm and obstacles for proofs in joint space, with the same margin.
        tolerance_cm: largest distance of the tip from the straight moves.
        stop: True to stop at every corner.

    Raises:
        TimingError: the path meets full stretch or fold, and no motion near it can be proved free.
    """
    smooth = blend_corners(path, free_map, None if stop else tolerance_cm)
    if bends_everywhere(smooth):
        return smooth
    try:
        points_cm = way_points(path.points_cm)
        return follow_stretched(points_cm, free_map.elbow, arm, world, tolerance_cm, stop=stop)
    except NoPathError as problem:
        raise TimingError(
            f"the elbow comes to full stretch or full fold at {stretched_place(smooth)}, and no motion in joint space "
            f"within {tolerance_cm:g} cm of the path is proved free: {problem}; widen motion.tolerance_cm, narrow "
            "arm.joint_limits_deg[2], or move the task's points"
        ) from problem
