"""Obstacles that appear: lists with times, files that are written meanwhile."""

import os

import pytest

from planarm.errors import SceneError
from planarm.operations.arrivals import Listed, Watched
from planarm.scene import Obstacle
from planarm.scene.arrivals import Arrival, load_arrivals

CIRCLE = '[[obstacles]]\nshape = "circle"\ncenter_cm = [1, 2]\ndiameter_cm = 3\n'
SQUARE = '[[obstacles]]\nat_s = 0.5\nshape = "square"\ncenter_cm = [4, 5]\ndiameter_cm = 6\n'


def written(path, text):
    path.write_text(text)
    before = path.stat()
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns + 1000))
    return path


def test_a_file_of_obstacles_with_times(tmp_path):
    one, two = load_arrivals(written(tmp_path / "a.toml", CIRCLE + SQUARE))
    assert one == Arrival(0.0, Obstacle("circle", (1.0, 2.0), 3.0))
    assert two.at_s == 0.5
    assert two.obstacle.shape == "square"


def test_each_comes_once_and_when_its_time_has_come(tmp_path):
    source = Listed(load_arrivals(written(tmp_path / "a.toml", SQUARE + CIRCLE)))
    assert [one.shape for one in source.new(0.1)] == ["circle"]
    assert list(source.new(0.49)) == []
    assert [one.shape for one in source.new(0.5)] == ["square"]
    assert list(source.new(9.0)) == []


def test_what_is_added_to_a_watched_file_is_new(tmp_path):
    path = tmp_path / "seen.toml"
    source = Watched(path)
    assert list(source.new(0.0)) == []
    written(path, CIRCLE)
    assert [one.shape for one in source.new(0.1)] == ["circle"]
    assert list(source.new(0.2)) == []
    written(path, CIRCLE + SQUARE)
    assert [one.shape for one in source.new(0.3)] == ["square"]


def test_a_watched_file_that_is_half_written_is_looked_at_again(tmp_path):
    path = written(tmp_path / "seen.toml", CIRCLE[: CIRCLE.index("2]")])
    source = Watched(path)
    assert list(source.new(0.0)) == []
    assert "not valid TOML" in source.problem
    written(path, CIRCLE)
    assert len(source.new(0.1)) == 1
    assert source.problem == ""


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        (CIRCLE + "at_s = -1", "obstacles[1].at_s", "at least"),
        ("[[obstacles]]\nshape = 'blob'", "obstacles[1].shape", "'circle'"),
        ("[[things]]", "things", "unknown key"),
        ("obstacles = 3", "obstacles", "two brackets"),
    ],
)
def test_what_is_wrong_is_named(text, key, words, tmp_path):
    with pytest.raises(SceneError) as caught:
        load_arrivals(written(tmp_path / "a.toml", text))
    assert caught.value.key == key
    assert words in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SceneError, match="cannot be read"):
        load_arrivals(tmp_path / "none.toml")
