"""Whether start and goal of a scene can be held by the arm at all; each error says what stands in the way."""

from math import acos, degrees, hypot

from planarm.errors import SceneError
from planarm.scene import Point, Scene
from planarm.workspace.free_map import FreeMap
from planarm.workspace.world import (
    BEYOND_REACH,
    FREE,
    INNER_HOLE,
    ArmWorld,
    TwoLinkArm,
    cos_beta_at,
    elbow_at,
    floor_clearance,
    obstacle_clearance,
    region_at,
    theta1_at,
    theta2_at,
)


def check_task(scene: Scene, free_map: FreeMap) -> None:
    """Check that the poses at start and goal are free, on the map's elbow side and with its margin.

    Raises:
        SceneError: a pose is out of reach, inside the inner hole, outside the joints' limits, too near to an obstacle
            or to the floor. The key is task.start_cm or task.goal_cm.
    """
    for key, point in (("task.start_cm", scene.task.start_cm), ("task.goal_cm", scene.task.goal_cm)):
        problem = pose_problem(scene, free_map.world, point)
        if problem:
            raise SceneError(scene.source, key, f"[{point[0]:g}, {point[1]:g}] {problem}")


def pose_problem(scene: Scene, world: ArmWorld, tip_cm: Point) -> str:
    """Return what forbids the pose with the tip at a point and what to change, or an empty text."""
    arm = world.arm
    x, y = tip_cm
    r = hypot(x - arm.base_x_cm, y - arm.base_y_cm)
    problem = _distance_problem(arm, r)
    if problem:
        return problem
    ex, ey = elbow_at(arm, x, y, r)
    theta1 = theta1_at(arm, x, y, acos(cos_beta_at(arm, r)))
    distance, nearest = obstacle_clearance(world, ex, ey, x, y)
    height = floor_clearance(arm, ey, y)
    keep = (
        f"{arm.margin_cm:.4g} cm are to be kept (half of arm.link_width_cm, workspace.clearance_cm, half a micro-step)"
    )
    if not arm.theta1_min_rad <= theta1 <= arm.theta1_max_rad:
        limits = f"[{degrees(arm.theta1_min_rad):.6g}, {degrees(arm.theta1_max_rad):.6g}]"
        return (
            f"needs joint 1 at {degrees(theta1):.2f} degrees, its limits are {limits}; "
            "move the point, change arm.elbow, or widen arm.joint_limits_deg"
        )
    if distance <= arm.margin_cm:
        obstacle = f"obstacles[{nearest + 1}] ({scene.obstacles[nearest].shape})"
        return f"puts a link's centre line {distance:.3f} cm from {obstacle}, more than {keep}; move one of them"
    if height <= arm.margin_cm:
        return (
            f"puts elbow or tip {height:.3f} cm above the floor y = 0, more than {keep}; "
            "move the point, change arm.elbow, or set arm.floor = false"
        )
    return ""


def _distance_problem(arm: TwoLinkArm, r_cm: float) -> str:
    """Return what forbids the tip's distance from the base, or an empty text."""
    region = region_at(arm, r_cm)
    if region == FREE:
        return ""
    place = f"is {r_cm:.3f} cm from the base"
    if region == BEYOND_REACH:
        return f"{place}, out of reach: the links reach {arm.reach_cm:g} cm (arm.link_lengths_cm); move it nearer"
    if region == INNER_HOLE:
        return (
            f"{place}, inside the inner hole of {arm.r_min_cm:.3f} cm that the links and the limits of joint 2 leave "
            "(arm.link_lengths_cm, arm.joint_limits_deg); move it farther out"
        )
    return (
        f"{place} and needs joint 2 at {degrees(theta2_at(arm, r_cm)):.2f} degrees, its limits end at "
        f"{degrees(theta2_at(arm, arm.r_max_cm)):.2f}, that is {arm.r_max_cm:.3f} cm; "
        "move the point nearer or widen arm.joint_limits_deg"
    )
