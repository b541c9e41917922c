"""What a board is told of a scene: every key of [board] in CONFIG, and soft limits that no certified plan trips."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from planarm.errors import SceneError
from planarm.link.stream_values import StreamOptions, no_soft_limits, plain_config, soft_limits_at
from planarm.model.transmission import Transmission
from planarm.scene import BoardSpec, parse_scene
from planarm.streaming.board_settings import Option, config_of, options_of, soft_limits_of
from planarm_wire.messages import BOARDS, Ledger

ARM = """
[arm]
link_lengths_cm = [30, 20]
link_width_cm = 0.8
elbow = "up"
joint_limits_deg = [[-10, 100], [-150, -5]]
[workspace]
x_cm = [-50, 50]
y_cm = [-10, 50]
[task]
start_cm = [45, 5]
goal_cm = [30, 30]
[[joints]]
gear_ratio = 5
max_speed_deg_s = 110
max_acceleration_deg_s2 = 570
[[joints]]
gear_ratio = 3.7
reversed = true
zero_offset_deg = 12.3
max_speed_deg_s = 110
max_acceleration_deg_s2 = 570
"""
SWITCH = """
[[limit_switches]]
joint = 1
pin = "A1"
at_deg = 101
side = "above"
"""


def scene(more=""):
    return parse_scene(ARM + more, "arm.toml")


def test_a_scene_that_says_nothing_switches_nothing_on():
    config = config_of(scene())
    plain = plain_config(BOARDS["uno"])
    assert replace(config, start_stop_ticks=plain.start_stop_ticks) == plain
    assert scene().board_spec == BoardSpec()


@pytest.mark.parametrize(
    ("more", "option"),
    [
        ("[board]\nenable_active_high = true", Option.ENABLE_ACTIVE_HIGH),
        ("[board]\nemergency_releases = true", Option.EMERGENCY_RELEASES),
        ("[board]\nstop_input = true", Option.STOP_INPUT),
        (SWITCH, Option.LIMIT_SWITCHES),
        (SWITCH + "normally_closed = true", Option.LIMIT_SWITCHES | Option.LIMITS_OPEN_WHEN_HIT),
    ],
)
def test_each_key_is_its_bit_of_the_options(more, option):
    assert options_of(scene(more)) == option
    assert config_of(scene(more)).options == int(option)


def test_the_bits_are_those_of_the_specification():
    """messages.toml: 0 ENABLE active high, 1 emergency releases, 2 stop input, 3 limit switches, 4 open when hit."""
    assert [bit.value for bit in Option] == [1, 2, 4, 8, 16]


def test_times_are_told_in_the_wires_units():
    config = config_of(scene("[board]\nidle_release_s = 30.5\nwake_ms = 250"))
    assert (config.idle_ms, config.wake_ticks) == (30_500, 4_000_000)
    assert config_of(scene("[board]\nidle_release_s = 0")).idle_ms == 0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("[board]\nstop_input = 1", r"board\.stop_input: 1 given, true or false expected"),
        ("[board]\nstop_inputs = true", r"board\.stop_inputs: unknown key; did you mean 'stop_input'\?"),
        ("[board]\nidle_release_ms = 5", r"wrong unit: 'idle_release_s' expected, in seconds"),
        ("[board]\nidle_release_s = 2", r"idle_release_s: 2.0 given, 0 \(never\) or a number of seconds from 5 on"),
        ("[board]\nidle_release_s = 1e6", r"idle_release_s: 1000000.0 given, .*at most 86400"),
        ("[board]\nwake_ms = -1", r"wake_ms: -1 given, .*at least 0 and at most 10000 in milliseconds"),
        ("[board]\nwake_s = 1", r"wrong unit: 'wake_ms' expected, in milliseconds"),
        (SWITCH.replace("A1", "A2"), r"limit_switches\[1\]\.pin: 'A2' given, 'A1' expected: there the board uno looks"),
        (
            SWITCH + SWITCH.replace("joint = 1", "joint = 2").replace("A1", "A2") + "normally_closed = true",
            r"limit_switches\[2\]\.normally_closed: the board takes all switches alike",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_what_to_change(more, said):
    with pytest.raises(SceneError, match=said):
        scene(more)


def test_a_switch_is_where_its_scenes_board_has_it():
    shield = SWITCH.replace("A1", "D9")
    assert scene('[board]\nwiring = "cnc_shield"' + shield).limit_switches[0].pin == "D9"
    with pytest.raises(SceneError, match="'A1' expected"):
        scene(shield)


COUPLED = "[transmission]\ncoupling = [[1, 0], [1, 1]]"


@pytest.mark.parametrize("more", ["", COUPLED])
def test_no_certified_pose_is_beyond_the_soft_limits(more):
    """The certificate takes poses half a micro-step of every motor beyond a joint's limits, for the rounding."""
    told = scene(more)
    limits, transmission = soft_limits_of(told), Transmission.of(told)
    beyond_rad = 0.5 * np.abs(transmission.rad_per_ustep).sum(axis=1)
    corners = np.array([list(pose) for pose in product(*np.array(told.arm.joint_limits_rad))])
    senses = np.array(list(product((-1.0, 1.0), repeat=2)))
    usteps = transmission.usteps(corners + senses * beyond_rad)
    for rounded in (np.floor(usteps), np.ceil(usteps)):
        for at in rounded:
            room = np.minimum(
                transmission.q_rad(at) - np.array(told.arm.joint_limits_rad)[:, 0],
                np.array(told.arm.joint_limits_rad)[:, 1] - transmission.q_rad(at),
            )
            if (room >= -beyond_rad).all():
                assert (at >= limits.least_usteps).all()
                assert (at <= limits.most_usteps).all()
    # And not much wider: two micro-steps beyond the corners' own range.
    exact = transmission.usteps(corners)
    spread = np.abs(transmission.usteps_per_rad) @ beyond_rad
    assert (exact.min(axis=0) - limits.least_usteps <= spread + 1.01).all()
    assert (limits.most_usteps - exact.max(axis=0) <= spread + 1.01).all()


def test_joints_that_the_arm_lacks_have_no_limit():
    three = ARM.replace("[30, 20]", "[20, 15, 10]").replace("[-150, -5]]", "[-150, -5], [-90, 90]]")
    three = three.replace("start_cm = [45, 5]\ngoal_cm = [30, 30]", "start_deg = [0, -20, 0]\ngoal_deg = [20, -20, 0]")
    joint = "[[joints]]\nmax_speed_deg_s = 110\nmax_acceleration_deg_s2 = 570\n"
    told = parse_scene(three + joint + '[planner]\nalgorithm = "roadmap_a_star"', "three.toml")
    limits = soft_limits_of(told)
    assert (limits.least_usteps[3], limits.most_usteps[3]) == (0, -1)
    assert limits.least_usteps[2] == -limits.most_usteps[2] == -801  # 90 degrees of 3,200 micro-steps, and one
    assert config_of(told).joints == 4


def test_soft_limits_need_a_board_that_counts_where_the_plan_begins():
    said = []
    limits = soft_limits_of(scene())
    options = StreamOptions(soft_limits=limits, start_usteps=(10, 20))
    assert soft_limits_at(Ledger(0, (10, 20)), options, said.append) == limits
    assert not said
    assert soft_limits_at(Ledger(0, (10, 21)), options, said.append) == no_soft_limits(BOARDS["uno"])
    assert "soft limits are not watched: the board counts (10, 21) usteps where the plan begins at (10, 20)" in said[0]
    assert soft_limits_at(Ledger(0, (0, 0)), StreamOptions(), said.append) is None
