"""How late a thread that streams is woken while a motion is planned beside it: `./dev bench beside [--trials N]`.

One thread wakes every millisecond and works for a fifth of one, as a stream that is served does. Meanwhile the way on
from a border of a motion that runs is planned and certified, past an obstacle that appeared: by nobody, by another
process (which shares the machine, not Python's interpreter), by another thread (which shares both). "late" is how
much later than asked for the first thread woke. Kernels let go of the interpreter, so it is late by what the planner's
Python takes in one go. Kernels are compiled before.
"""

import argparse
import multiprocessing
import time
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import closing
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.shapes import shape_of
from planarm.motions.margin import planning_margin_cm
from planarm.notice import silent
from planarm.operations.beside import InThread
from planarm.operations.replanning import first_plan
from planarm.operations.splicing import borders_from, first_border, plan_from_borders
from planarm.scene import Obstacle, load_scene

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SCENES = ("energy_two_links", "three_links")
EVERY_S, WORKS_S = 1e-3, 0.2e-3
TRIALS = 20


def main() -> None:
    """Measure and print one table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--trials", type=int, default=TRIALS, help="plans of each kind (default: %(default)s)")
    trials = parser.parse_args().trials
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("planned by", no_wrap=True)
    for name in ("plan ms", "late ms: median", "p95", "p99", "worst of a plan: median", "most"):
        table.add_column(name, justify="right")
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as process:
        table.add_row("nobody", *row(lambda: process.submit(time.sleep, 0.1), trials))
        for name in SCENES:
            process.submit(plan, name).result()
            table.add_row(f"{name}, a process", *row(partial(process.submit, plan, name), trials))
            plan(name)
            with closing(InThread()) as thread:
                table.add_row(f"{name}, a thread", *row(partial(thread.begin, partial(plan, name), 0.0), trials))
    Console(width=110).print(table)


def plan(name: str) -> None:
    """Plan the way on."""
    prepared(name)()


@cache
def prepared(name: str) -> Callable[[], object]:
    """Return the work: an example without its obstacles, a roadmap, a plan, and a circle that appears on its way."""
    scene = replace(load_scene(EXAMPLES / f"{name}.toml"), obstacles=())
    margin_cm = planning_margin_cm(scene)
    task, before = first_plan(scene, silent)
    end_s = before.trajectory.duration_s
    x_cm, y_cm = forward(Arm.from_spec(scene.arm), before.trajectory.sample(np.array([0.7 * end_s]))[0])[0, -1]
    obstacle = Obstacle("circle", (float(x_cm), float(y_cm)), 2.0)
    _, changes = task.roadmap.add_obstacle(shape_of(obstacle))
    task.planner.change(changes)
    first = first_border(before, 1, 0.1)
    assert first is not None, "a motion of some seconds has borders"
    borders = borders_from(before, first, 0.5 * end_s)
    return partial(plan_from_borders, replace(scene, obstacles=(obstacle,)), task, before, borders, 0.05, margin_cm)


def row(begin: Callable[[], Future[None]], trials: int) -> list[str]:
    """Return the table's figures of so many pieces of work."""
    took_ms, late_ms, worst_ms = [], [], []
    for _ in range(trials):
        began_s = time.perf_counter()
        late = 1e3 * np.array(wake_beside(begin()))
        took_ms.append(1e3 * (time.perf_counter() - began_s))
        late_ms.append(late)
        worst_ms.append(late.max())
    all_ms = np.concatenate(late_ms)
    figures = (np.median(took_ms), *np.quantile(all_ms, (0.5, 0.95, 0.99)), np.median(worst_ms), max(worst_ms))
    return [f"{figure:.2f}" for figure in figures]


def wake_beside(work: Future[None]) -> list[float]:
    """Wake again and again until the work is done; return how late each time, in seconds."""
    late_s = []
    while not work.done():
        due_s = time.perf_counter() + EVERY_S
        time.sleep(EVERY_S)
        now_s = time.perf_counter()
        late_s.append(now_s - due_s)
        while time.perf_counter() < now_s + WORKS_S:
            pass
    work.result()
    return late_s


if __name__ == "__main__":
    main()
