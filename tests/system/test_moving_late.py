"""An arm among moving obstacles that a bad line makes late: on time enough, planned again, or stopped with the reason.

The line.delay fault holds every byte back, and all behind it; the emulated arm is held against the obstacles' clock.
"""

import re
from dataclasses import replace
from math import cos, radians, sin

import numpy as np
import pytest

from moving_scenes import clearance_at, environment, quiet
from planarm.link.position import StreamError
from planarm.model.transmission import Transmission
from planarm.pipeline import plan_scene, run_scene
from planarm.scene import Obstacle, ObstacleMotion

DELAY = """
seed = 1
zero = "first_step"
[[faults]]
kind = "line.delay"
at_s = 3.0
for_s = {for_s}
by_s = {by_s}
share = 1.0
"""
ONCE_S = 0.05
"""Bytes of this long are held back once, and whatever comes behind them waits."""


def delays(folder, by_s, for_s=ONCE_S):
    path = folder / "delay.toml"
    path.write_text(DELAY.format(by_s=by_s, for_s=for_s))
    return path


def assert_arrived_untouched(summary):
    assert summary["arm_touches"] == 0
    assert summary["arm_clean"]
    assert summary["tip_error_mm"] < 0.1


@pytest.mark.parametrize("share", [0.5, 0.9])
def test_a_delay_up_to_the_plans_margin_touches_nothing(share, tmp_path, sized):
    """Late it is, by what the queue does not hide, and goes on as planned."""
    if not sized(0, 1):
        pytest.skip("emulates half a minute of motion: --full")
    scene = environment(1, faster=1.6)
    margin_s = plan_scene(scene, quiet).moving.delay_margin_s
    summary = run_scene(scene, "sim://", tmp_path / "out", quiet, faults=delays(tmp_path, share * margin_s))
    assert_arrived_untouched(summary)
    assert summary["delay_margin_s"] == margin_s > 1.0
    assert not summary["replans"]
    assert summary["late_s"] < margin_s


@pytest.mark.parametrize(("by_s", "for_s"), [(3.5, ONCE_S), (0.1, 60.0)], ids=["once", "all along"])
def test_a_longer_delay_is_planned_again_and_touches_nothing(by_s, for_s, tmp_path, sized):
    """All along, a round trip of 0.2 s carries too few bytes, so it becomes later and later, and misses a start."""
    if not sized(0, 1):
        pytest.skip("emulates a minute of motion: --full")
    scene = environment(1, faster=1.6)
    summary = run_scene(scene, "sim://", tmp_path / "out", quiet, faults=delays(tmp_path, by_s, for_s))
    assert_arrived_untouched(summary)
    assert summary["replans"]
    assert ("missed start" in [one["why"] for one in summary["replans"]]) == (for_s > ONCE_S)


def around(radius_cm, angle_deg):
    return (radius_cm * cos(radians(angle_deg)), radius_cm * sin(radians(angle_deg)))


def closing_scene():
    """A disc as wide as the annulus comes in behind the arm that is on time, then sweeps back to a disc that rests."""
    scene = environment(1, faster=1.6)
    far, gate, swept = around(150, 62), around(85, 62), around(85, 110)
    offsets = [(x - far[0], y - far[1]) for x, y in (far, far, gate, gate, swept)]
    motion = ObstacleMotion((0.0, 6.5, 10.0, 14.0, 22.0), tuple(offsets), False)
    moving = Obstacle("circle", far, 34.0, motion=motion)
    return replace(scene, obstacles=(moving, Obstacle("circle", around(85, 130), 34.0)))


def test_an_arm_that_is_trapped_is_stopped_and_told_what_touches_it_and_when(tmp_path):
    scene = closing_scene()
    with pytest.raises(StreamError) as caught:
        run_scene(scene, "sim://", tmp_path / "out", quiet, faults=delays(tmp_path, 4.0))
    notes = "\n".join(caught.value.__notes__)
    assert "stopped along its path" in notes
    assert "no motion leads on" in notes
    assert "it is trapped" in notes
    found = re.search(
        r"obstacles\[1\] touches the resting arm after ([\d.]+) s, ([\d.]+) s on the obstacles' clock", notes
    )
    # Where it rests and when the disc is there, by shapely; told to 0.05 s, with the margin that plans keep.
    plan = plan_scene(scene, quiet)
    rest = Transmission.of(scene).q_rad(np.add(plan.segments.start_usteps, caught.value.position.moved_usteps[:2]))
    told_s = float(found[2])
    assert clearance_at(scene, rest, told_s - 0.05) > scene.margin_cm
    assert clearance_at(scene, rest, told_s + 0.1) <= scene.margin_cm + 0.05
    assert "the emulated arm: the arm did as planned" in notes  # at rest, and nothing has touched it yet
