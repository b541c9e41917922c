"""Going on with a run that broke off: how well the arm's position is known, and the rest of the path.

The run's folder holds the plan and the journal; the device tells its boot, its ledger and how much of the session it
took. From these the verdict follows, and what can be done:

- the device still holds the motion (it runs, is held or starved): the segments that it does not have are sent;
- it stands at a known place of the path without a motion: the steps that are left are coded anew, from a rest;
- its position is lost: nothing, until the arm was homed.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from planarm.errors import LinkError
from planarm.link.account import Account, account_of
from planarm.link.exchange import StreamResult, meet, open_session, request
from planarm.link.journal import JournalWriter, read_journal
from planarm.link.plan_steps import PlanSteps
from planarm.link.position import Certainty, Known, Meeting, PositionReport, StreamError, judge
from planarm.link.recording import RecordingTransport
from planarm.link.stream import AT_EASE, Joining, StreamProgress
from planarm.link.stream_values import position_of
from planarm.model.transmission import motor_axes
from planarm.plan_file import StoredPlan, load_plan
from planarm.run_folder.folder import begin_run_folder
from planarm.scene.rebuild import scene_from_mapping
from planarm.stepping.remainder import certify_remainder, remainder, steps_left
from planarm.streaming.plan_stream import JOURNAL_NAME, PLAN_NAME, options_for, record, stream
from planarm_wire.messages import State, Stop

if TYPE_CHECKING:
    from planarm.link.transport import Transport
    from planarm.scene import Scene

RESUMED = "resumed"
"""The folder, in a run's folder, of the run that went on with it."""

Confirm = Callable[[PositionReport], bool]


@dataclass(frozen=True)
class BrokenRun:
    """A run that may have ended early, as its folder tells.

    Attributes:
        folder: the newest one, when it was gone on with before.
        stored: its plan.
        scene: the scene that it was planned for.
        account: what the journal adds up to.
        steps: the plan's.
    """

    folder: Path
    stored: StoredPlan
    scene: Scene
    account: Account
    steps: PlanSteps

    @property
    def port(self) -> str:
        """Where the device was."""
        return str(self.account.about["port"])

    def judge(self, met: Meeting | None) -> PositionReport:
        """Say how well the position is known; `met` is None when the device cannot be asked."""
        known = self.account.known()
        if known is None:
            zeros = tuple(0 for _ in self.stored.segments.start_usteps)
            at = tuple((0, 0) for _ in zeros)
            return PositionReport(
                Certainty.EXACT, (0, 0), self.steps.segments, zeros, at, "no segment of the plan was sent"
            )
        spread = options_for(self.scene, self.stored.segments).released_spread_usteps
        return judge(known, met, self.steps, spread)


def load_run(folder: Path) -> BrokenRun:
    """Read a run's folder, the newest part of it.

    Raises:
        JournalError, PlanFileError, CertificateError: it is none, or was changed.
    """
    while (folder / RESUMED / JOURNAL_NAME).exists():
        folder = folder / RESUMED
    account = account_of(read_journal(folder / JOURNAL_NAME))
    stored = load_plan(folder / PLAN_NAME)
    scene = scene_from_mapping(stored.scene)
    return BrokenRun(folder, stored, scene, account, PlanSteps.of(stored.segments.segments))


def meet_again(run: BrokenRun, transport: Transport) -> tuple[BrokenRun, PositionReport, Meeting]:
    """Ask the device, wait until it rests, and say how well the position is known; the journal takes it down.

    Raises:
        StreamError: it does not answer; the error tells the bounds.
    """
    journal = JournalWriter(run.folder / JOURNAL_NAME)
    with closing(journal):
        try:
            met = meet(RecordingTransport(transport, journal), run.account.next_seq)
        except LinkError as error:
            raise StreamError(str(error), run.judge(None)) from error
    run = load_run(run.folder)
    return run, run.judge(met), met


def go_on(
    run: BrokenRun,
    transport: Transport,
    confirm: Confirm,
    on_progress: Callable[[StreamProgress], None] | None = None,
) -> tuple[PositionReport, StreamResult | None]:
    """Judge, and execute what is left of the run.

    Args:
        run: the run.
        transport: the line to the device.
        confirm: asked before going on from a position that is only bounded.
        on_progress: as in `planarm.link.exchange.stream_plan`.

    Returns:
        The verdict, and what was executed; None when nothing was left.

    Raises:
        StreamError: the position is lost, or bounded and not confirmed, or the device does not answer.
        PlanarmError: as in streaming.
    """
    run, report, met = meet_again(run, transport)
    if report.certainty is Certainty.LOST:
        raise StreamError("cannot go on with the run", report)
    if report.certainty is Certainty.BOUNDED and not confirm(report):
        raise StreamError("going on from here needs a yes", report)
    state = met.status.state
    if state is State.READY and report.executed_segments[0] == run.steps.segments:
        return report, None
    known = run.account.known()
    accepted = run.account.accepted
    if known is not None and state in (State.RUNNING, *AT_EASE):
        if accepted is not None:
            return report, _join(run, transport, known, accepted, on_progress)
        request(transport, open_session(transport), Stop(0))  # it has no memory of the session: only the ledger counts
        run, report, met = meet_again(run, transport)
    return report, _stream_what_is_left(run, transport, report, met, on_progress)


def _join(
    run: BrokenRun,
    transport: Transport,
    known: Known,
    accepted: int,
    on_progress: Callable[[StreamProgress], None] | None,
) -> StreamResult:
    """Send the segments that the device does not have; the journal goes on."""
    journal = JournalWriter(run.folder / JOURNAL_NAME)
    journal.note(transport.clock.now_s(), {"joined_segments": accepted})
    plan = run.stored.segments
    return stream(
        plan,
        run.stored.certificate,
        RecordingTransport(transport, journal),
        on_progress,
        options_for(run.scene, plan),
        Joining(known.before, accepted),
    )


def _stream_what_is_left(
    run: BrokenRun,
    transport: Transport,
    report: PositionReport,
    met: Meeting,
    on_progress: Callable[[StreamProgress], None] | None,
) -> StreamResult:
    """Code the steps that are left anew, from a rest, and stream them as a run of their own."""
    plan = run.stored.segments
    made = run.steps.locate(report.executed_segments[0], report.moved_usteps)
    if made is None:
        raise StreamError("the arm does not stand on the path", report)
    axes = motor_axes(run.scene.joints, run.scene.coupling)
    made = made[: len(plan.start_usteps)]  # the board's further joints rest
    rest = remainder(plan, made, axes)
    certificate = certify_remainder(run.scene, steps_left(plan, made), rest)
    out = run.folder / RESUMED
    begin_run_folder(out, replace(run.stored, segments=rest, certificate=certificate))
    if report.certainty is Certainty.BOUNDED:  # the device has forgotten where it is
        _tell_position(transport, rest.start_usteps, met)
    line = record(transport, out, run.port, run.scene)
    return stream(rest, certificate, line, on_progress, options_for(run.scene, rest))


def _tell_position(transport: Transport, usteps: tuple[int, ...], met: Meeting) -> None:
    if met.status.state in (State.IDLE, State.READY):
        session = open_session(transport)
        request(transport, session, position_of(usteps, session.joints))
