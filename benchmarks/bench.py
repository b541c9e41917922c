"""`./dev bench bench`: the bench (Uno, drivers, motors, arm of two links) against real time, and what the arm costs.

Paper C's first case is streamed by the host to the emulated board, without and with the arm around it. CPU time of one
core; kernels compiled before.
"""

# ruff: noqa: T201 - it prints its results

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from statistics import median
from time import process_time

from planarm.link.arm_record import ArmSetup
from planarm.link.exchange import stream_plan
from planarm.link.transport import open_transport
from planarm.pipeline import plan_scene
from planarm.scene import load_scene

CASE1 = Path(__file__).resolve().parents[1] / "examples" / "table1_case1.toml"
RUNS = 5


def main() -> None:
    """Measure and print."""
    plan = plan_scene(load_scene(CASE1), lambda _stage, _share: None)
    setup = ArmSetup(plan.scene, plan.segments.start_usteps)
    rows = []
    for what, arm in (("Uno, streaming", None), ("Uno + drivers + motors + arm, streaming", setup)):
        ratios = [times_real_time(plan.segments.segments, arm) for _ in range(RUNS + 1)][1:]
        rows.append((what, median(ratios)))
    for what, ratio in rows:
        print(f"{what:42s} {ratio:6.1f} x real time, median of {RUNS}")
    print(f"{'the arm takes':42s} {1.0 / rows[1][1] - 1.0 / rows[0][1]:6.3f} s for each emulated second")


def times_real_time(segments: tuple, setup: ArmSetup | None) -> float:
    """Return emulated seconds for each second of CPU time."""
    with closing(open_transport("sim://", 250_000, setup)) as line:
        began_s = process_time()
        stream_plan(line, segments)
        if line.arm is not None:
            line.arm.record()
        return line.clock.now_s() / (process_time() - began_s)


if __name__ == "__main__":
    main()
