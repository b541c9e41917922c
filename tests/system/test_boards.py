"""Arms of one to four links on every wiring, from scene to report on the emulated board and its arm."""

from dataclasses import replace
from itertools import pairwise
from math import radians
from pathlib import Path

import numpy as np
import pytest
import shapely

from board_scenes import GOAL, LENGTHS, scene_of
from planarm.errors import LinkError, SceneError, StepsDifferError, TimingError
from planarm.link import sim_bench
from planarm.link.exchange import open_session
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.pipeline import plan_scene, run_scene
from planarm.plan_file import load_plan
from planarm.scene import parse_scene
from planarm_wire.messages import BOARDS, MIN_DIR_SETUP_TICKS, TICKS_HZ
from planarm_wire.steps import duration_ticks

EXAMPLE = Path(__file__).parents[2] / "examples" / "slow_drivers.toml"
CASES = [(joints, wiring) for wiring in ("own", "cnc_shield") for joints in (1, 2, 3, 4)]
MOST_OFF_TICKS = {"uno": 0, "uno_four": 192, "cnc_shield": 160, "cnc_shield_four": 480}
"""docs/wiring.md's table: how far a step may rise from its tick."""


def no_notice(_stage, _share):
    pass


def read_back(path):
    """The motors' positions after each step, and the steps (tick, motor, sense): from the file's numbers."""
    plan = load_plan(path).segments
    at, events = 0, []
    for segment in plan.segments:
        for motor, move in enumerate(segment.moves):
            for n in range(move.steps_dir >> 1):
                add = 256 * move.add if move.steps_dir >> 1 <= 128 else move.add
                since = (256 * n * move.interval_q8 + n * (n - 1) // 2 * add) // 65536
                events.append((at + move.first_ticks + since, motor, 1 if move.steps_dir & 1 else -1))
        at += duration_ticks(segment)
    position, rows = list(plan.start_usteps), [list(plan.start_usteps)]
    for _, motor, sign in sorted(events):
        position[motor] += sign
        rows.append(list(position))
    return np.array(rows), sorted(events)


def tips_and_links(scene, usteps):
    """Links of every pose as shapely lines, by complex numbers: kinematics that share nothing with the host's."""
    zero = np.array([joint.zero_offset_rad for joint in scene.joints])
    per_rad = np.array(
        [j.steps_per_rev * j.microsteps * j.gear_ratio / (2 * np.pi) * (-1 if j.reversed else 1) for j in scene.joints]
    )
    turns = np.exp(1j * np.cumsum(usteps / per_rad + zero, axis=1))
    ends = np.cumsum(np.array(scene.arm.link_lengths_cm) * turns, axis=1) + complex(*scene.arm.base_cm)
    base = np.full((len(ends), 1), complex(*scene.arm.base_cm))
    points = np.concatenate([base, ends], axis=1)
    return points[:, -1], shapely.linestrings(np.stack([points.real, points.imag], axis=-1))


@pytest.mark.parametrize(("joints", "wiring"), CASES)
def test_a_scene_runs_on_its_board_and_its_bytes_keep_the_arm_free_by_another_geometry(joints, wiring, tmp_path):
    scene = scene_of(joints, wiring)
    board = scene.board
    assert (board.joints, board.pin_map) == (2 if joints < 3 else 4, wiring)
    summary = run_scene(scene, "sim://", tmp_path, no_notice)
    assert summary["certificate_ok"] and summary["arm_clean"]
    assert summary["steps_at_pins"] == summary["steps_planned"]
    assert len(summary["net_usteps"]) == joints
    assert summary["net_usteps"] == summary["net_usteps_by_ledger"]
    assert summary["arm_lost_full_steps"] == [0] * joints
    assert summary["arm_end_tip_error_mm"] < 1.0
    assert summary["max_step_timing_error_ticks"] <= MOST_OFF_TICKS[board.name]
    assert summary.get("path_clock_percent", 100) == 100
    require_free_bytes(scene, joints, tmp_path / "run.plan")


def require_free_bytes(scene, joints, plan_file):
    """The plan's bytes lead to the goal, past the obstacles, at the board's least interval or more."""
    usteps, steps = read_back(plan_file)
    tips, links = tips_and_links(scene, usteps)
    goal = np.exp(1j * np.cumsum([radians(angle) for angle in GOAL[:joints]])) @ np.array(LENGTHS[:joints])
    assert abs(tips[-1] - goal) < 0.1
    obstacles = [shapely.Polygon(one.vertices_cm) for one in scene.obstacles]
    assert min(shapely.distance(links, shape).min() for shape in obstacles) >= 0.5 * scene.arm.link_width_cm
    board, moved = scene.board, {motor for _, motor, _ in steps}
    assert moved == set(range(joints))
    for motor in moved:
        own = [(tick, sign) for tick, of, sign in steps if of == motor]
        assert own[0][0] >= MIN_DIR_SETUP_TICKS
        for (before, one), (after, other) in pairwise(own):
            assert after - before >= board.min_interval_ticks + (MIN_DIR_SETUP_TICKS if one != other else 0)


@pytest.mark.parametrize(("joints", "wiring"), [(2, "cnc_shield"), (3, "own"), (4, "cnc_shield")])
def test_a_rate_that_another_board_keeps_is_refused_with_the_board_and_the_setting(joints, wiring):
    board = scene_of(joints, wiring).board
    fastest = TICKS_HZ / board.min_interval_ticks
    scene = scene_of(joints, wiring, microsteps=128, max_speed_rad_s=1.2 * fastest / (200 * 128 * 5 / (2 * np.pi)))
    quick = replace(scene, motion=replace(scene.motion, torque_share=1.0))
    quick = replace(quick, joints=tuple(replace(j, max_acceleration_rad_s2=200.0, motor=STRONG) for j in quick.joints))
    with pytest.raises(TimingError, match=rf"board {board.name} .*steps/s.*max_speed_deg_s to at most"):
        plan_scene(quick, no_notice)


STRONG = replace(scene_of(1).joints[0].motor, holding_torque_nm=50.0, inductance_h=1e-5, rated_current_a=1.7)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        ("uno", "image steps 2 joints, the plan is for the board uno_four with 4: flash .*--board uno_four"),
        ("cnc_shield_four", "image is not for the wiring 'own' of the plan: flash .*--board uno_four"),
    ],
)
def test_a_plan_for_another_board_is_refused_before_anything_moves(image, words, tmp_path):
    with pytest.raises(LinkError, match=words):
        run_scene(scene_of(3), f"sim://?image={released_image(image)}", tmp_path, no_notice)


def slow_scene(high_us=10.0, low_us=10.0):
    """Two links whose drivers need pulses so long."""
    text = EXAMPLE.read_text(encoding="utf-8")
    text = text.replace("step_high_us = 10", f"step_high_us = {high_us}").replace("low_us = 10", f"low_us = {low_us}")
    return parse_scene(text, str(EXAMPLE))


@pytest.mark.parametrize(("high_us", "low_us"), [(5.0, 5.0), (10.0, 10.0), (15.0, 12.5)])
def test_drivers_that_need_long_pulses_lose_no_step(high_us, low_us, tmp_path):
    scene = slow_scene(high_us, low_us)
    assert scene.board.name == "uno_slow"
    summary = run_scene(scene, "sim://", tmp_path, no_notice)
    assert summary["certificate_ok"] and summary["arm_clean"]
    assert summary["steps_at_pins"] == summary["steps_planned"]
    assert summary["net_usteps"] == summary["net_usteps_by_ledger"]
    assert summary["arm_lost_full_steps"] == [0, 0]
    assert summary["max_step_timing_error_ticks"] == 0
    assert summary["min_pulse_high_us"] == 15.0
    assert summary["min_pulse_low_us"] >= 13.0


def test_the_same_drivers_lose_steps_by_shorter_pulses(tmp_path, monkeypatch):
    slow = slow_scene()
    brisk = replace(
        slow, wiring="own", joints=tuple(replace(j, step_high_s=None, step_low_s=None) for j in slow.joints)
    )
    assert brisk.board.name == "uno"
    monkeypatch.setattr(sim_bench, "drivers_of", lambda _scene, made=sim_bench.drivers_of: made(slow))
    with pytest.raises(
        StepsDifferError, match=r"joint 1 lost \d+ full steps; joint 2 lost \d+ full steps; .*step_high"
    ):
        run_scene(brisk, "sim://", tmp_path, no_notice)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"high_us": 20.0}, r"joints\[1\].step_high_us: .* high for 20 us, the board uno makes them high for 3.5 us"),
        ({"high_us": 3.0, "low_us": 300.0}, r"joints\[1\].step_low_us: .* low for 300 us, .* or lower max_speed_deg_s"),
    ],
)
def test_drivers_that_no_board_serves_are_refused(changes, words):
    with pytest.raises(SceneError, match=words):
        _ = slow_scene(**changes).board


def test_slow_drivers_of_four_joints_and_of_the_shield_are_refused():
    joint = slow_scene().joints[0]
    for scene in (scene_of(3), scene_of(2, "cnc_shield"), scene_of(4, "cnc_shield")):
        slow = replace(scene, joints=(joint, *scene.joints[1:]))
        with pytest.raises(
            SceneError, match=rf"the board {scene.board.name} makes them high for 3.5 us; the longest are"
        ):
            _ = slow.board


def test_every_board_tells_its_joints():
    for board in BOARDS.values():
        assert open_session(SimTransport(released_image(board.name), board=board)).joints == board.joints
