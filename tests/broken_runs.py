"""Runs that break off, on an emulated board that goes on: transports that fail as asked, and what the pins show."""

from contextlib import suppress
from pathlib import Path

import numpy as np

from planarm.analysis.step_count import MeasuredSteps
from planarm.errors import DeviceFault, LinkError
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.pipeline import stored
from planarm.record.look import judge_pins
from planarm.run_folder.folder import begin_run_folder
from planarm.stepping.expand import expand
from planarm.streaming.plan_stream import options_for, record, stream

SCENE = Path(__file__).parent / "scenarios" / "arm.toml"
WAIT_S = 1.0


class KilledError(Exception):
    """The host's end, from one instruction to the next."""


class Breaking:
    """An emulated line that fails from a moment on: by killing its host, or by losing the cable."""

    def __init__(self, line: SimTransport, at_s: float, error: Exception | None) -> None:
        self._line, self.at_s, self.error = line, at_s, error
        self.clock, self.pins, self.arm, self.nonce = line.clock, line.pins, line.arm, line.nonce

    def _fail(self) -> None:
        if self.error is not None and self.clock.now_s() >= self.at_s:
            raise self.error

    def read(self, max_bytes: int, deadline_s: float) -> bytes:
        self._fail()
        data = self._line.read(max_bytes, deadline_s)
        self._fail()
        return data

    def write(self, data: bytes) -> None:
        self._fail()
        self._line.write(data)

    def close(self) -> None:
        """The board goes on."""


def board() -> SimTransport:
    """A board that listens."""
    line = SimTransport(released_image())
    line.clock.wait_until(0.05)
    return line


def run_until(plan, line, folder: Path, at_s: float, error: Exception | None = None, on_progress=None):
    """Stream `plan` as `planarm run` does, into `folder`; return the error that ended it, if any."""
    begin_run_folder(folder, stored(plan))
    recorded = record(Breaking(line, at_s, error), folder, "sim://", plan.scene)
    ended = None
    with suppress(KilledError):
        try:
            stream(plan.segments, plan.certificate, recorded, on_progress, options_for(plan.scene, plan.segments))
        except (LinkError, DeviceFault) as told:
            ended = told
    recorded.journal.close()
    return ended


def measured(plan, line) -> tuple[MeasuredSteps, ...]:
    """The steps at the pins."""
    return judge_pins(plan.segments, line.pins).measured


def moved_usteps(plan, line) -> tuple[int, ...]:
    """By how much the pins moved each joint."""
    return tuple(steps.net_usteps for steps in measured(plan, line))


def assert_whole_plan(plan, line) -> None:
    """Every step of the plan, once, in order and direction; no steps closer than the plan's closest."""
    for joint, (made, planned) in enumerate(zip(measured(plan, line), expand(plan.segments).steps, strict=True)):
        np.testing.assert_array_equal(made.directions, planned.directions, err_msg=f"joint {joint + 1}")
        assert np.diff(made.ticks).min() >= 0.98 * np.diff(planned.ticks).min() - 16
