"""docs/scene.md speaks of the keys that the loader knows, and its scene is a scene."""

import re
import tomllib
from pathlib import Path

import planarm
from planarm.scene import board, dc_motors, limit_switches, load, moving, parse_scene, roadmap, task

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "scene.md").read_text(encoding="utf-8")

TABLES = {
    "arm": load.ARM_KEYS,
    "board": board.BOARD_KEYS,
    "workspace": load.WORKSPACE_KEYS,
    "obstacles": (*load.ROUND_KEYS, *load.POLYGON_KEYS),
    "task": task.TASK_KEYS,
    "obstacles.motion": moving.OBSTACLE_MOTION_KEYS,
    "planner": load.PLANNER_KEYS,
    "joints": load.JOINT_KEYS,
    "joints.motor": load.MOTOR_KEYS,
    "link": load.LINK_KEYS,
    "mechanics": load.MECHANICS_KEYS,
    "transmission": load.TRANSMISSION_KEYS,
    "motion": load.MOTION_KEYS,
    "joint_space": load.JOINT_SPACE_KEYS,
    "limit_switches": limit_switches.KEYS,
    "roadmap": roadmap.ROADMAP_KEYS,
    "dc_motors": dc_motors.DC_MOTOR_KEYS,
    "moving": moving.MOVING_KEYS,
}


COUNTS = {**load.NEIGHBOURS, **load.ROADMAP_NEIGHBOURS}


def test_every_table_lists_the_keys_that_are_read_and_no_others():
    sections = re.split(r"^#+ .*?`\[+([\w.]+)\]+`$", TEXT, flags=re.M)
    found = dict(zip(sections[1::2], sections[2::2], strict=True))
    assert set(found) == set(TABLES)
    for name, keys in TABLES.items():
        rows = [line.split("|")[1] for line in found[name].splitlines() if line.startswith("| `")]
        listed = {key for row in rows for key in re.findall(r"`(\w+)`", row)} - set(COUNTS)
        listed -= {"joints"} if name == "joints.motor" else set()
        assert listed == set(keys)


def test_the_neighbourhoods_are_listed_with_the_default_first():
    for algorithm, counts in COUNTS.items():
        row = re.search(rf"^\| `{algorithm}` \|(.*)\|$", TEXT, flags=re.M)
        assert row
        assert tuple(map(int, re.findall(r"\d+", row[1]))) == counts


def test_the_limits_are_the_loader_s():
    assert f"{load.MOST_GRID_NODES:,} nodes" in TEXT
    assert f"at most {load.LARGEST_CM:,.0f} cm" in TEXT
    assert f"at least {load.SMALLEST_CELL_CM}" in TEXT
    assert str([list(map(round, r)) for r in load.JOINT_LIMITS_DEG]) in TEXT


def test_the_smallest_scene_is_read():
    block = TEXT[TEXT.index("```toml") + len("```toml") :]
    scene = parse_scene(block[: block.index("```")], "docs/scene.md")
    assert scene.planner.neighbours == 56


def test_the_package_has_the_distribution_s_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert planarm.__version__ == project["version"]
