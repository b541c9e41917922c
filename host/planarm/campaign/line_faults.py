"""A recorded stream, damaged on its way to the emulated board: whatever arrives, no wrong step may come out.

The host is recorded once; its bytes are then played again with seeded damage and nobody to answer, so a run costs
the emulator's time only. Right outcomes: every step of the plan, or a beginning of them and a board that stopped.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from planarm.analysis.step_count import Waveform, measure_steps
from planarm.campaign.task import Figures, Value
from planarm.errors import SceneError
from planarm.link.exchange import stream_plan
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.notice import silent
from planarm.pipeline import plan_scene
from planarm.scene import Scene
from planarm.stepping.expand import expand
from planarm.stepping.train import StepTrain
from planarm.streaming.plan_stream import options_for
from planarm_wire.boards import Board
from planarm_wire.messages import TICKS_HZ

if TYPE_CHECKING:
    from planarm_sim import Uno
    from planarm_sim.board.uno import UnoSnapshot

FAULTS = ("none", "drop", "flip", "duplicate", "insert", "cut")
DEFAULT_SECONDS = 1.0
BURST_BYTES = 16


@dataclass(frozen=True, slots=True)
class Recording:
    """A plan's stream.

    Attributes:
        train: the steps that it stands for.
        written: cycle and bytes of each write of the host.
        board: the board just before the first.
    """

    train: StepTrain
    written: tuple[tuple[int, bytes], ...]
    board: UnoSnapshot


def run_line(scene: Scene, settings: Mapping[str, Value], options: Mapping[str, Value]) -> tuple[str, str, Figures]:
    """Play the scene's stream with the fault "fault" of the seed "seed", once somewhere in the stream.

    Raises:
        SceneError: no such fault.
    """
    fault, seed = str(settings.get("fault", "flip")), settings.get("seed", 0)
    if fault not in FAULTS:
        raise SceneError(scene.source, "fault", f"{fault!r} given, one of {', '.join(FAULTS)} expected")
    recording = record(scene)
    board = _board(scene.board.name)
    board.restore(recording.board)
    end_cycle = recording.written[0][0] + round(_seconds(options) * TICKS_HZ)
    written = tuple(write for write in recording.written if write[0] < end_cycle)
    _play(board, damaged(written, fault, random.Random(f"{fault} {seed}")), end_cycle)
    return judge(board, recording.train, fault)


def damaged(written: tuple[tuple[int, bytes], ...], fault: str, dice: random.Random) -> list[tuple[int, bytes]]:
    """Return the writes with one burst of damage, of 1 to BURST_BYTES bytes, at a random byte."""
    if fault == "none":
        return list(written)
    place = dice.randrange(sum(len(data) for _, data in written))
    length = dice.randint(1, BURST_BYTES)
    sent, before = [], 0
    for cycle, data in written:
        begin, end = max(place - before, 0), min(place + length - before, len(data))
        before += len(data)
        if fault == "cut" and begin < len(data):
            sent.append((cycle, data[:begin]))
            break
        sent.append((cycle, _spoil(data, begin, end, fault, dice) if begin < end else data))
    return sent


def _spoil(data: bytes, begin: int, end: int, fault: str, dice: random.Random) -> bytes:
    head, hit, tail = data[:begin], data[begin:end], data[end:]
    if fault == "drop":
        return head + tail
    if fault == "duplicate":
        return head + hit + hit + tail
    if fault == "insert":
        return head + dice.randbytes(len(hit)) + hit + tail
    return head + bytes(byte ^ (1 << dice.randrange(8)) for byte in hit) + tail


def judge(board: Uno, train: StepTrain, fault: str) -> tuple[str, str, Figures]:
    """Hold the pins' steps against the plan's: a beginning of them, in order and direction, is right."""
    counts, wrong = [], ""
    for joint, (planned, (step, direction)) in enumerate(zip(train.steps, train.board.joint_pins, strict=False)):
        measured = measure_steps(_waveform(board, step), _waveform(board, direction))
        count = len(measured.ticks)
        counts.append(count)
        if count > len(planned.ticks) or not np.array_equal(measured.directions, planned.directions[:count]):
            wrong = f"joint {joint + 1} made {count} steps that are no beginning of the plan's {len(planned.ticks)}"
    figures: Figures = {"fault": fault, "steps": sum(counts), "board_s": board.time_s}
    figures |= {f"steps_{joint}": count for joint, count in enumerate(counts, start=1)}
    return ("wrong steps" if wrong else "ok", wrong, figures)


def _waveform(board: Uno, pin: str) -> Waveform:
    edges = board.edges(pin)
    return Waveform(edges["cycle"], edges["level"])


class _Recorder(SimTransport):
    """The emulated line, with what the host wrote and when, and the board as it was before."""

    def __init__(self, board: Board) -> None:
        super().__init__(released_image(board.name), board=board)
        self.written: list[tuple[int, bytes]] = []
        self.before = self.uno.snapshot()

    def write(self, data: bytes) -> None:
        """Note the bytes and pass them on."""
        if not self.written:
            self.before = self.uno.snapshot()
        self.written.append((self.uno.cycle, data))
        super().write(data)


@lru_cache(maxsize=4)
def record(scene: Scene) -> Recording:
    """Stream the scene's plan to the emulated board once, and keep what the host wrote and when."""
    plan = plan_scene(scene, silent)
    line = _Recorder(scene.board)
    stream_plan(line, plan.segments.segments, options=options_for(scene, plan.segments))
    return Recording(expand(plan.segments), tuple(line.written), line.before)


@lru_cache(maxsize=4)
def _board(name: str) -> Uno:
    from planarm_sim import Uno  # noqa: PLC0415 - the emulator is loaded where it is used

    return Uno.from_hex(released_image(name))


def _play(board: Uno, sent: list[tuple[int, bytes]], end_cycle: int) -> None:
    for cycle, data in sent:
        board.run(cycles=max(0, cycle - board.cycle))
        board.serial.write(data)
    board.run(cycles=max(0, end_cycle - board.cycle))


def _seconds(options: Mapping[str, Any]) -> float:
    return float(options.get("seconds", DEFAULT_SECONDS))
