"""Paths at the edge of what a path is, as data files: durations by closed forms, stops, and every limit kept."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from host_scenes import make_scene
from motion_paths import joint
from planarm.model.arm import Arm
from planarm.search.path import Path as TipPath
from planarm.smoothing.joint_blend import blend_poses
from planarm.smoothing.smooth import smooth_path
from planarm.trajectory.check import limit_use
from planarm.trajectory.limits import Limits
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.free_map import build_free_map
from planarm.workspace.joint_proof import joint_world

FILES = sorted((Path(__file__).resolve().parents[1] / "data" / "paths").glob("*.toml"))
SCENE = make_scene()
OPEN_MAP = build_free_map(SCENE)
TOLERANCE_CM = 0.5


def smooth(data):
    arm, world = Arm.from_spec(SCENE.arm), joint_world(SCENE)
    points, stop = np.array(data["points"]), data.get("corners") == "stop"
    if data["kind"] == "joint":
        return blend_poses(points, arm, world, None if stop else TOLERANCE_CM)
    return smooth_path(TipPath.through(points, "up"), OPEN_MAP, arm, world, TOLERANCE_CM, stop=stop)


def test_the_files_are_there():
    assert len(FILES) >= 10


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_it_is_timed_within_the_limits_and_as_the_closed_form_says(file):
    data = tomllib.loads(file.read_text(encoding="utf-8"))
    path = smooth(data)
    limits = Limits.of_joints([joint(), joint()], 1.0)
    made = fastest_motion(path, limits)
    assert len(path.stops_s) == data["stops"]
    assert np.isfinite(made.t_s).all()
    if "duration_s" in data:
        assert made.duration_s == pytest.approx(data["duration_s"], rel=0.01)
    if made.duration_s > 0.0:
        assert limit_use(made, limits).largest <= 1.0 + 1e-9
        assert (np.diff(made.t_s) > 0.0).all()
        ends = made.sample([0.0, made.duration_s])[0]
        assert ends == pytest.approx(path.evaluate(path.borders_s[[0, -1]]).q_rad, abs=1e-9)
