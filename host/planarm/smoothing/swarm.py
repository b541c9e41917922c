"""Particle swarm over via-points of a path in space and time (paper B, section 5).

A particle moves some of the path's nodes, which keep their times; a cubic spline of time through start, via-points and
goal, at rest at both ends, is the tip's curve. Its cost is its length; it is infeasible when a link touches an obstacle
at its time, or the joints cannot follow. The path itself is a member of the swarm from the beginning, so nothing longer
is ever returned. A curve becomes the swarm's best only when it is proved free.

The paper's w = 1 with c1 + c2 = 4 does not converge, and it describes the inertia weight backwards: a large one favours
the wide search. The default takes the constriction weights of Clerc and Kennedy (2002).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.random import Generator
from scipy.interpolate import CubicSpline

from planarm.model.arm import Arm
from planarm.scene import Scene
from planarm.search.moving.timed_path import TimedPath
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.smooth_path import Floats
from planarm.smoothing.swarm_cost import Pace, curve_costs
from planarm.smoothing.timed_spline import HEADROOM, from_tips, judge, tip_length_cm
from planarm.workspace.moving_map import MovingMap

POINTS_PER_SAMPLE = 6


@dataclass(frozen=True, slots=True)
class SwarmSettings:
    """How the swarm flies."""

    inertia: float = 0.7298
    cognitive: float = 1.4962
    social: float = 1.4962
    particles: int = 50
    iterations: int = 100
    via_points: int = 5
    largest_shift_cm: float = 12.0
    """A via-point stays this near to its node in x and in y: the paper's pos_max."""
    speed_share: float = 0.3
    """The paper's k: a via-point moves at most this share of the largest shift in one iteration."""
    random_vias: bool = False
    """Draw the via-points from the path, as the paper does; else they are spread evenly."""


PAPER = SwarmSettings(inertia=1.0, cognitive=1.0, social=3.0, random_vias=True)
"""The paper's settings: found there by trial and error."""


@dataclass(frozen=True, slots=True, eq=False)
class SwarmResult:
    """What a swarm found."""

    spline: JointSpline | None
    """The motion; None when nothing shorter than the path was found feasible."""
    length_cm: float
    """Of the tip's curve, or of the path itself."""
    curve_cm: tuple[float, ...]
    """The best length after each iteration, the path's before the first (paper B, Figs. 7b and 13b)."""
    feasible: int
    """Curves that were shorter than their particle's best and feasible at their points."""


def fly(
    scene: Scene,
    moving_map: MovingMap,
    path: TimedPath,
    rng: Generator,
    settings: SwarmSettings | None = None,
    *,
    limited: bool = True,
    bar_cm: float | None = None,
) -> SwarmResult:
    """Return the shortest motion that a swarm finds around a path.

    Args:
        scene: the joints and their limits.
        moving_map: the obstacles, the margin and the delay margin.
        path: the path to shorten; its times are kept.
        rng: where all chance comes from.
        settings: how the swarm flies.
        limited: keep the joints' speeds and accelerations.
        bar_cm: what a curve must be shorter than; None takes the path's length.
    """
    settings = settings or SwarmSettings()
    bar_cm = path.length_cm if bar_cm is None else bar_cm
    vias = _vias(path, settings, rng)
    if not len(vias):
        return SwarmResult(None, bar_cm, (bar_cm,) * (settings.iterations + 1), 0)
    flight = _Flight(scene, moving_map, path, vias, settings, limited)
    largest = settings.largest_shift_cm
    shifts = np.clip(_first_shifts(path, vias, flight.straight, settings, rng), -largest, largest)
    speeds = rng.uniform(-1.0, 1.0, shifts.shape) * settings.speed_share * largest
    best, bars = shifts.copy(), np.full(settings.particles, bar_cm)
    leader, length_cm, spline, feasible = np.zeros_like(shifts[0]), bar_cm, None, 0
    curve = [length_cm]
    for _ in range(settings.iterations):
        costs, tips = flight.costs(shifts, bars)
        better = np.flatnonzero(costs < inf)
        feasible += len(better)
        best[better], bars[better] = shifts[better], costs[better]
        for p in better[np.argsort(costs[better])]:
            if costs[p] >= length_cm:
                break
            proved = flight.proved(tips[p], length_cm)
            if proved is not None:
                leader, (spline, length_cm) = shifts[p].copy(), proved
                break
        curve.append(length_cm)
        pull, drive = rng.random(shifts.shape), rng.random(shifts.shape)
        speeds = settings.inertia * speeds
        speeds += settings.cognitive * pull * (best - shifts) + settings.social * drive * (leader - shifts)
        speeds = np.clip(speeds, -settings.speed_share * largest, settings.speed_share * largest)
        shifts = np.clip(shifts + speeds, -largest, largest)
    return SwarmResult(spline, length_cm, tuple(curve), feasible)


def _vias(path: TimedPath, settings: SwarmSettings, rng: Generator) -> np.ndarray:
    """Return the samples of the via-points: inner ones of the path, ascending."""
    inner = path.arrival - 1
    count = min(settings.via_points, inner)
    if count <= 0:
        return np.zeros(0, np.int64)
    if settings.random_vias:
        return np.sort(rng.choice(np.arange(1, path.arrival), count, replace=False))
    return np.unique(np.round(np.linspace(0, path.arrival, count + 2)[1:-1]).astype(np.int64))


def _first_shifts(
    path: TimedPath, vias: np.ndarray, straight: Floats, settings: SwarmSettings, rng: Generator
) -> Floats:
    """Return where the particles begin: the first on the path itself.

    The paper's others are on nodes of the path drawn near their own. Ours are anywhere within the largest shift, and
    the second pulls the path straight.
    """
    shape = (settings.particles, len(vias), 2)
    if settings.random_vias:
        near = max(1, path.arrival // (2 * len(vias) + 2))
        drawn = np.clip(vias + rng.integers(-near, near + 1, shape[:2]), 0, path.arrival)
        shifts = path.points_cm[drawn] - path.points_cm[vias]
    else:
        shifts = rng.uniform(-settings.largest_shift_cm, settings.largest_shift_cm, shape)
        shifts[1:2] = straight
    shifts[0] = 0.0
    return np.asarray(shifts)


class _Flight:
    """What stays the same while a swarm flies: times, the spline's basis, and what curves are judged by."""

    def __init__(
        self,
        scene: Scene,
        moving_map: MovingMap,
        path: TimedPath,
        vias: np.ndarray,
        settings: SwarmSettings,
        limited: bool,
    ) -> None:
        self._scene, self._map, self._path, self._limited = scene, moving_map, path, limited
        self._arm = Arm.from_spec(scene.arm)
        sample_s = moving_map.clock.sample_s
        knots = np.concatenate([[0], vias, [path.arrival]])
        self._nodes = path.points_cm[knots]
        self._times_s = sample_s * np.arange(POINTS_PER_SAMPLE * path.arrival + 1) / POINTS_PER_SAMPLE
        self._basis = CubicSpline(sample_s * knots, np.eye(len(knots)), bc_type="clamped")(self._times_s)
        shares = (vias / path.arrival)[:, None]
        chord = path.points_cm[0] + shares * (path.points_cm[-1] - path.points_cm[0])
        self.straight: Floats = chord - path.points_cm[vias]
        share = HEADROOM * scene.motion.acceleration_share
        speed1, speed2 = (HEADROOM * j.max_speed_rad_s if limited else inf for j in scene.joints)
        bend1, bend2 = (share * j.max_acceleration_rad_s2 if limited else inf for j in scene.joints)
        step_s = sample_s / POINTS_PER_SAMPLE
        self._pace = Pace(step_s, moving_map.clock.delay_s, (speed1, speed2), (bend1, bend2))

    def costs(self, shifts: Floats, bars_cm: Floats) -> tuple[Floats, Floats]:
        """Return each particle's cost, infinite unless below its bar, and its curve's points."""
        knots = np.repeat(self._nodes[None], len(shifts), axis=0)
        knots[:, 1:-1] += shifts
        tips = np.ascontiguousarray(np.einsum("mk,pkx->pmx", self._basis, knots))
        costs = np.empty(len(shifts))
        curve_costs(self._map.arm, self._map.obstacles, self._pace, tips, bars_cm, costs)
        return costs, tips

    def proved(self, tips_cm: Floats, below_cm: float) -> tuple[JointSpline, float] | None:
        """Return the motion along a curve and its length when it is shorter than `below_cm` and proved, else None."""
        spline = from_tips(self._arm, self._path, self._times_s, tips_cm)
        if spline is None:
            return None
        length_cm = tip_length_cm(spline)
        if length_cm >= below_cm or judge(self._scene, self._map, spline, limited=self._limited).problem:
            return None
        return spline, length_cm
