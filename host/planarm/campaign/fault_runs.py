"""A live run with one mishap of a kind, and then its resumption: the pins and the verdict are held against each other.

Host and board are the real ones, in virtual time. Whatever goes wrong, and when:

- the steps at the pins are a beginning of the plan's, in order and direction, at one place of the path;
- no joint changes its speed by more than its limit, and none stops above its start-stop speed, unless the board lost
  its supply or was told to stop dead;
- what the host says of the position is true: exactly there, within the bounds, or lost because the board let go;
- once nothing goes wrong any more, `resume` makes every step that is left, once, unless the position was lost.
"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from planarm.analysis.step_count import MeasuredSteps, Waveform, measure_steps
from planarm.campaign.faulty_transport import NEVER, FaultyTransport, Mishaps
from planarm.campaign.task import Figures, Value
from planarm.errors import DeviceFault, HostKilledError, LinkError, PlanarmError, SceneError
from planarm.link.position import Certainty, PositionReport
from planarm.link.released_image import released_image
from planarm.link.stream import Stream
from planarm.model.transmission import motor_axes
from planarm.notice import silent
from planarm.operations.resume import go_on, load_run
from planarm.pipeline import plan_scene, stored
from planarm.plan_file import save_plan
from planarm.scene import Scene
from planarm.stepping.check_steps import check_gaps
from planarm.stepping.expand import expand
from planarm.stepping.remainder import OUT_OF_STEP_TICKS
from planarm.stepping.train import JointSteps, StepTrain
from planarm.stepping.windows import start_stop_ticks
from planarm.streaming.plan_stream import PLAN_NAME, options_for, record, stream
from planarm_wire.messages import BAUD, TICKS_HZ

if TYPE_CHECKING:
    from planarm.plan import Plan
    from planarm_sim import Uno
    from planarm_sim.board.uno import UnoSnapshot
    from planarm_sim.faults.line import ActiveFault, FaultyLine

LINE_KINDS = ("drop", "flip", "duplicate", "delay", "burst", "wrong_baud", "deaf")
POWER_KINDS = ("reset", "brown_out", "watchdog", "two_resets")
HOST_KINDS = ("unplug", "unplug_and_replug", "pause", "killed", "held", "overridden", "stopped")
KINDS = ("none", *LINE_KINDS, *POWER_KINDS, *HOST_KINDS)

BOOT_S = 0.02
SPAN_S = 0.1
"""Opening, filling and the motors' waking take about so long before the first step."""
SETTLE_S = 1.5
"""What the queue holds, half a second, may take longer while the arm slows down."""
IN_MEMORY = "/dev/shm"
"""Where Linux keeps files in memory: nobody cuts this computer's supply, so journals need no disk."""
SPEED_TOLERANCE = 1.25
"""A stretched slice's steps lie within 0.15 of an interval of the path clock's (docs/decisions/0026)."""


@dataclass(frozen=True, slots=True)
class Stage:
    """What all runs of a scene share: its plan, and a board that listens."""

    plan: Plan
    train: StepTrain
    board: Uno
    listening: UnoSnapshot


def run_faults(scene: Scene, settings: Mapping[str, Value], _options: Mapping[str, Value]) -> tuple[str, str, Figures]:
    """Run the scene with the mishap "fault" of the seed "seed", then resume it.

    Raises:
        SceneError: no such mishap.
    """
    kind, seed = str(settings.get("fault", "none")), settings.get("seed", 0)
    if kind not in KINDS:
        raise SceneError(scene.source, "fault", f"{kind!r} given, one of {', '.join(KINDS)} expected")
    stage = _stage(scene)
    stage.board.restore(stage.listening)
    dice = random.Random(f"{kind} {seed}")
    span_s = SPAN_S + stage.train.duration_ticks / TICKS_HZ
    line = _transport(stage.board, kind, dice, span_s)
    with tempfile.TemporaryDirectory(dir=IN_MEMORY if Path(IN_MEMORY).is_dir() else None) as folder:
        return _Run(stage, line, Path(folder), kind, dice).carry_out()


class _Run:
    """One run and its resumption."""

    def __init__(self, stage: Stage, line: FaultyTransport, folder: Path, kind: str, dice: random.Random) -> None:
        self.stage, self.line, self.folder, self.kind = stage, line, folder, kind
        self._orders = _orders(kind, dice, len(stage.plan.segments.segments))
        self._ordered_s = 0.0
        self.figures: Figures = {"fault": kind}
        self.wrong: list[str] = []

    def carry_out(self) -> tuple[str, str, Figures]:
        """Stream, judge, repair, resume, judge."""
        report = self._stream()
        self.line.wait_until(self.line.now_s() + SETTLE_S)
        self._judge_pins()
        if report is not None:
            self._judge_verdict(report)
        self.figures |= {"verdict": report.certainty.value if report else "complete", "steps": self._steps()}
        if report is not None:
            self._resume()
        elif self._steps() != sum(len(joint.ticks) for joint in self.stage.train.steps):
            self.wrong.append("told complete, but steps are missing")
        self.figures |= {"board_s": self.line.now_s(), "steps_in_the_end": self._steps()}
        return ("wrong" if self.wrong else "ok", "; ".join(self.wrong), self.figures)

    def _stream(self) -> PositionReport | None:
        """Stream the plan; return what the host says of the position, None when it says complete."""
        plan = self.stage.plan
        save_plan(stored(plan), self.folder / PLAN_NAME)
        line = record(self.line, self.folder, "sim://", plan.scene)
        try:
            options = options_for(plan.scene, plan.segments)
            stream(plan.segments, plan.certificate, line, None, options, steer=self._steer)
        except HostKilledError:
            return load_run(self.folder).judge(None)
        except (LinkError, DeviceFault) as error:
            self.figures["error"] = str(error)[:120]
            position = getattr(error, "position", None)
            return position if isinstance(position, PositionReport) else load_run(self.folder).judge(None)
        finally:
            line.journal.close()
        return None

    def _steer(self, stream: Stream) -> None:
        """Do what the person at the keyboard does, each order in its segment, or so long after the one before."""
        if not self._orders:
            return
        segment, after_s, order = self._orders[0]
        now_s = self.line.now_s()
        if stream.executed_segments >= segment and now_s >= self._ordered_s + after_s:
            self._orders.pop(0)
            self._ordered_s = now_s
            order(stream)

    def _resume(self) -> None:
        """Go on with nothing going wrong any more."""
        self.line.repair()
        self.line.line.baud = BAUD
        before = self._steps()
        try:
            report, _ = go_on(load_run(self.folder), self.line, lambda _report: True)
            self.figures["resumed"] = report.certainty.value
        except (LinkError, DeviceFault) as error:
            position = getattr(error, "position", None)
            lost = isinstance(position, PositionReport) and position.certainty is Certainty.LOST
            self.figures["resumed"] = "lost" if lost else "failed"
            if not lost:
                self.wrong.append(f"resume failed: {error}")
            elif not self._let_go():
                self.wrong.append(f"told lost without a reason: {error}")
            if self._steps() != before:
                self.wrong.append("resume refused, but moved the arm")
            return
        except PlanarmError as error:
            self.wrong.append(f"resume failed: {error}")
            return
        self._judge_pins()
        if self._steps() != sum(len(joint.ticks) for joint in self.stage.train.steps):
            self.wrong.append(f"resumed, but {self._steps()} steps are not the plan's")

    # -- the pins -----------------------------------------------------------------------------------------------------

    def _measured(self) -> list[MeasuredSteps]:
        board, train = self.stage.board, self.stage.train
        pins = train.board.joint_pins[: len(train.steps)]
        waves = [[_waveform(board, pin) for pin in pair] for pair in pins]
        return [measure_steps(step, direction) for step, direction in waves]

    def _steps(self) -> int:
        return sum(len(joint.ticks) for joint in self._measured())

    def _judge_pins(self) -> None:
        """Hold order, place and speed of the steps against the plan."""
        measured, planned = self._measured(), self.stage.train.steps
        for number, (made, wanted) in enumerate(zip(measured, planned, strict=True), start=1):
            count = len(made.ticks)
            if not np.array_equal(made.directions, wanted.directions[:count]):
                self.wrong.append(f"joint {number} made {count} steps that are no beginning of the plan's")
                return
        pairs = [(len(m.ticks), w.ticks) for m, w in zip(measured, planned, strict=True)]
        made_until = [int(ticks[count - 1]) for count, ticks in pairs if count]
        coming = [int(ticks[count]) for count, ticks in pairs if count < len(ticks)]
        if made_until and coming and max(made_until) - min(coming) > OUT_OF_STEP_TICKS:
            self.wrong.append("the joints do not stand at one place of the path")
        if not self._let_go():
            self._judge_speeds(measured)

    def _judge_speeds(self, measured: Sequence[MeasuredSteps]) -> None:
        scene = self.stage.plan.scene
        axes = motor_axes(scene.joints, scene.coupling)
        made = replace(
            self.stage.train,
            steps=tuple(JointSteps(m.ticks, m.directions) for m in measured),
            duration_ticks=self.stage.board.cycle,
        )
        for number, (axis, steps) in enumerate(zip(axes, made.steps, strict=True), start=1):
            for check in check_gaps(made, axes, number):
                worst = check.value / check.limit if "acceleration" in check.name else check.limit / check.value
                if check.verdict == "red" and worst > SPEED_TOLERANCE:
                    self.wrong.append(f"{check.name} {check.value:.6g} {check.unit}, {check.limit:.6g} allowed")
            gaps = np.diff(steps.ticks)
            if len(gaps) and len(steps.ticks) < len(self.stage.train.steps[number - 1].ticks):
                least = start_stop_ticks(axis) / SPEED_TOLERANCE
                if gaps[-1] < least:
                    self.wrong.append(f"joint {number} stopped dead from an interval of {gaps[-1]} ticks")

    def _judge_verdict(self, report: PositionReport) -> None:
        """Hold what the host says against the pins."""
        moved = tuple(joint.net_usteps for joint in self._measured())
        if report.certainty is Certainty.EXACT and moved != report.moved_usteps:
            self.wrong.append(f"told exact {report.moved_usteps}, the pins made {moved}")
        inside = all(low <= at <= high for at, (low, high) in zip(moved, report.bounds_usteps, strict=True))
        if report.certainty is Certainty.BOUNDED and not inside:
            self.wrong.append(f"told bounded {report.bounds_usteps}, the pins made {moved}")
        if report.certainty is Certainty.LOST and not self._let_go():
            self.wrong.append(f"told lost without a reason: {report.reason}")

    def _let_go(self) -> bool:
        """Whether the board restarted, the one good reason to say lost and to stop dead."""
        return self.line.resets_done > 0


def _orders(kind: str, dice: random.Random, segments: int) -> list[tuple[int, float, Callable[[Stream], None]]]:
    """Draw what the person at the keyboard does: from which segment on, how long after the order before, what."""
    at, wait_s = dice.randrange(segments), dice.choice((0.001, 0.01, 0.1, 0.3))
    percent, quick = dice.randint(1, 99), dice.random() < 0.5
    return {
        "held": [(at, 0.0, Stream.hold), (0, wait_s, Stream.resume)],
        "overridden": [(at, 0.0, lambda stream: stream.override(percent)), (0, wait_s, lambda s: s.override(100))],
        "stopped": [(at, 0.0, lambda stream: stream.stop(quick=quick))],
    }.get(kind, [])


def _waveform(board: Uno, pin: str) -> Waveform:
    edges = board.edges(pin)
    return Waveform(edges["cycle"], edges["level"])


@lru_cache(maxsize=4)
def _stage(scene: Scene) -> Stage:
    from planarm_sim import Uno  # noqa: PLC0415 - the emulator is loaded where it is used

    plan = plan_scene(scene, silent)
    board = Uno.from_hex(released_image(scene.board.name))
    board.run(seconds=BOOT_S)
    board.clear_edges()
    return Stage(plan, expand(plan.segments), board, board.snapshot())


def _transport(board: Uno, kind: str, dice: random.Random, span_s: float) -> FaultyTransport:
    """Draw one mishap of a kind, somewhere between the first byte and the end of the motion."""
    from planarm_sim.faults.line import FaultyLine  # noqa: PLC0415 - the emulator is loaded where it is used

    begin = board.cycle + round(dice.uniform(0.0, span_s) * TICKS_HZ)
    length = round(dice.choice((0.002, 0.02, 0.1, 0.4, 1.5)) * dice.random() * TICKS_HZ)
    mishaps = {
        "reset": Mishaps(resets=((begin, "EXTERNAL"),)),
        "brown_out": Mishaps(resets=((begin, "BROWN_OUT"),)),
        "watchdog": Mishaps(resets=((begin, "WATCHDOG"),)),
        "two_resets": Mishaps(resets=((begin, "EXTERNAL"), (begin + length, "EXTERNAL"))),
        "unplug": Mishaps(unplugged=(begin, NEVER)),
        "unplug_and_replug": Mishaps(unplugged=(begin, begin + length)),
        "pause": Mishaps(paused=(begin, begin + length)),
        "killed": Mishaps(killed=begin),
    }.get(kind, Mishaps())
    active = _active(kind, dice, begin, length)
    line = FaultyLine(board, lambda: active)
    transport = FaultyTransport(board, line, mishaps)
    if kind == "wrong_baud":
        transport.at(begin, lambda: set_baud(line, dice.choice((115_200, 230_400, 500_000))))
        transport.at(begin + length, lambda: set_baud(line, BAUD))
    if kind == "burst":
        noise = dice.randbytes(dice.randint(1, 200))
        transport.at(begin, lambda: line.insert(dice.choice(("to_board", "to_host", "both")), noise))
    return transport


def set_baud(line: FaultyLine, baud: int) -> None:
    """Let the host's end run at another rate."""
    line.baud = baud


def _active(kind: str, dice: random.Random, begin: int, length: int) -> tuple[ActiveFault, ...]:
    """Return the faults of the bytes: a share of them, for a while."""
    from planarm_sim.faults.line import ActiveFault  # noqa: PLC0415 - the emulator is loaded where it is used
    from planarm_sim.faults.schedule import Fault  # noqa: PLC0415

    settings: dict[str, object] = {
        "direction": dice.choice(("to_board", "to_host", "both")),
        "share": dice.choice((0.0005, 0.005, 0.05, 0.5)),
    }
    if kind == "delay":
        settings["by_s"] = dice.choice((0.001, 0.01, 0.1))
    if kind == "deaf":
        settings["share"] = 1.0
    name = {"drop": "drop", "flip": "flip", "duplicate": "duplicate", "delay": "delay", "deaf": "drop"}.get(kind)
    if name is None:
        return ()
    fault = Fault(f"line.{name}", 0.0, None, settings)
    return (ActiveFault(fault, begin, begin + length, np.random.default_rng(dice.getrandbits(32))),)
