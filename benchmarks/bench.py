"""`./dev bench bench`: the bench (Uno, drivers, motors, arm of two links) against real time, and what the arm costs.

Paper C's first case is streamed by the host to the emulated board, without and with the arm around it; then the bytes
that it wrote are played again at their cycles, so that the host's own work is not counted. CPU time of one core;
kernels compiled before.
"""

# ruff: noqa: T201 - it prints its results

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from statistics import median
from time import process_time

from planarm.link.arm_record import ArmSetup
from planarm.link.exchange import stream_plan
from planarm.link.released_image import released_image
from planarm.link.sim_bench import build_bench
from planarm.link.sim_transport import SimTransport
from planarm.notice import silent
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm_sim import Uno
from planarm_wire.messages import Segment

CASE1 = Path(__file__).resolve().parents[1] / "examples" / "table1_case1.toml"
RUNS = 5


def main() -> None:
    """Measure and print."""
    plan = plan_scene(load_scene(CASE1), silent)
    setup = ArmSetup(plan.scene, plan.segments.start_usteps)
    rows = []
    for what, arm in (("Uno", None), ("Uno + drivers + motors + arm", setup)):
        lines = [streamed(plan.segments.segments, arm) for _ in range(RUNS + 1)][1:]
        rows.append((f"{what}, streaming", median(ratio for _, ratio in lines)))
        rows.append((f"{what}, bytes played", median(played(line, arm) for line, _ in lines)))
    for what, ratio in rows:
        print(f"{what:42s} {ratio:6.1f} x real time, median of {RUNS}")
    print(f"{'the arm takes':42s} {1.0 / rows[3][1] - 1.0 / rows[1][1]:6.3f} s for each emulated second")


class RecordedLine(SimTransport):
    """The emulated line, with what the host wrote and when."""

    def __init__(self, setup: ArmSetup | None) -> None:
        super().__init__(released_image(), 250_000, setup)
        self.written: list[tuple[int, bytes]] = []

    def write(self, data: bytes) -> None:
        """Note the cycle and pass the bytes on."""
        self.written.append((self.uno.cycle, data))
        super().write(data)


def streamed(segments: tuple[Segment, ...], setup: ArmSetup | None) -> tuple[RecordedLine, float]:
    """Stream a plan; return the line, and emulated seconds for each second of CPU time."""
    with closing(RecordedLine(setup)) as line:
        began_s = process_time()
        stream_plan(line, segments)
        if line.arm is not None:
            line.arm.record()
        return line, line.clock.now_s() / (process_time() - began_s)


def played(line: RecordedLine, setup: ArmSetup | None) -> float:
    """Play the bytes to a new board, with the same arm; return emulated seconds for each second of CPU time."""
    uno = Uno.from_hex(released_image())
    machine = uno if setup is None else build_bench(uno, setup)[0]
    began_s = process_time()
    for cycle, data in line.written:
        machine.run(cycles=max(0, cycle - uno.cycle))
        uno.serial.write(data)
    machine.run(cycles=max(0, line.uno.cycle - uno.cycle))
    took_s = process_time() - began_s
    assert uno.edges("D9").tolist() == line.uno.edges("D9").tolist(), "the same edges again"
    return uno.time_s / took_s


if __name__ == "__main__":
    main()
