"""Joint paths that the tests of timing and stepping share, and paths of the tip at random."""

from math import pi

import numpy as np

from host_scenes import make_scene
from planarm.scene import JointSpec
from planarm.search.path import Path
from planarm.smoothing.blend import blend_corners
from planarm.smoothing.smooth_path import JointState
from planarm.workspace.free_map import build_free_map


def joint(speed=2.0, acceleration=10.0, usteps_per_rev=16_000):
    """A joint with a whole number of micro-steps a turn."""
    return JointSpec(200, 16, usteps_per_rev / 3200.0, "a4988", speed, acceleration)


class JointCurve:
    """A path given by q(s) and its derivatives as functions of an array; one piece, or more with `borders`."""

    def __init__(self, q, dq, ddq, borders=(0.0, 1.0), stops=()):
        self.functions = (q, dq, ddq)
        self.borders_s = np.array(borders, np.float64)
        self.stops_s = np.array(stops, np.float64)

    def evaluate(self, s, side="right"):
        s = np.asarray(s, np.float64)
        return JointState(*(np.stack([f + 0.0 * s for f in function(s)], axis=1) for function in self.functions))

    def place(self, s):
        return f"s = {s:.3f}"


def joint_line(start, goal):
    """Both joints on a straight line in joint space."""
    start, way = np.array(start, np.float64), np.subtract(goal, start)
    return JointCurve(
        lambda s: [q + w * s for q, w in zip(start, way, strict=True)],
        lambda s: list(way),
        lambda s: [0.0 * w for w in way],
    )


def waves(rng):
    """A smooth curve: sums of three sines in each joint, none of them at rest for long."""
    sizes, rates, phases = rng.uniform(0.05, 0.5, (3, 2)), rng.uniform(0.5, 4.0, (3, 2)), rng.uniform(0, 2 * pi, (3, 2))

    def total(f, power):
        return lambda s: [
            sum(sizes[k, j] * rates[k, j] ** power * f(rates[k, j] * s + phases[k, j]) for k in range(3))
            for j in range(2)
        ]

    return JointCurve(total(np.sin, 0), total(np.cos, 1), total(lambda x: -np.sin(x), 2), borders=(0.0, 2.0, 5.0))


def joint_waves(rng, joints):
    """The same for any number of joints, all of whose derivatives are told by the sines themselves."""
    sizes, rates = rng.uniform(0.2, 0.8, (3, joints)), rng.uniform(1.0, 5.0, (3, joints))
    phases = rng.uniform(0.0, 2.0 * pi, (3, joints))

    def derivative(order):
        def of(s):
            angles = rates[:, :, None] * np.asarray(s) + phases[:, :, None] + order * pi / 2.0
            return list((sizes[:, :, None] * rates[:, :, None] ** order * np.sin(angles)).sum(axis=0))

        return of

    return JointCurve(derivative(0), derivative(1), derivative(2))


def tip_points(rng, count, least=16.0, greatest=48.0):
    """Way-points of the tip whose straight moves stay out of the inner hole of the 30 + 20 cm arm."""
    points = []
    direction = rng.uniform(0.0, 0.5)
    while len(points) < count:
        r = rng.uniform(least, greatest)
        point = r * np.array([np.cos(direction), np.sin(direction)])
        if not points or _distance_to_base(points[-1], point) > 12.0:
            points.append(point)
        direction += rng.uniform(-0.4, 0.8)
    return np.array(points)


def _distance_to_base(a, b):
    along = b - a
    share = np.clip(-(a @ along) / (along @ along), 0.0, 1.0)
    return float(np.hypot(*(a + share * along)))


OPEN_MAP = build_free_map(make_scene(limits=((-2 * pi, 3 * pi), (-pi, pi)), cell=5.0))
"""The 30 + 20 cm arm, elbow up, without obstacles or limits."""


def tip_path(points, tolerance_cm=0.5, free_map=OPEN_MAP):
    """The smooth path through way-points of the tip."""
    return blend_corners(Path.through(np.array(points, np.float64), free_map.elbow), free_map, tolerance_cm)
