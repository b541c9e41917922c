"""What the firmware does, beside its peers: `./dev bench firmware [--seconds 10]`.

Everything of ours is measured here, on the released image on the emulated Uno; deviations are those of every rising
edge from its scheduled 62.5 ns tick. The peers' figures were measured once, two axes at 1 : 0.618 on one corrected
simulator; ours beside them are the worst of the rows above, and of runs at the peers' rates.
"""

import argparse
import json
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from rich import box
from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "firmware"), str(ROOT / "firmware")]

from build import build_image  # noqa: E402 - firmware/build.py
from test_firmware_boards import steady  # noqa: E402
from test_firmware_stretch import FAST, SEGMENT_TICKS, Player  # noqa: E402

from firmware_board import (  # noqa: E402 - the tests' board
    LEAD_TICKS,
    Board,
    EmulatedFirmware,
    Schedule,
    end_motion,
    run_of,
    segment_of,
)
from firmware_motions import fast, restless  # noqa: E402
from firmware_stack import deepest_stack_bytes  # noqa: E402
from firmware_streamer import Streamer  # noqa: E402
from planarm.stepping.segments import Coding, compress  # noqa: E402
from planarm_wire.codec import encode  # noqa: E402
from planarm_wire.framing import encode_frame  # noqa: E402
from planarm_wire.messages import (  # noqa: E402
    BAUD,
    BOARDS,
    DELIMITER,
    EMERGENCY_CODE,
    EMERGENCY_REPEATS,
    HOLD_CODE,
    HOST_WINDOW_BYTES,
    SLICE_TICKS,
    STEP_PINS,
    TICKS_HZ,
    Config,
    Fault,
    PinMap,
    Segments,
    Start,
)
from planarm_wire.steps import duration_ticks  # noqa: E402
from reference_motion import least_held_ticks, reference_train  # noqa: E402

IMAGE = ROOT / "firmware" / "release" / "uno.hex"
TOLD = json.loads((ROOT / "firmware" / "release" / "uno.json").read_text(encoding="utf-8"))
BYTE_TICKS = 10 * TICKS_HZ // BAUD
PEERS = (
    ("", "planarm", "GRBL 1.1h", "FastAccelStepper", "Klipper MCU"),
    ("highest clean rate, both axes", "{ceiling}", "29 k", "37.6 k (53.3 k, cap lifted)", "44.9 k / 20.9 k streaming"),
    ("beyond it", "refused by the host", "runaway at 42 k", "gaps of 4.1 ms", "shuts down"),
    ("jitter at 1 k, second axis: max", "{jitter_1k}", "63 us", "0", "13 us"),
    ("jitter at 20 k, second axis: max", "{jitter_20k}", "25 us", "0", "21 us"),
    ("step interrupt, cycles", "{step}", "335-410", "120 / 135", "266-654"),
    ("flash", f"{TOLD['flash_bytes']}", "29,864", "12,840", "12,468"),
    ("static SRAM + deepest stack", "{memory}", "1633 + 232", "644 + 150", "398 + 63"),
)


@dataclass(frozen=True, slots=True)
class Run:
    """What became of a motion's steps on one board.

    Attributes:
        name: what was played.
        rate_hz: the faster joint's least interval as a rate; 0 where the row is not of the image for fast drivers.
        fault: latched by the board.
        worst_cycles: largest deviation of any rising edge from its tick.
        edges: rising edges found.
        missing: rising edges that did not come.
        highs_cycles: shortest and longest pulse.
        lost_bytes: received bytes that were lost.
    """

    name: str
    rate_hz: float
    fault: Fault
    worst_cycles: int
    edges: int
    missing: int
    highs_cycles: tuple[int, int]
    lost_bytes: int

    @property
    def is_clean(self) -> bool:
        """Whether every edge came, on its tick."""
        return self.fault is Fault.NONE and self.worst_cycles == self.missing == self.lost_bytes == 0

    def row(self) -> tuple[str, str]:
        """Return the table's row."""
        if self.fault is not Fault.NONE:
            return self.name, self.fault.name
        found = f"{self.worst_cycles} cycles on {self.edges:,} edges, {self.missing} missing"
        shortest, longest = self.highs_cycles
        return self.name, f"{found}; high {shortest} to {longest} cycles; {self.lost_bytes} bytes lost"


def main() -> None:
    """Measure and print two tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of the runs on a saturated line")
    seconds = parser.parse_args().seconds
    runs = [
        saturated("50,000 : 49,816 steps/s", 320, 1.0037, seconds),
        saturated("65,041 : 40,170 steps/s", 246, 65_041 / 40_170, seconds),
        saturated("71,111 : 43,947 steps/s", 225, 1 / 0.618, seconds),
        saturated("71,111 : 70,849 steps/s", 225, 1.0037, seconds),
        cruising("65,041 : 65,000 steps/s", 246, 65_041 / 65_000, seconds),
        cruising("71,111 : 70,849 steps/s", 225, 1.0037, seconds),
        shaken("50,000 steps/s", 320, seconds),
        shaken("71,111 steps/s", 225, seconds),
    ]
    slow = [long_pulses(seconds, "saturated"), long_pulses(seconds, "window kept full")]
    step, interrupts = watched()
    rows = [run.row() for run in runs] + [four_saturated(seconds)] + [run.row() for run in slow]
    rows += [interrupts, hold_latency(), calm_hold_latency(), emergency_latency(), ring()]
    table = Table(title="The firmware on the emulated Uno", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("what")
    table.add_column("found")
    for row in rows:
        table.add_row(*row)
    console = Console(width=160)
    console.print(table)
    filled = {
        "ceiling": ceiling(runs),
        "jitter_1k": jitter(16_000),
        "jitter_20k": jitter(800),
        "step": step,
        "memory": f"{TOLD['sram_bytes']} + {stack_bytes()}",
    }
    peers = Table(title="Beside its peers", title_justify="left", box=box.SIMPLE_HEAD)
    for name in PEERS[0]:
        peers.add_column(name)
    for row in PEERS[1:]:
        peers.add_row(*(cell.format(**filled) for cell in row))
    console.print(peers)


def ceiling(runs: list[Run]) -> str:
    """The highest rate of a clean run below which no run missed a tick, random motions among them."""
    spoilt = min((run.rate_hz for run in runs if run.rate_hz and not run.is_clean), default=float("inf"))
    clean = [run.rate_hz for run in runs if run.rate_hz and run.is_clean and run.rate_hz < spoilt]
    return f"{max(clean) / 1000:.1f} k, streaming" if clean else "none"


def jitter(interval: int) -> str:
    """The second joint's largest deviation, 1 : 0.618, on a line that valid frames saturate."""
    run = saturated("", interval, 1 / 0.618, 1.0)
    if run.fault is not Fault.NONE:
        return run.fault.name
    lost = [
        f"{count} {what}" for count, what in ((run.missing, "edges missing"), (run.lost_bytes, "bytes lost")) if count
    ]
    return ", ".join(lost) or f"{run.worst_cycles / (TICKS_HZ / 1e6):.2g} us"


def stack_bytes() -> str:
    """The deepest path of the call tree, with an interrupt on top."""
    if shutil.which("avr-gcc") is None:
        return "? (avr-gcc is not installed)"
    with TemporaryDirectory() as folder:
        image = build_image(Path(folder), "uno")
        return str(deepest_stack_bytes(image.with_suffix(".elf"))[0])


def looked_at(name: str, rate_hz: float, board: Board, motion: list, fault: Fault, lost_bytes: int) -> Run:
    """Compare every rising edge with its tick."""
    schedule = Schedule.of(motion)
    begin = board.rises(0)[0] - schedule.steps[0][0][0]
    worst = missing = edges = 0
    for joint in range(2):
        found, planned = board.rises(joint), [begin + tick for tick, _ in schedule.steps[joint]]
        edges += len(found)
        missing += len(planned) - len(found)
        worst = max([worst, *(abs(a - b) for a, b in zip(found, planned, strict=False))])
    highs = [
        fall.tick - rise.tick
        for joint in range(2)
        for rise, fall in _pulses([e for e in board.edges if e.pin == STEP_PINS[joint]])
    ]
    return Run(name, rate_hz, fault, worst, edges, missing, (min(highs), max(highs)), lost_bytes)


def _pulses(edges: list) -> list:
    return list(zip(edges[::2], edges[1::2], strict=False))


def saturated(name: str, interval: int, ratio: float, seconds: float, firmware: EmulatedFirmware | None = None) -> Run:
    """Steps at constant rates while valid frames, which the queue has no room for, fill the line without a gap."""
    duration = min(30_000 * interval, round(seconds * TICKS_HZ))
    motion = end_motion(fast(interval, ratio, duration, max(1, round(seconds * TICKS_HZ / duration))))
    board = play_saturated(firmware or EmulatedFirmware(IMAGE), motion, duration)
    status = board.ask()
    title = f"{name}, {duration * len(motion) / TICKS_HZ:.1f} s, line saturated"
    return looked_at(title, TICKS_HZ / interval, board, motion, status.fault, status.overruns)


def cruising(name: str, interval: int, ratio: float, seconds: float) -> Run:
    """Constant rates, streamed with the window kept full."""
    duration = 4 * SLICE_TICKS
    motion = fast(interval, ratio, duration, max(20, round(seconds * TICKS_HZ / duration)))
    return streamed(f"{name}, window kept full", motion, rate_hz=TICKS_HZ / interval)


def shaken(name: str, interval: int, seconds: float) -> Run:
    """What chance makes of both joints down to a least interval, streamed with the window kept full."""
    motion = restless(1, interval, round(145 * seconds))
    return streamed(f"random motion to {name}, window kept full", motion, rate_hz=TICKS_HZ / interval)


def four_saturated(seconds: float) -> tuple[str, str]:
    """Four joints at 15,000 steps/s each while valid frames fill the line without a gap."""
    duration = round(seconds * TICKS_HZ / 8)
    motion = steady("uno_four", TICKS_HZ // 15_000, seconds, duration)
    board = play_saturated(EmulatedFirmware(IMAGE.with_name("uno_four.hex"), BOARDS["uno_four"]), motion, duration)
    status = board.ask()
    schedule = Schedule.of(motion)
    begin = board.rises(0)[0] - schedule.steps[0][0][0]
    off = [
        [rise - begin - tick for rise, (tick, _) in zip(board.rises(joint), steps, strict=False)]
        for joint, steps in enumerate(schedule.steps)
    ]
    told = ", ".join(f"joint {joint + 1} {min(found)} to {max(found)} cycles" for joint, found in enumerate(off))
    missing = sum(map(len, schedule.steps)) - sum(map(len, off))
    fault = "" if status.fault is Fault.NONE else f"{status.fault.name}; "
    return f"four joints at 15,000 steps/s, {seconds:.1f} s, line saturated", f"{fault}{told}; {missing} missing"


def long_pulses(seconds: float, line: str) -> Run:
    """Both joints at the least interval of the image for slow drivers, both edges of every pulse by a match."""
    slow = BOARDS["uno_slow"]
    firmware = EmulatedFirmware(IMAGE.with_name("uno_slow.hex"), slow)
    rate = round(TICKS_HZ / slow.min_interval_ticks)
    name = f"slow drivers, {rate:,} : {rate / 1.0037:,.0f} steps/s, {line}"
    if line == "saturated":
        return saturated(name, slow.min_interval_ticks, 1.0037, seconds, firmware)
    count = max(20, round(seconds * TICKS_HZ / (4 * SLICE_TICKS)))
    return streamed(name, fast(slow.min_interval_ticks, 1.0037, 4 * SLICE_TICKS, count), firmware)


def play_saturated(firmware: EmulatedFirmware, motion: list, duration: int) -> Board:
    """Play a motion that the queue holds while valid frames fill the line without a gap."""
    board = Board(firmware)
    board.get_ready()
    for segment in motion:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    frame = encode_frame(board.seq - 1, *encode(Segments(0, 0, 0, (motion[0],))))
    end = board.now + LEAD_TICKS + duration * len(motion) + 100_000
    while board.now < end:
        while firmware.uno.serial.pending < HOST_WINDOW_BYTES:
            board.receive(frame)
        board.run(40_000)
    board.run(200_000)
    board.receive(bytes([DELIMITER]))
    return board


def streamed(name: str, motion: list, firmware: EmulatedFirmware | None = None, rate_hz: float = 0.0) -> Run:
    """A motion streamed within the host's window of 112 bytes, which queries keep full."""
    motion = end_motion(motion)
    length_ticks = sum(map(duration_ticks, motion))
    board = Board(firmware or EmulatedFirmware(IMAGE))
    board.get_ready()
    for segment in motion[:16]:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    status = Streamer(board, motion[16:], busy_line=True).run(len(motion), length_ticks + TICKS_HZ)
    title = f"{name}, {length_ticks / TICKS_HZ:.1f} s"
    return looked_at(title, rate_hz, board, motion, status.fault, status.overruns + status.ring_full)


def watched() -> tuple[str, tuple[str, str]]:
    """Interrupts while both joints run at 50,000 steps/s and are streamed to."""
    motion = end_motion(fast(320, 1.0037, 64_000, 60))
    firmware = EmulatedFirmware(IMAGE)
    board = Board(firmware)
    board.get_ready()
    firmware.uno.observe(keep_intervals=False)
    for segment in motion[:16]:
        board.ask(Segments(0, 0, 0, (segment,)))
    board.ask(Start(LEAD_TICKS))
    Streamer(board, motion[16:], busy_line=True).run(len(motion), 64_000 * 100)
    insight = firmware.uno.insight()
    entry = 4
    most = {figures.name: figures.duration_cycles.most + entry for figures in insight.interrupts}
    cells = ", ".join(f"{name} {cycles}" for name, cycles in sorted(most.items()))
    step = f"{max(most['TIMER1_COMPA'], most['TIMER1_COMPB'])} at most"
    return (
        step,
        ("longest interrupts, entry included", f"{cells}; load {insight.interrupt_share:.2f}"),
    )


def hold_latency() -> tuple[str, str]:
    """From the end of the hold byte to the first stretched interval."""
    worst = 0.0
    for phase in range(0, SEGMENT_TICKS, SEGMENT_TICKS // 6):
        player = Player(EmulatedFirmware(IMAGE), FAST)
        player.start()
        player.play_until(player.board.now + 25 * SEGMENT_TICKS)
        player.board.run(phase)
        player.board.receive(bytes([HOLD_CODE]))
        held = player.board.now + BYTE_TICKS
        player.board.run(200_000)
        begin = player.board.rises(0)[0] - Schedule.of(FAST.segments).steps[0][0][0]
        planned = [begin + tick for tick, _ in Schedule.of(FAST.segments).steps[0]]
        first = next(a for a, b in zip(player.board.rises(0), planned, strict=False) if a != b)
        worst = max(worst, (first - held) / TICKS_HZ * 1000)
    limit = SEGMENT_TICKS / TICKS_HZ * 1000 + 4
    return "hold byte to the first stretched interval", f"{worst:.2f} ms at most in 6 phases; limit {limit:.2f} ms"


def calm_hold_latency() -> tuple[str, str]:
    """From the end of the hold byte to the last edge that still rises, the joint below its start-stop speed."""
    interval, first, latest = 50_000, 100_000, 0
    for ahead in range(500, 24_000, 500):  # of the edge that is due next
        board = Board(EmulatedFirmware(IMAGE))
        board.hello()
        board.ask(Config(PinMap.OWN, 2, 0, 0, 0, 0, 0, (interval // 2, interval // 2)))
        board.get_ready()
        board.ask(Segments(0, 0, 0, (segment_of(600_000, run_of(9, first=first, interval=interval), last=True),)))
        board.ask(Start(LEAD_TICKS))
        while not board.rises(0):
            board.run(1000)
        due = board.rises(0)[0] + 3 * interval
        board.run(due - ahead - BYTE_TICKS - board.now)
        board.receive(bytes([HOLD_CODE]))
        board.run(3 * interval)
        if len(board.rises(0)) > 3:
            latest = max(latest, ahead)
    ms = latest / TICKS_HZ * 1000
    return "the same below start-stop speed: to the last edge that rises", f"{ms:.2f} ms at most; limit 1 ms"


def emergency_latency() -> tuple[str, str]:
    """From the end of the last emergency byte's stop bit to the last edge."""
    worst = -1e9
    for phase in range(0, 320, 20):
        firmware = EmulatedFirmware(IMAGE)
        board = Board(firmware)
        board.get_ready()
        board.ask(Segments(0, 0, 0, (fast(320, 1.0037, 3_000_000, 1)[0],)))
        board.send(Start(LEAD_TICKS))
        board.run(300_000 + phase)
        board.receive(bytes([EMERGENCY_CODE] * EMERGENCY_REPEATS))
        stop_bit = board.now + EMERGENCY_REPEATS * BYTE_TICKS
        board.run(50_000)
        last = max(edge.tick for edge in board.edges if edge.pin in STEP_PINS)
        worst = max(worst, (last - stop_bit) / TICKS_HZ * 1e6)
    return "emergency byte's stop bit to the last edge", f"{worst:+.1f} us at most in 16 phases; limit 30 us"


def ring() -> tuple[str, str]:
    """Path time that the queue holds of the hard motions, wherever it is filled."""
    told = []
    for joints in (2, 4):
        train, axes = reference_train(joints)
        held_ticks = least_held_ticks(compress(train, Coding.of(axes)).segments, train.board.queue_bytes)
        told.append(f"{held_ticks / TICKS_HZ * 1000:.0f} ms at least with {joints} joints")
    return "path time in the queue, tests/data/reference_motion*.toml", ", ".join(told)


if __name__ == "__main__":
    main()
