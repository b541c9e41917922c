"""A line too slow, or too late, for a plan: the motion is slowed before it starts, and then never starves."""

from pathlib import Path

import pytest

from link_model import motion
from planarm.link.exchange import stream_plan
from planarm.link.plan_steps import PlanSteps
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm.pipeline import plan_scene
from planarm.scene import load_scene
from planarm.streaming.plan_stream import options_for
from planarm_wire.messages import BOARDS, STEP_PINS, State
from planarm_wire.steps import duration_ticks
from slow_line import SlowLine

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="module", params=["table1_case1", "fast_arm"])
def plan(request):
    return plan_scene(load_scene(EXAMPLES / f"{request.param}.toml"), lambda _stage, _share: None)


def streamed(segments, bytes_s, delay_s, options=None):
    """Stream to the released image; (result, what was told while it ran, what the person was told, rising edges)."""
    line = SlowLine(SimTransport(released_image()), bytes_s, delay_s)
    told, said = [], []
    result = stream_plan(line, segments, told.append, options, warn=said.append)
    rises = [int((line.pins.edges(pin)["level"] == 1).sum()) for pin in STEP_PINS]
    return result, [one for one in told if one.state is not State.READY], said, rises


def assert_kept_its_pace(segments, run):
    """It ran at the rate that was announced, all along, and took as long; every step came."""
    result, running, said, rises = run
    percent = result.path_clock_percent
    paces = [words for words in said if not words.startswith("soft limits")]  # no place was told to this board
    assert len(paces) == (percent < 100)
    assert {one.state for one in running} == {State.RUNNING}, "it never starved"
    assert min(one.rate_percent for one in running) == percent, "and was never slowed down by the device"
    planned_s = sum(map(duration_ticks, segments)) / 16e6
    assert result.motion_s == pytest.approx(planned_s * 100 / percent, abs=0.6)
    assert rises == [counts[-1] for counts in PlanSteps.of(segments).counts]


@pytest.mark.parametrize(
    ("bytes_s", "delay_s", "slowed"),
    [(25_000, 0.0, False), (3_000, 0.0, False), (25_000, 0.02, None), (1_400, 0.0, True), (25_000, 0.05, True)],
    ids=["good", "a tenth", "20 ms late", "a twentieth", "50 ms late"],
)
def test_a_certified_plan_keeps_the_pace_that_is_told_before_it_starts(plan, bytes_s, delay_s, slowed):
    segments = plan.segments.segments
    run = streamed(segments, bytes_s, delay_s, options_for(plan.scene, plan.segments))
    assert_kept_its_pace(segments, run)
    if slowed is not None:
        assert (run[0].path_clock_percent < 100) == slowed
    if run[0].path_clock_percent < 100:
        assert run[0].path_clock_percent > 15, "and no slower than it must be"
    assert run[0].margin.seen.bytes_s == pytest.approx(min(bytes_s, 112 / max(2 * delay_s, 1e-9)), rel=0.35)


@pytest.mark.parametrize("bytes_s", [25_000, 8_000, 3_000])
def test_segments_of_half_a_millisecond_are_slowed_to_what_line_and_board_can_take(bytes_s):
    """2,000 segments a second of 22 bytes: more than the line brings, and than the board reads. They allow no slowing
    on the way, so that a queue which runs low would end in an underrun."""
    segments = motion(1000, ticks=8_000)
    run = streamed(segments, bytes_s, 0.0)
    assert_kept_its_pace(segments, run)
    assert run[0].path_clock_percent == pytest.approx(min(25, 5 * bytes_s / 3_000), abs=4)


@pytest.mark.parametrize("moving", [2, 3, 4])
@pytest.mark.parametrize("ticks", [8_000, 16_000])
def test_a_board_with_four_joints_reads_stretched_segments_in_time(moving, ticks):
    """A good line, and segments as short as that: what slows them down is what the board needs to read them."""
    board, told = BOARDS["uno_four"], []
    segments = motion(300, ticks, moving=moving, board=board)
    result = stream_plan(SimTransport(released_image(board.name), board=board), segments, told.append)
    running = [one for one in told if one.state is not State.READY]
    assert {one.state for one in running} == {State.RUNNING}, "it never starved"
    assert {one.rate_percent for one in running} == {result.path_clock_percent}
    assert result.path_clock_percent < 100


def test_at_full_speed_they_would_run_dry(monkeypatch):
    """The same without the slowing: what the forecast is for."""
    monkeypatch.setattr("planarm.link.margin.LEAST_SEEN_BYTES", 10**9)
    with pytest.raises(Exception, match=r"ran empty|on its tick"):
        streamed(motion(1000, ticks=8_000), 3_000, 0.0)
