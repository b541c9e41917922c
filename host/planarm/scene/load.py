"""Reading a scene file into a Scene: the keys of every table, their limits and their defaults."""

import tomllib
from dataclasses import replace
from math import radians
from pathlib import Path

from planarm.errors import SceneError
from planarm.scene.board import BOARD_KEYS, parse_board, parse_wiring, require_inputs
from planarm.scene.dc_motors import DC_MOTOR_KEYS, parse_dc_motors
from planarm.scene.joint import JointSpec
from planarm.scene.joint_space import JOINT_SPACE_KEYS, JointSpaceSpec, read_joint_space
from planarm.scene.limit_switches import parse_limit_switches
from planarm.scene.mechanics import MECHANICS_KEYS, TRANSMISSION_KEYS, parse_coupling, parse_mechanics
from planarm.scene.motion import MOTION_KEYS, read_motion
from planarm.scene.motor import KEYS as MOTOR_KEYS
from planarm.scene.motor import parse_motor
from planarm.scene.moving import MovingSpec, read_moving, read_obstacle_motion
from planarm.scene.roadmap import ROADMAP_KEYS, parse_roadmap
from planarm.scene.simple_polygon import polygon_problem
from planarm.scene.strict_toml import Table
from planarm.scene.task import TASK_KEYS, Range, TaskLimits, parse_task
from planarm.scene.types import (
    ROADMAP_ALGORITHMS,
    Algorithm,
    ArmSpec,
    Elbow,
    LinkSpec,
    Moves,
    Objective,
    Obstacle,
    PlannerSpec,
    Scene,
    Shape,
    Subset,
    WorkspaceSpec,
)
from planarm_wire.drivers import DRIVERS

ROOT_KEYS = (
    "name",
    "arm",
    "board",
    "workspace",
    "obstacles",
    "task",
    "planner",
    "joints",
    "link",
    "mechanics",
    "transmission",
    "motion",
    "joint_space",
    "limit_switches",
    "roadmap",
    "dc_motors",
    "moving",
)
ARM_KEYS = ("link_lengths_cm", "link_width_cm", "base_cm", "elbow", "joint_limits_deg", "floor")
WORKSPACE_KEYS = ("x_cm", "y_cm", "cell_cm", "clearance_cm")
ROUND_KEYS = ("shape", "center_cm", "diameter_cm", "motion")
POLYGON_KEYS = ("shape", "vertices_cm", "motion")
PLANNER_KEYS = ("algorithm", "neighbours", "subset", "seed", "moves", "objective", "budget_s")
JOINT_KEYS = (
    "steps_per_rev",
    "microsteps",
    "gear_ratio",
    "driver",
    "step_high_us",
    "step_low_us",
    "max_speed_deg_s",
    "max_acceleration_deg_s2",
    "max_jerk_deg_s3",
    "reversed",
    "zero_offset_deg",
    "motor",
)
LINK_KEYS = ("port", "baud")

ELBOWS: tuple[Elbow, ...] = ("up", "down", "either")
SHAPES: tuple[Shape, ...] = ("circle", "square", "diamond", "triangle", "hexagon", "polygon")
SUBSETS: tuple[Subset, ...] = ("run", "expansion")
MOVES: tuple[Moves, ...] = ("proved", "cells", "nodes")
OBJECTIVES: tuple[Objective, ...] = ("length", "joint_travel", "time")
LENGTH_ONLY = ("chaos_a_star", "theta_star", "lazy_theta_star")
"""Algorithms that search by length, whatever else is wanted."""
SET_BY_PINS_ALONE = ("a4988", "drv8825")
"""Drivers that have no micro-steps but their sheet's: a Trinamic's interface and a box's switches set others, too."""
NEIGHBOURS: dict[Algorithm, tuple[int, ...]] = {
    "a_star": (8,),
    "modified_a_star": (24, 48),
    "chaos_a_star": (44, 8, 20, 68),
    "chs": (56, 12, 28, 48, 80),
    "taut": (56, 12, 28, 48, 80),
    "theta_star": (8,),
    "lazy_theta_star": (8,),
    "any_angle": (56, 12, 28, 48, 80),
}
"""The neighbourhoods that each algorithm knows (paper C, sections IV to VII); the first is the default."""

ROADMAP_NEIGHBOURS: dict[Algorithm, tuple[int, ...]] = dict.fromkeys(ROADMAP_ALGORITHMS, (12, 6, 8, 16, 24, 32))
"""How many nearest configurations each node of a roadmap is joined with; the first is the default."""

MOST_LINKS = 8
LARGEST_CM = 10_000.0
SMALLEST_CELL_CM = 0.001
MOST_GRID_NODES = 20_000_000
JOINT_LIMITS_DEG: tuple[Range, ...] = ((-90.0, 270.0), (-180.0, 180.0))
"""Without limits joint 1 may turn once round, from straight down to straight down; the others as the second."""


def load_scene(path: str | Path) -> Scene:
    """Read a scene file.

    Raises:
        SceneError: the file cannot be read, is not TOML, or is not a scene (docs/scene.md).
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as problem:
        raise SceneError(
            str(path), "", f"cannot be read: {problem.strerror}; give the path of a scene file"
        ) from problem
    except UnicodeDecodeError as problem:
        raise SceneError(str(path), "", f"is not UTF-8 text: byte {problem.start} cannot be decoded") from problem
    return parse_scene(text, str(path))


def parse_scene(text: str, source: str) -> Scene:
    """Read a scene from TOML text; `source` names it in errors, and in the scene unless the text gives a name.

    Raises:
        SceneError: the text is not TOML, or is not a scene (docs/scene.md).
    """
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as problem:  # TOMLDecodeError; numbers of 4301 digits; a thousand brackets
        plan = "; it looks like a plan, which 'planarm stream' takes" if text.lstrip().startswith("{") else ""
        raise SceneError(source, "", f"is not valid TOML: {problem}{plan}") from problem
    return scene_from_toml(data, source)


def scene_from_toml(data: dict[str, object], source: str) -> Scene:
    """Read a scene from the tables of a TOML file.

    Raises:
        SceneError: they are no scene (docs/scene.md).
    """
    root = Table.with_keys(source, "", data, ROOT_KEYS)
    workspace = _workspace(root.table("workspace", WORKSPACE_KEYS))
    planner = _planner(root.table("planner", PLANNER_KEYS, optional=True))
    arm = _arm(root.table("arm", ARM_KEYS), planner)
    links = len(arm.link_lengths_cm)
    limits = TaskLimits(
        workspace.x_cm,
        workspace.y_cm,
        LARGEST_CM,
        arm.link_lengths_cm,
        arm.base_cm,
        arm.joint_limits_rad,
        planner.on_roadmap,
    )
    moving = read_moving(root, planner.on_roadmap)
    joints = _joints(root, links)
    coupling = parse_coupling(root.table("transmission", TRANSMISSION_KEYS, optional=True), links)
    board = root.table("board", BOARD_KEYS, optional=True)
    wiring, switches = parse_wiring(board, joints, coupling), parse_limit_switches(root, links)
    require_inputs(root, switches, wiring, links)
    return Scene(
        name=root.text("name", Path(source).stem or source),
        source=source,
        arm=arm,
        workspace=workspace,
        obstacles=tuple(parse_obstacle(source, path, entry, moving) for path, entry in root.tables("obstacles")),
        task=parse_task(root.table("task", TASK_KEYS), limits),
        planner=planner,
        joints=joints,
        link=_link(root.table("link", LINK_KEYS, optional=True)),
        mechanics=parse_mechanics(root.table("mechanics", MECHANICS_KEYS, optional=True), arm.link_lengths_cm),
        coupling=coupling,
        joint_space=read_joint_space(root.table("joint_space", JOINT_SPACE_KEYS), arm.elbow)
        if "joint_space" in data
        else None,
        motion=read_motion(root.table("motion", MOTION_KEYS, optional=True)),
        limit_switches=switches,
        roadmap=parse_roadmap(root.table("roadmap", ROADMAP_KEYS, optional=True)),
        dc_motors=parse_dc_motors(root.table("dc_motors", DC_MOTOR_KEYS, optional=True), links),
        moving=moving,
        wiring=wiring,
        board_spec=parse_board(board),
    )


def with_planner(
    scene: Scene, *, algorithm: str | None = None, neighbours: int | None = None, seed: int | None = None
) -> Scene:
    """Return the scene with another algorithm, neighbourhood or seed; None keeps what the scene says.

    A new algorithm without `neighbours` takes its default neighbourhood.

    Raises:
        SceneError: the algorithm is not known, or has no such neighbourhood, or the seed is negative.
    """
    before = scene.planner
    changed: dict[str, object] = {
        "algorithm": before.algorithm if algorithm is None else algorithm,
        "subset": before.subset,
        "seed": before.seed if seed is None else seed,
        "moves": before.moves,
        "objective": before.objective,
        "budget_s": before.budget_s,
    }
    if neighbours is not None:
        changed["neighbours"] = neighbours
    elif changed["algorithm"] == before.algorithm:
        changed["neighbours"] = before.neighbours
    return replace(scene, planner=_planner(Table(scene.source, "planner", changed)))


def with_space(scene: Scene, space: str | None) -> Scene:
    """Return the scene planned in another space, "tip" or "joint"; None keeps what the scene says."""
    if space == "tip":
        return replace(scene, joint_space=None)
    if space == "joint" and scene.joint_space is None:
        return replace(scene, joint_space=JointSpaceSpec(start_elbow=scene.arm.elbow))
    return scene


def _arm(table: Table, planner: PlannerSpec) -> ArmSpec:
    lengths = table.numbers("link_lengths_cm", above=0.0, at_most=LARGEST_CM)
    if planner.on_roadmap and len(lengths) > MOST_LINKS:
        table.reject("link_lengths_cm", list(lengths), f"1 to {MOST_LINKS} lengths")
    if not planner.on_roadmap and len(lengths) != 2:
        more = f"{', '.join(ROADMAP_ALGORITHMS)} plan 1 to {MOST_LINKS}"
        table.reject("link_lengths_cm", list(lengths), f"2 lengths (planner.algorithm {planner.algorithm!r}; {more})")
    base, on_floor = table.point("base_cm", (0.0, 0.0), within=LARGEST_CM), table.flag("floor", False)
    if on_floor and base[1] < 0.0:
        table.reject("base_cm", list(base), "a base on or above y = 0, because arm.floor is true,")
    return ArmSpec(
        link_lengths_cm=lengths,
        link_width_cm=table.number("link_width_cm", above=0.0, at_most=LARGEST_CM),
        base_cm=base,
        elbow=table.choice("elbow", ELBOWS),
        joint_limits_rad=_joint_limits_rad(table, len(lengths)),
        floor=on_floor,
    )


def _joint_limits_rad(table: Table, joints: int) -> tuple[Range, ...]:
    key = "joint_limits_deg"
    first, other = JOINT_LIMITS_DEG
    limits = table.ranges(key, (first, *(other,) * (joints - 1)), within=720.0)
    if len(limits) != joints:
        table.reject(key, [list(r) for r in limits], f"one [least, greatest] for each of the {joints} joints")
    low1, high1 = limits[0]
    if high1 - low1 > 360.0:
        problem = "a range of at most 360 degrees for joint 1 (a wider one gives a tip position several angles)"
        table.reject(key, [low1, high1], problem)
    for joint, (low, high) in enumerate(limits[1:], 2):
        if low < -180.0 or high > 180.0:
            table.reject(key, [low, high], f"a range within [-180, 180] degrees for joint {joint}")
    return tuple((radians(low), radians(high)) for low, high in limits)


def _workspace(table: Table) -> WorkspaceSpec:
    workspace = WorkspaceSpec(
        x_cm=table.range("x_cm", within=LARGEST_CM),
        y_cm=table.range("y_cm", within=LARGEST_CM),
        cell_cm=table.number("cell_cm", 1.0, at_least=SMALLEST_CELL_CM, at_most=LARGEST_CM),
        clearance_cm=table.number("clearance_cm", 0.0, at_least=0.0, at_most=LARGEST_CM),
    )
    columns, rows = len(workspace.columns), len(workspace.rows)
    grid = f"{workspace.cell_cm:g} gives a grid of {columns} x {rows} nodes"
    if columns * rows > MOST_GRID_NODES:
        table.fail("cell_cm", f"{grid}, {MOST_GRID_NODES} are the most; take larger cells or a smaller workspace")
    if min(columns, rows) < 2:
        table.fail("cell_cm", f"{grid}, 2 x 2 are the least; take smaller cells or a larger workspace")
    return workspace


def parse_obstacle(source: str, path: str, data: object, moving: MovingSpec | None = None) -> Obstacle:
    """Read one obstacle; `path` names it in errors.

    Raises:
        SceneError: it is none.
    """
    entry = Table.with_keys(source, path, data, sorted({*ROUND_KEYS, *POLYGON_KEYS}))
    shape = entry.choice("shape", SHAPES)
    motion = read_obstacle_motion(entry, moving)
    if shape == "polygon":
        table = Table.with_keys(source, path, data, POLYGON_KEYS)
        vertices = table.points("vertices_cm", within=LARGEST_CM)
        problem = polygon_problem(vertices)
        if problem:
            table.fail("vertices_cm", problem)
        return Obstacle(shape, vertices_cm=vertices, motion=motion)
    table = Table.with_keys(source, path, data, ROUND_KEYS)
    return Obstacle(
        shape,
        center_cm=table.point("center_cm", within=LARGEST_CM),
        diameter_cm=table.number("diameter_cm", above=0.0, at_most=LARGEST_CM),
        motion=motion,
    )


def _planner(table: Table) -> PlannerSpec:
    counts = {**NEIGHBOURS, **ROADMAP_NEIGHBOURS}
    algorithm = table.choice("algorithm", tuple(counts), "taut")
    known = counts[algorithm]
    neighbours = table.integer("neighbours", known[0], at_least=1, at_most=1000)
    if neighbours not in known:
        table.reject("neighbours", neighbours, f"one of {', '.join(map(str, sorted(known)))} (algorithm {algorithm!r})")
    objective = table.choice("objective", OBJECTIVES, "length")
    if objective == "joint_travel" and algorithm in LENGTH_ONLY:
        allowed = "'length' or 'time' with this algorithm; a_star, modified_a_star, chs and taut take 'joint_travel'"
        table.reject("objective", objective, allowed)
    return PlannerSpec(
        algorithm=algorithm,
        neighbours=neighbours,
        subset=table.choice("subset", SUBSETS, "run"),
        seed=table.integer("seed", 1, at_least=0, at_most=2**32 - 1),
        moves=table.choice("moves", MOVES, "proved"),
        objective=objective,
        budget_s=table.number("budget_s", 3.0, at_least=0.1, at_most=3600.0),
    )


def _joints(root: Table, links: int) -> tuple[JointSpec, ...]:
    entries = root.tables("joints")
    if len(entries) != links:
        root.fail(
            "joints", f"{len(entries)} given, {links} expected: one [[joints]] table for each link, from the base"
        )
    return tuple(_joint(Table.with_keys(root.source, path, entry, JOINT_KEYS)) for path, entry in entries)


def _joint(table: Table) -> JointSpec:
    jerk = table.number("max_jerk_deg_s3", 0.0, at_least=0.0, at_most=1e9)
    driver = table.choice("driver", tuple(DRIVERS), "a4988")
    microsteps = table.integer("microsteps", 16, at_least=1, at_most=256)
    if driver in SET_BY_PINS_ALONE and microsteps not in DRIVERS[driver].microsteps:
        known = ", ".join(map(str, DRIVERS[driver].microsteps))
        table.reject("microsteps", microsteps, f"one of {known} (driver {driver!r} has no others)")
    return JointSpec(
        steps_per_rev=table.integer("steps_per_rev", 200, at_least=1, at_most=100_000),
        microsteps=microsteps,
        gear_ratio=table.number("gear_ratio", 1.0, above=0.0, at_most=10_000.0),
        driver=driver,
        max_speed_rad_s=radians(table.number("max_speed_deg_s", above=0.0, at_most=1e6)),
        max_acceleration_rad_s2=radians(table.number("max_acceleration_deg_s2", above=0.0, at_most=1e6)),
        reversed=table.flag("reversed", False),
        zero_offset_rad=radians(table.number("zero_offset_deg", 0.0, at_least=-720.0, at_most=720.0)),
        motor=parse_motor(table.table("motor", MOTOR_KEYS, optional=True)),
        max_jerk_rad_s3=radians(jerk) if jerk > 0.0 else None,
        step_high_s=_pulse_s(table, "step_high_us"),
        step_low_s=_pulse_s(table, "step_low_us"),
    )


def _pulse_s(table: Table, key: str) -> float | None:
    value_us = table.number(key, 0.0, at_least=0.0, at_most=1e6)
    return 1e-6 * value_us if value_us > 0.0 else None


def _link(table: Table) -> LinkSpec:
    return LinkSpec(table.text("port", "sim://"), table.integer("baud", 250_000, at_least=1200, at_most=2_000_000))
