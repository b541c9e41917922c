"""How fast motions are timed, and how fast they are: ours, toppra, and a stop at every point: `./dev bench timing`.

The two tasks of paper C's case 1 that the planner benchmarks use, with joints of 2 rad/s and 10 rad/s^2, all of the
acceleration. Times are medians of warm runs in this one process, in CPU time: compare the ratios. "beyond" is the
largest use of a limit on a grid ten times denser than the finest here; 1 is the limit. toppra gets the path as its
derivatives, so that all time the very same path. The last table optimises the path itself, for thin links and for those
of the example, at both shares of the acceleration.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from math import pi
from statistics import median
from time import perf_counter, process_time

import numpy as np
import toppra
from rich.console import Console
from rich.table import Table

from planarm.experiments.scenes import table1_scene
from planarm.fastest.search import Budget, find_fastest
from planarm.fastest.task import scene_task
from planarm.motions.margin import planning_margin_cm
from planarm.routes.route import smoothed, tip_route
from planarm.scene import Scene
from planarm.smoothing.smooth_path import Floats, SmoothPath
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.timing import fastest_motion

PAIRS = (((45.0, 5.0), (-45.0, 5.0)), ((25.0, 42.0), (-25.0, 42.0)))
GRIDPOINTS = (300, 1000, 3000)
DENSE = 30_000
FIRST_ROUNDS = 2


class ForToppra(toppra.interpolator.AbstractGeometricPath):
    """One of our paths, as toppra asks for it."""

    def __init__(self, path: SmoothPath) -> None:
        self.path = path

    def __call__(self, path_positions: float | Floats, order: int = 0) -> Floats:
        """Return angles or a derivative."""
        return self.path.evaluate(np.atleast_1d(path_positions))[order].reshape(*np.shape(path_positions), -1)

    @property
    def dof(self) -> int:
        """The number of joints."""
        return 2

    @property
    def path_interval(self) -> Floats:
        """First and last path parameter."""
        return self.path.borders_s[[0, -1]]

    @property
    def waypoints(self) -> tuple[Floats, Floats]:
        """The borders."""
        return self.path.borders_s, self.path.evaluate(self.path.borders_s).q_rad


def by_toppra(path: SmoothPath, scene: Scene, gridpoints: int) -> Trajectory:
    """Return toppra's motion, as a trajectory of constant path acceleration between its gridpoints."""
    speeds = np.array([joint.max_speed_rad_s for joint in scene.joints])
    accelerations = np.array([joint.max_acceleration_rad_s2 for joint in scene.joints])
    grid = np.linspace(*path.borders_s[[0, -1]], gridpoints)
    solver = toppra.algorithm.TOPPRA(
        [
            toppra.constraint.JointVelocityConstraint(np.stack([-speeds, speeds], axis=1)),
            toppra.constraint.JointAccelerationConstraint(np.stack([-accelerations, accelerations], axis=1)),
        ],
        ForToppra(path),
        gridpoints=grid,
        solver_wrapper="seidel",
    )
    _, rates, _ = solver.compute_parameterization(0.0, 0.0)
    t_s = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(grid) / (rates[1:] + rates[:-1]))])
    return Trajectory(path, t_s, grid, rates, path.evaluate(grid).q_rad)


def beyond(motion: Trajectory, limits: Limits) -> float:
    """Return the largest use of a limit, by speeds and accelerations at dense times."""
    t_s = np.linspace(0.0, motion.duration_s, DENSE)
    _, speeds, accelerations = motion.sample(t_s)
    use = np.abs(speeds) / limits.speeds_rad_s, np.abs(accelerations) / limits.accelerations_rad_s2
    return float(max(part.max() for part in use))


def timed(run: Callable[[], Trajectory], repeats: int) -> tuple[Trajectory, float]:
    """Return a run's result and the median of its CPU times in ms."""
    result = run()
    spent = []
    for _ in range(repeats):
        began = process_time()
        run()
        spent.append(1e3 * (process_time() - began))
    return result, median(spent)


def compare(console: Console, scene: Scene, repeats: int) -> None:
    """Time one grid path by all means, and print the table."""
    limits = Limits.of_joints(scene.joints, 1.0)
    bare = replace(
        limits,
        speeds_rad_s=np.array([j.max_speed_rad_s for j in scene.joints]),
        accelerations_rad_s2=np.array([j.max_acceleration_rad_s2 for j in scene.joints]),
    )
    route = tip_route(scene, planning_margin_cm(scene))
    blended, path = route.smooth, route.path
    stopping = smoothed(replace(scene, motion=replace(scene.motion, corners="stop")), route.free_map, path)
    start, goal = scene.task.start_cm, scene.task.goal_cm
    table = Table("", "duration s", "ms", "beyond", title=f"{start} -> {goal}, path {path.length_cm:.2f} cm")
    rows: list[tuple[str, Callable[[], Trajectory]]] = [
        ("ours, checked and repaired", lambda: fastest_motion(blended, limits)),
        ("ours, first answer", lambda: fastest_motion(blended, limits, rounds=FIRST_ROUNDS)),
        *((f"toppra, {n} gridpoints", lambda n=n: by_toppra(blended, scene, n)) for n in GRIDPOINTS),  # type: ignore[misc]
        ("ours, a stop at every corner", lambda: fastest_motion(stopping, limits)),
    ]
    for name, run in rows:
        motion, ms = timed(run, repeats)
        table.add_row(name, f"{motion.duration_s:.4f}", f"{ms:.2f}", f"{beyond(motion, bare):.4f}")
    console.print(table)


def optimise(console: Console, budget_s: float) -> None:
    """Optimise the paths themselves, and print the table."""
    table = Table(
        "task", "links cm wide", "share", "duration s", "found after s", title=f"optimised, at most {budget_s:g} s"
    )
    everywhere = ((-pi / 2, 1.5 * pi), (-pi, pi))
    example = table1_scene(1)
    for start, goal in PAIRS:
        for width in (0.01, example.arm.link_width_cm):
            for share in (1.0, 0.8):
                arm = replace(example.arm, link_width_cm=width, joint_limits_rad=everywhere)
                scene = replace(example, arm=arm, task=replace(example.task, start_cm=start, goal_cm=goal))
                limits = Limits.of_joints(scene.joints, share)
                found: list[tuple[float, float]] = []
                began = perf_counter()

                def told(
                    _share: float, best_s: float, found: list[tuple[float, float]] = found, began: float = began
                ) -> None:
                    if not found or best_s < found[-1][1] * 0.999:
                        found.append((perf_counter() - began, best_s))

                task = scene_task(scene, planning_margin_cm(scene), limits)
                spline = find_fastest(task, [], Budget(budget_s), 1, perf_counter, told)
                assert spline is not None
                motion = fastest_motion(spline, limits)
                table.add_row(
                    f"{start} -> {goal}", f"{width:g}", f"{share:g}", f"{motion.duration_s:.4f}", f"{found[-1][0]:.2f}"
                )
    console.print(table)


def main() -> None:
    """Parse and run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=21, help="warm runs of each")
    parser.add_argument("--budget", type=float, default=5.0, help="seconds of optimising for each row; 0 leaves it out")
    options = parser.parse_args()
    console = Console()
    toppra.setup_logging("ERROR")
    example = table1_scene(1)
    for start, goal in PAIRS:
        compare(console, replace(example, task=replace(example.task, start_cm=start, goal_cm=goal)), options.repeats)
    if options.budget > 0.0:
        optimise(console, options.budget)


if __name__ == "__main__":
    main()
