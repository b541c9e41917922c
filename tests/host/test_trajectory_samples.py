"""What is known of a path on a grid stays what the path itself says, however the grid was refined."""

import numpy as np

from motion_paths import tip_path, tip_points
from planarm.trajectory.samples import SUBSTEPS, halve_some, take_samples


def test_refined_samples_are_those_taken_anew():
    rng = np.random.default_rng(5)
    path = tip_path(tip_points(rng, 8))
    s = np.unique(np.concatenate([path.borders_s, rng.uniform(0.0, path.borders_s[-1], 40)]))
    samples = take_samples(path, s[:-1], s[1:])
    for _ in range(4):
        split = rng.random(len(s) - 1) < 0.3
        s, samples = halve_some(path, s, samples, split)
        for kept, anew in zip(samples, take_samples(path, s[:-1], s[1:]), strict=True):
            np.testing.assert_array_equal(kept, anew)


def test_ends_are_seen_from_inside():
    path = tip_path(tip_points(np.random.default_rng(6), 8))
    samples = take_samples(path, path.borders_s[:-1], path.borders_s[1:])
    assert samples.q_rad.shape[1] == SUBSTEPS + 1
    for inside, side, s in ((samples.starts, "right", path.borders_s[:-1]), (samples.ends, "left", path.borders_s[1:])):
        for values, expected in zip(inside, path.evaluate(s, side), strict=True):
            np.testing.assert_array_equal(values, expected)
