"""What the certificate keeps for arms with one, two, three and four links: green as planned, red for every change.

Motions are those through poses that `joint_motions` makes, on every board that steps so many joints.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from joint_motions import laden, on_its_way, through
from planarm.model.transmission import Transmission
from planarm.stepping.certify import certify
from planarm.stepping.expand import expand
from planarm_wire.steps import step_ticks

LINKS = (1, 2, 3, 4)
LIGHT = (0.02, 0.02, 0.01, 0.0)
SENSES = np.array([1.0, -0.8, 0.9, -1.1])


@cache
def planned(joints, wiring="own"):
    """A light arm and a motion in which every joint turns out and part of the way back."""
    scene = replace(laden(joints, LIGHT), wiring=wiring)
    poses = np.array([0.2, -0.3, 0.4, 0.1])[:joints] + np.outer([0.0, 0.7, 0.3], SENSES[:joints])
    # Start and goal on whole micro-steps: what is asked for is the lattice's, as after homing.
    arm = Transmission.of(scene)
    poses = arm.q_rad(np.rint(arm.usteps(poses)))
    scene = at_its_poses(on_its_way(scene, poses), poses)
    return scene, through(scene, poses)


def at_its_poses(scene, poses):
    """The scene whose start and goal are the tips of the first and the last pose."""
    heads = np.cumsum(poses[[0, -1]], axis=1)
    lengths = np.array(scene.arm.link_lengths_cm)
    tips = np.stack([np.cos(heads) @ lengths, np.sin(heads) @ lengths], axis=1) + np.array(scene.arm.base_cm)
    start, goal = (tuple(float(v) for v in tip) for tip in tips)
    return replace(scene, task=replace(scene.task, start_cm=start, goal_cm=goal))


def red(certificate):
    return [check.name for check in certificate.checks if check.verdict == "red"]


def changed(plan, change, joint):
    trajectory, train, segments = plan
    return trajectory, train, replace(segments, segments=tuple(change(list(segments.segments), joint)))


def with_move(segments, k, joint, **fields):
    moves = list(segments[k].moves)
    moves[joint] = replace(moves[joint], **fields)
    segments[k] = replace(segments[k], moves=tuple(moves))
    return segments


def busy(segments, joint):
    """Index of a segment in which the joint makes many steps."""
    return max(range(len(segments)), key=lambda k: segments[k].moves[joint].steps_dir)


def swapped(segments, joint):
    k = busy(segments, joint)
    segments[k], segments[0] = segments[0], segments[k]
    return segments


def turned(segments, joint):
    k = busy(segments, joint)
    return with_move(segments, k, joint, steps_dir=segments[k].moves[joint].steps_dir ^ 1)


def one_step_more(segments, joint):
    k = busy(segments, joint)
    return with_move(segments, k, joint, steps_dir=segments[k].moves[joint].steps_dir + 2)


def one_step_fewer(segments, joint):
    k = busy(segments, joint)
    return with_move(segments, k, joint, steps_dir=segments[k].moves[joint].steps_dir - 2)


def earlier(segments, joint):
    """A run by half of its first ticks, which are as near to an interval as any."""
    moves = [segment.moves[joint] for segment in segments]
    k = max(range(len(moves)), key=lambda k: moves[k].first_ticks / max(moves[k].interval_q8, 1 << 16))
    return with_move(segments, k, joint, first_ticks=moves[k].first_ticks // 2)


def longer(segments, joint):
    k = busy(segments, joint)
    segments[k] = replace(segments[k], duration_flags=segments[k].duration_flags + 2 * 5000)
    return segments


def shorter_intervals(segments, joint):
    k = busy(segments, joint)
    return with_move(segments, k, joint, interval_q8=segments[k].moves[joint].interval_q8 // 2)


def bent(segments, joint):
    k = busy(segments, joint)
    move = segments[k].moves[joint]
    return with_move(segments, k, joint, add=move.add + 100 * (256 if move.steps_dir >> 1 <= 128 else 65536))


def doubled(segments, joint):
    k = busy(segments, joint)
    return [*segments[: k + 1], *segments[k:]]


def without(segments, joint):
    k = busy(segments, joint)
    return [*segments[:k], *segments[k + 1 :]]


CHANGES = (
    (swapped, ""),
    (turned, "end position"),
    (one_step_more, "end position"),
    (one_step_fewer, "end position"),
    (earlier, "timing error"),
    (longer, "duration"),
    (shorter_intervals, "timing error"),
    (bent, "timing error"),
    (doubled, "end position"),
    (without, "end position"),
)
EVERY_JOINT = [(joints, joint) for joints in LINKS for joint in range(joints)]


@pytest.mark.parametrize("wiring", ["own", "cnc_shield"])
@pytest.mark.parametrize("joints", LINKS)
def test_a_plan_as_it_was_made_is_green_with_checks_of_every_joint(joints, wiring):
    scene, plan = planned(joints, wiring)
    certificate = certify(scene, *plan)
    assert red(certificate) == []
    names = [check.name for check in certificate.checks]
    assert len(set(names)) == len(names)
    per_joint = {name.split(" ", 2)[2] for name in names if name.startswith("joint ")}
    for words in ("timing error", "end position", "planned speed", "pull-out", "lag of the rotor", "deviation"):
        assert any(words in name for name in per_joint), words
    for number in range(1, joints + 1):
        own = {name.split(" ", 2)[2] for name in names if name.startswith(f"joint {number} ")}
        assert own | {"distance to a singular pose"} == per_joint | {"distance to a singular pose"}  # not of joint 1


@pytest.mark.parametrize(("change", "name"), CHANGES)
@pytest.mark.parametrize(("joints", "joint"), EVERY_JOINT)
def test_every_change_of_every_joints_segments_turns_it_red(joints, joint, change, name):
    scene, plan = planned(joints)
    found = red(certify(scene, *changed(plan, change, joint)))
    assert any(name in one for one in found), found
    if name in ("timing error", "end position") and change not in (swapped, doubled, without):
        assert any(f"joint {joint + 1} {name}" in one for one in found), found


@pytest.mark.parametrize(
    ("field", "value", "name"),
    [
        ("max_speed_rad_s", 0.2, "planned speed"),
        ("max_speed_rad_s", 0.2, "step interval"),
        ("max_acceleration_rad_s2", 0.5, "planned acceleration"),
        ("microsteps", 16, "deviation"),
    ],
)
@pytest.mark.parametrize(("joints", "joint"), EVERY_JOINT)
def test_every_tightened_limit_of_every_joint_turns_it_red(joints, joint, field, value, name):
    scene, plan = planned(joints)
    tighter = tuple(replace(one, **{field: value}) if j == joint else one for j, one in enumerate(scene.joints))
    found = red(certify(replace(scene, joints=tighter), *plan))
    assert f"joint {joint + 1} {name}" in " ".join(found), found


@pytest.mark.parametrize(("joints", "joint"), EVERY_JOINT)
def test_more_mass_at_any_link_turns_a_torque_or_a_lag_red(joints, joint):
    """Two tons at the link's end: no motor of this kind brings them so far in that time."""
    scene, plan = planned(joints)
    masses = tuple(2000.0 if j == joint else 0.0 for j in range(joints))
    heavy = replace(scene, mechanics=replace(scene.mechanics, end_masses_kg=masses))
    found = red(certify(heavy, *plan))
    assert any("share of the pull-out torque" in name for name in found), found
    assert any("lag of the rotor" in name for name in found), found


@pytest.mark.parametrize("joints", LINKS)
def test_the_expansion_is_the_wires_own_for_any_number_of_joints(joints):
    """All at once or step by step in Python's own integers: the same ticks, joint by joint."""
    _, (_, train, segments) = planned(joints)
    made = expand(segments)
    for j, steps in enumerate(made.steps):
        begin, ticks = 0, []
        for segment in segments.segments:
            ticks += [begin + tick for tick in step_ticks(segment.moves[j])]
            begin += segment.duration_flags >> 1
        assert steps.ticks.tolist() == ticks
        assert len(ticks) == len(train.steps[j].ticks)
