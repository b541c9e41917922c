"""Scenes that are wrong: each error names file, key, value, limit and what to change."""

import tomllib

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm.errors import SceneError
from planarm.scene import load_scene, parse_scene, with_planner
from planarm.scene.simple_polygon import polygon_problem

RIGHT = """
name = "right"
[arm]
link_lengths_cm = [30, 20]
link_width_cm = 0.8
base_cm = [0, 0]
elbow = "up"
joint_limits_deg = [[-90, 270], [-138.59, 138.59]]
[workspace]
x_cm = [-50, 50]
y_cm = [0, 50]
cell_cm = 1.0
clearance_cm = 0.1
[[obstacles]]
shape = "circle"
center_cm = [35, 18]
diameter_cm = 10
[[obstacles]]
shape = "polygon"
vertices_cm = [[-5, 35], [5, 35], [0, 39]]
[task]
start_cm = [49, 2]
goal_cm = [1, 45]
[planner]
algorithm = "chs"
neighbours = 56
subset = "run"
seed = 1
moves = "proved"
[[joints]]
steps_per_rev = 200
microsteps = 16
gear_ratio = 5
driver = "a4988"
max_speed_deg_s = 100
max_acceleration_deg_s2 = 500
[[joints]]
max_speed_deg_s = 101
max_acceleration_deg_s2 = 501
[link]
port = "sim://"
baud = 250000
"""

# (what stands in the right scene, what is put there, key named, words that the message has)
WRONG = [
    # keys that are not known
    ("link_lengths_cm", "link_lengths_mm", "arm.link_lengths_mm", ["wrong unit", "'link_lengths_cm'", "centimetres"]),
    ("link_lengths_cm", "link_lengths", "arm.link_lengths", ["'link_lengths_cm' expected, in centimetres"]),
    ("joint_limits_deg", "joint_limits_rad", "arm.joint_limits_rad", ["'joint_limits_deg' expected, in degrees"]),
    (
        "max_speed_deg_s = 101",
        "max_speed_rad_s = 2",
        "joints[2].max_speed_rad_s",
        ["'max_speed_deg_s'", "degrees per second"],
    ),
    ("max_acceleration_deg_s2 = 501", "max_acceleration_deg_s = 501", "joints[2].max_acceleration_deg_s", ["squared"]),
    ("elbow = ", "elbows = ", "arm.elbows", ["unknown key", "did you mean 'elbow'"]),
    ("cell_cm", "cellsize", "workspace.cellsize", ["unknown key", "x_cm, y_cm, cell_cm, clearance_cm"]),
    ("[planner]", "[planer]", "planer", ["unknown key", "did you mean 'planner'"]),
    (
        "diameter_cm = 10",
        "vertices_cm = [[0, 0], [1, 0], [0, 1]]",
        "obstacles[1].vertices_cm",
        ["shape, center_cm, diameter_cm"],
    ),
    ("diameter_cm = 10", "radius_cm = 5", "obstacles[1].radius_cm", ["'diameter_cm' expected, twice the radius"]),
    # missing keys and tables
    ("link_width_cm = 0.8", "", "arm.link_width_cm", ["missing", "a number above 0", "centimetres"]),
    ('elbow = "up"', "", "arm.elbow", ["missing", "'up', 'down', 'either'"]),
    ("x_cm = [-50, 50]", "", "workspace.x_cm", ["missing", "[least, greatest] in centimetres"]),
    ("start_cm = [49, 2]", "", "task.start_cm", ["missing", "[x, y] in centimetres"]),
    ('shape = "circle"', "", "obstacles[1].shape", ["missing", "'circle', 'square'"]),
    ("diameter_cm = 10", "", "obstacles[1].diameter_cm", ["missing", "a number above 0"]),
    ("max_speed_deg_s = 101", "", "joints[2].max_speed_deg_s", ["missing", "degrees per second"]),
    ("[task]\nstart_cm = [49, 2]\ngoal_cm = [1, 45]", "", "task", ["missing", "[task]", "start_cm, goal_cm"]),
    # wrong types
    ("link_lengths_cm = [30, 20]", "link_lengths_cm = 30", "arm.link_lengths_cm", ["30 given", "a list of numbers"]),
    ("link_lengths_cm = [30, 20]", 'link_lengths_cm = [30, "20"]', "arm.link_lengths_cm", ["'20' given"]),
    ("link_lengths_cm = [30, 20]", "link_lengths_cm = []", "arm.link_lengths_cm", ["[] given", "a list of numbers"]),
    ("link_width_cm = 0.8", "link_width_cm = true", "arm.link_width_cm", ["true given", "a number"]),
    ('elbow = "up"', 'elbow = "up"\nfloor = 0', "arm.floor", ["0 given", "true or false"]),
    ("base_cm = [0, 0]", "base_cm = [0, 0, 0]", "arm.base_cm", ["[0, 0, 0] given", "[x, y]"]),
    ("seed = 1", "seed = 1.5", "planner.seed", ["1.5 given", "a whole number from 0"]),
    ("microsteps = 16", "microsteps = true", "joints[1].microsteps", ["true given", "a whole number"]),
    ('port = "sim://"', "port = 3", "link.port", ["3 given", "a text"]),
    ('port = "sim://"', 'port = " "', "link.port", ["' ' given", "not empty"]),
    ('name = "right"\n[arm]', "arm = 3\n[other]", "other", ["unknown key"]),
    ("[link]\n", "[[link]]\n", "link", ["a table expected", "[link]"]),
    # NaN, infinity, numbers beyond floats
    ("link_width_cm = 0.8", "link_width_cm = nan", "arm.link_width_cm", ["nan given"]),
    ("start_cm = [49, 2]", "start_cm = [nan, 2]", "task.start_cm", ["nan given"]),
    ("diameter_cm = 10", "diameter_cm = inf", "obstacles[1].diameter_cm", ["inf given", "at most 10000"]),
    ("diameter_cm = 10", f"diameter_cm = 1{'0' * 400}", "obstacles[1].diameter_cm", ["at most 10000"]),
    ("y_cm = [0, 50]", "y_cm = [0, inf]", "workspace.y_cm", ["inf given"]),
    # out of range
    ("link_lengths_cm = [30, 20]", "link_lengths_cm = [30, -20]", "arm.link_lengths_cm", ["-20 given", "above 0"]),
    ("link_lengths_cm = [30, 20]", "link_lengths_cm = [0, 20]", "arm.link_lengths_cm", ["0 given", "above 0"]),
    (
        "link_lengths_cm = [30, 20]",
        "link_lengths_cm = [30, 20, 9]",
        "arm.link_lengths_cm",
        ["[30.0, 20.0, 9.0]", "2 lengths"],
    ),
    ("link_width_cm = 0.8", "link_width_cm = 0", "arm.link_width_cm", ["0 given", "above 0"]),
    ("clearance_cm = 0.1", "clearance_cm = -0.1", "workspace.clearance_cm", ["-0.1 given", "at least 0"]),
    ("cell_cm = 1.0", "cell_cm = 0", "workspace.cell_cm", ["0 given", "at least 0.001"]),
    ("cell_cm = 1.0", "cell_cm = 1e-320", "workspace.cell_cm", ["at least 0.001"]),
    ("cell_cm = 1.0", "cell_cm = 0.01", "workspace.cell_cm", ["10001 x 5001", "20000000 are the most", "larger cells"]),
    ("cell_cm = 1.0", "cell_cm = 60", "workspace.cell_cm", ["1 x 1", "2 x 2 are the least", "smaller cells"]),
    ("x_cm = [-50, 50]", "x_cm = [50, -50]", "workspace.x_cm", ["[50, -50] given", "least below greatest"]),
    ("x_cm = [-50, 50]", "x_cm = [50, 50]", "workspace.x_cm", ["[50, 50] given", "least below greatest"]),
    ("diameter_cm = 10", "diameter_cm = 0", "obstacles[1].diameter_cm", ["0 given", "above 0"]),
    ("center_cm = [35, 18]", "center_cm = [35, 180000]", "obstacles[1].center_cm", ["180000 given", "-10000 to 10000"]),
    ("gear_ratio = 5", "gear_ratio = 0", "joints[1].gear_ratio", ["0 given", "above 0"]),
    ("steps_per_rev = 200", "steps_per_rev = 0", "joints[1].steps_per_rev", ["0 given", "from 1 to"]),
    ("microsteps = 16", "microsteps = 32", "joints[1].microsteps", ["32 given", "1, 2, 4, 8, 16", "'a4988'"]),
    ("microsteps = 16", "microsteps = 12", "joints[1].microsteps", ["12 given", "1, 2, 4, 8, 16", "'a4988'"]),
    ("microsteps = 16", "microsteps = 257", "joints[1].microsteps", ["257 given", "from 1 to 256"]),
    ("max_speed_deg_s = 101", "max_speed_deg_s = 0", "joints[2].max_speed_deg_s", ["0 given", "above 0"]),
    (
        "max_acceleration_deg_s2 = 501",
        "max_acceleration_deg_s2 = -1",
        "joints[2].max_acceleration_deg_s2",
        ["-1 given"],
    ),
    ("baud = 250000", "baud = 300", "link.baud", ["300 given", "from 1200 to 2000000"]),
    ("seed = 1", "seed = -1", "planner.seed", ["-1 given", "from 0 to 4294967295"]),
    (
        "start_cm = [49, 2]",
        "start_cm = [51, 2]",
        "task.start_cm",
        ["[51.0, 2.0]", "x from -50 to 50", "workspace.x_cm"],
    ),
    ("goal_cm = [1, 45]", "goal_cm = [1, -1]", "task.goal_cm", ["[1.0, -1.0]", "y from 0 to 50", "workspace.y_cm"]),
    # joint limits and base
    ("[-138.59, 138.59]", "[-190, 138.59]", "arm.joint_limits_deg", ["[-190.0, 138.59]", "[-180, 180]", "joint 2"]),
    ("[-90, 270]", "[-90, 280]", "arm.joint_limits_deg", ["[-90.0, 280.0]", "at most 360 degrees", "joint 1"]),
    ("[-90, 270]", "[90, -90]", "arm.joint_limits_deg", ["[90, -90] given", "least below greatest"]),
    (", [-138.59, 138.59]]", "]", "arm.joint_limits_deg", ["[[-90.0, 270.0]] given", "each of the 2 joints"]),
    (
        'base_cm = [0, 0]\nelbow = "up"',
        'base_cm = [0, -1]\nelbow = "up"\nfloor = true',
        "arm.base_cm",
        ["[0.0, -1.0]", "arm.floor is true"],
    ),
    # choices
    ('"circle"', '"cirle"', "obstacles[1].shape", ["'cirle' given", "did you mean 'circle'"]),
    ('elbow = "up"', 'elbow = "left"', "arm.elbow", ["'left' given", "one of 'up', 'down', 'either'"]),
    ('algorithm = "chs"', 'algorithm = "a*"', "planner.algorithm", ["'a*' given", "'a_star', 'modified_a_star'"]),
    ("neighbours = 56", "neighbours = 24", "planner.neighbours", ["24 given", "12, 28, 48, 56, 80", "'chs'"]),
    ('algorithm = "chs"', 'algorithm = "a_star"', "planner.neighbours", ["56 given", "one of 8", "'a_star'"]),
    ('subset = "run"', 'subset = "sometimes"', "planner.subset", ["'run', 'expansion'"]),
    ('moves = "proved"', 'moves = "node"', "planner.moves", ["did you mean 'nodes'"]),
    ('driver = "a4988"', 'driver = "a4998"', "joints[1].driver", ["did you mean 'a4988'"]),
    # polygons
    ("[[-5, 35], [5, 35], [0, 39]]", "[[-5, 35], [5, 35]]", "obstacles[2].vertices_cm", ["2 vertices", "from 3"]),
    ("[[-5, 35], [5, 35], [0, 39]]", "[[-5, 35], [5, 35, 2], [0, 39]]", "obstacles[2].vertices_cm", ["[x, y]"]),
    (
        "[[-5, 35], [5, 35], [0, 39]]",
        "[[0, 0], [4, 4], [4, 0], [0, 4]]",
        "obstacles[2].vertices_cm",
        ["edge 1", "edge 3", "meet", "order the vertices"],
    ),
    (
        "[[-5, 35], [5, 35], [0, 39]]",
        "[[0, 0], [4, 0], [4, 0], [0, 4]]",
        "obstacles[2].vertices_cm",
        ["vertices 2 and 3 are the same point", "remove one"],
    ),
    (
        "[[-5, 35], [5, 35], [0, 39]]",
        "[[0, 0], [4, 0], [2, 0]]",
        "obstacles[2].vertices_cm",
        ["edge 1", "edge 2", "meet"],
    ),
    # numbers of things
    (
        "[[joints]]\nmax_speed_deg_s = 101\nmax_acceleration_deg_s2 = 501",
        "",
        "joints",
        ["1 given, 2 expected", "[[joints]]"],
    ),
    ("[link]\n", "[[joints]]\n[link]\n", "joints", ["3 given, 2 expected"]),
    # not TOML
    ("x_cm = [-50, 50]", "x_cm = [-50, 50", "", ["not valid TOML", "line"]),
    ("cell_cm = 1.0", "cell_cm = 1.0\ncell_cm = 2.0", "", ["not valid TOML"]),
]


def test_the_right_scene_is_right():
    assert parse_scene(RIGHT, "right.toml").name == "right"


@pytest.mark.parametrize(
    ("old", "new", "key", "words"), WRONG, ids=[f"{w[2] or 'toml'}-{i}" for i, w in enumerate(WRONG)]
)
def test_wrong_scenes_name_the_key_and_what_to_change(old, new, key, words):
    assert old in RIGHT
    with pytest.raises(SceneError) as caught:
        parse_scene(RIGHT.replace(old, new, 1), "wrong.toml")
    assert caught.value.key == key
    assert caught.value.exit_code == 2
    assert str(caught.value).startswith(f"wrong.toml: {key}: " if key else "wrong.toml: ")
    for word in words:
        assert word in str(caught.value)


def test_a_single_table_where_several_are_meant_is_told_so():
    first = RIGHT.index("[[obstacles]]")
    text = RIGHT[:first] + RIGHT[first:].replace("[[obstacles]]", "[obstacles]", 1)
    text = text[: text.rindex("[[obstacles]]")] + text[text.index("[task]") :]
    with pytest.raises(SceneError, match=r"write \[\[obstacles\]\] with two brackets") as caught:
        parse_scene(text, "wrong.toml")
    assert caught.value.key == "obstacles"


def test_a_plan_in_a_scenes_place_is_told_where_it_belongs():
    with pytest.raises(SceneError, match="it looks like a plan, which 'planarm stream' takes"):
        parse_scene('{\n "format": 4\n}', "my.plan")


def test_a_file_that_is_not_there_is_a_scene_error(tmp_path):
    with pytest.raises(SceneError, match=r"nowhere\.toml: cannot be read: No such file"):
        load_scene(tmp_path / "nowhere.toml")


def test_a_file_that_is_not_text_is_a_scene_error(tmp_path):
    (tmp_path / "bytes.toml").write_bytes(b"name = '\xff'")
    with pytest.raises(SceneError, match="not UTF-8 text: byte 8"):
        load_scene(tmp_path / "bytes.toml")


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"algorithm": "dijkstra"}, "planner.algorithm", ["'dijkstra' given", "'a_star'"]),
        ({"algorithm": "a_star", "neighbours": 24}, "planner.neighbours", ["24 given", "one of 8"]),
        ({"neighbours": 44}, "planner.neighbours", ["44 given", "12, 28, 48, 56, 80"]),
        ({"seed": -1}, "planner.seed", ["-1 given"]),
    ],
)
def test_planner_settings_given_in_place_of_the_scene_s_are_checked_like_them(changes, key, words):
    with pytest.raises(SceneError) as caught:
        with_planner(parse_scene(RIGHT, "right.toml"), **changes)
    assert caught.value.key == key
    assert all(word in str(caught.value) for word in words)


coordinates = st.integers(-6, 6)


@given(st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=7))
@settings(max_examples=400, deadline=None)
def test_simple_polygons_are_told_from_others_as_shapely_does(points):
    """On a coarse lattice, where corners touch edges and edges overlap; equal neighbours are an error of their own."""
    vertices = [(float(x), float(y)) for x, y in points]
    repeated = any(a == b for a, b in zip(vertices, vertices[1:] + vertices[:1], strict=True))
    simple = not repeated and shapely.LinearRing(vertices).is_simple and shapely.Polygon(vertices).is_valid
    assert (polygon_problem(vertices) == "") == simple


json_like = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=4,
)


@given(st.sampled_from(sorted(tomllib.loads(RIGHT))), st.data())
@settings(max_examples=200, deadline=None)
def test_whatever_stands_at_a_key_it_is_taken_or_is_a_scene_error(section, data):
    tree = tomllib.loads(RIGHT)
    table = tree[section][0] if isinstance(tree[section], list) else tree[section]
    if isinstance(table, dict):
        table[data.draw(st.sampled_from(sorted(table)))] = data.draw(json_like)
    else:
        tree[section] = data.draw(json_like)
    try:
        scene = parse_scene(to_toml(tree), "fuzzed.toml")
    except SceneError as error:
        assert error.key or "TOML" in str(error)
    else:
        assert np.isfinite(scene.workspace.cell_cm)


def to_toml(value, path=()):
    """Write a tree of plain values as TOML; None is written as a bare word, which TOML does not know."""
    lines, tables = [], []
    for key, entry in value.items():
        if isinstance(entry, dict):
            tables.append(f"[{'.'.join((*path, key))}]\n{to_toml(entry, (*path, key))}")
        elif isinstance(entry, list) and entry and all(isinstance(e, dict) for e in entry):
            tables += [f"[[{'.'.join((*path, key))}]]\n{to_toml(e, (*path, key))}" for e in entry]
        else:
            lines.append(f"{key} = {toml_value(entry)}")
    return "\n".join(lines + tables)


def toml_value(value):
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(c):08X}" for c in value) + '"'
    return "none" if value is None else repr(value)


@pytest.mark.parametrize("value", ["9" * 5000, "[" * 5000 + "]" * 5000], ids=["a long number", "many brackets"])
def test_toml_beyond_what_python_reads_is_a_scene_error(value):
    """tomllib lets ValueError and RecursionError through."""
    with pytest.raises(SceneError, match="is not valid TOML"):
        parse_scene(f"name = {value}", "arm.toml")
