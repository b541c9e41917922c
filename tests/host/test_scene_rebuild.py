"""A scene survives the way through a plan file whole."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from planarm.scene import load_scene
from planarm.scene.rebuild import scene_from_mapping

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_every_example_comes_back_equal(path):
    scene = load_scene(path)
    assert scene_from_mapping(json.loads(json.dumps(asdict(scene)))) == scene


def test_a_mapping_that_lacks_a_field_is_refused():
    mapping = asdict(load_scene(EXAMPLES[0]))
    del mapping["task"]
    with pytest.raises(KeyError, match="task"):
        scene_from_mapping(mapping)
