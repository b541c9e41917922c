"""Free space over time and the exact search among moving obstacles: `./dev bench moving`.

Both of paper B's environments as shipped, at 1 cm and 2 cm, 100 motion samples, one elbow. Beside them, in one run: the
same maps drawn anew for each sample by the block-wise map of resting obstacles, and by numpy all at once for each
sample; and scipy's breadth-first search on the time-expanded graph, already built, of the edges that the map proves
(2 cm only: at 1 cm the graph takes gigabytes). "between" is what the map between samples takes besides, the price of
the proof; the search's time has its own proofs in it.
"""

from collections.abc import Callable
from dataclasses import replace
from statistics import median
from time import perf_counter
from typing import Final

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from planarm.experiments.scenes import example_file
from planarm.model.moving import offset_cm, sampled_offsets_cm
from planarm.scene import Scene, load_scene
from planarm.search.moving.space_time import search_space_time
from planarm.workspace.cell_poses import DX, DY
from planarm.workspace.free_map import build_free_map
from planarm.workspace.moving_map import MovingMap, build_moving_map, unpacked
from planarm.workspace.world import FREE

RUNS: Final = 9


def main() -> None:
    """Time everything and print one table."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("case", no_wrap=True)
    for name in ("map", "between", "search", "anew", "/ map", "numpy", "/ map", "scipy", "/ search"):
        table.add_column(name, justify="right", no_wrap=True)
    for number in (1, 2):
        for cell_cm in (1.0, 2.0):
            scene = load_scene(example_file(f"moving_env{number}.toml"))
            shifted = _on_even_nodes(replace(scene, workspace=replace(scene.workspace, cell_cm=cell_cm)))
            table.add_row(f"env {number}, {cell_cm:g} cm", *row(shifted))
    console = Console(width=110)
    console.print("Times in ms, medians of", RUNS, "warm runs; ratios of the others to ours.")
    console.print(table)


def _on_even_nodes(scene: Scene) -> Scene:
    """Move start and goal to nodes of any grid here."""
    ends = {
        key: tuple(2.0 * round(value / 2.0) for value in getattr(scene.task, key)) for key in ("start_cm", "goal_cm")
    }
    return replace(scene, task=replace(scene.task, **ends))


def row(scene: Scene) -> list[str]:
    """Return the cells of one case."""
    side = scene.arm.elbow
    assert side != "either"
    bare_ms = timed(lambda: build_moving_map(scene, side, between=False))
    whole = build_moving_map(scene, side)
    whole_ms = timed(lambda: build_moving_map(scene, side))
    start, goal = whole.cell_at(scene.task.start_cm), whole.cell_at(scene.task.goal_cm)
    search_ms = timed(lambda: search_space_time(whole, start, goal))
    anew_ms, numpy_ms = timed(lambda: anew(scene, whole)), timed(lambda: by_numpy(whole))
    cells = [f"{bare_ms:.1f}", f"{whole_ms - bare_ms:.1f}", f"{search_ms:.1f}"]
    for other in (anew_ms, numpy_ms):
        cells += [f"{other:.0f}", f"{other / bare_ms:.1f}"]
    if whole.cell_cm < 2.0:
        return [*cells, "-", "-"]
    graph, first = time_expanded(whole, start)
    scipy_ms = timed(lambda: breadth_first_order(graph, first, return_predecessors=True))
    return [*cells, f"{scipy_ms:.1f}", f"{scipy_ms / search_ms:.1f}"]


def timed(work: Callable[[], object]) -> float:
    """Return the median time in ms, warm."""
    work()
    times = []
    for _ in range(RUNS):
        began_s = perf_counter()
        work()
        times.append(1e3 * (perf_counter() - began_s))
    return median(times)


def anew(scene: Scene, moving: MovingMap) -> None:
    """Draw each sample's map anew, with obstacles at rest, and hold it against ours."""
    for k in range(moving.clock.samples + 1):
        rested = []
        for obstacle in scene.obstacles:
            dx, dy = offset_cm(obstacle.motion, k * moving.clock.sample_s)
            assert obstacle.center_cm is not None
            place = (obstacle.center_cm[0] + dx, obstacle.center_cm[1] + dy)
            rested.append(replace(obstacle, center_cm=place, motion=None))
        region = build_free_map(replace(scene, obstacles=tuple(rested)), elbow=moving.elbow).region
        if k % 25 == 0:
            assert ((region == FREE) == moving.nodes(k)).all()


def by_numpy(moving: MovingMap) -> NDArray[np.bool_]:
    """Judge every pose at every sample, all poses at once: circles only."""
    poses, arm, clock = moving.poses, moving.arm, moving.clock
    obstacles = moving.obstacles
    offsets = sampled_offsets_cm(obstacles, clock.sample_s * np.arange(clock.samples + 1.0))
    free = np.ones((clock.samples + 1, len(poses.cell)), np.bool_)
    base = np.array([arm.base_x_cm, arm.base_y_cm])
    zero = np.zeros_like(poses.elbow_cm)
    for i, radius in enumerate(obstacles.obstacles.radii_cm):
        for k in range(clock.samples + 1):
            center = obstacles.obstacles.centers_cm[i] + offsets[i, k] - base
            for a, b in ((zero, poses.elbow_cm), (poses.elbow_cm, poses.tip_cm)):
                along = b - a
                share = np.clip(((center - a) * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
                apart = np.hypot(*(center - a - share[:, None] * along).T)
                free[k] &= apart > radius + arm.margin_cm
    return free


def time_expanded(moving: MovingMap, start: int) -> tuple[csr_array, int]:
    """Return the graph of all edges that the map proves, a state a sample and pose, and the start's state."""
    poses, count = moving.poses, len(moving.poses.cell)
    rows, ends = [], []
    for k in range(moving.clock.samples):
        stay = np.flatnonzero(unpacked(moving.stay[k], poses.columns).ravel()[poses.cell])
        room = unpacked(moving.room[k], poses.columns).ravel()[poses.cell]
        rows.append(k * count + stay)
        ends.append((k + 1) * count + stay)
        for d in range(8):
            has = np.flatnonzero(((poses.moves >> np.uint8(d)) & 1).astype(np.bool_) & room)
            other = poses.place[poses.cell[has] + DY[d] * poses.columns + DX[d]]
            both = room[other]
            rows.append(k * count + has[both])
            ends.append((k + 1) * count + other[both])
    row, end = np.concatenate(rows), np.concatenate(ends)
    size = (moving.clock.samples + 1) * count
    return csr_array((np.ones(len(row), np.int8), (row, end)), shape=(size, size)), int(poses.place[start])


if __name__ == "__main__":
    main()
