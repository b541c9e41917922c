"""A recording with known defects, in each format: every defect is found at its time and joint, and nothing else."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from captures import SALEAE_MAP, TICK_PS, Train, two_joints, write_saleae, write_sigrok, write_vcd
from planarm.analysis.capture import open_capture
from planarm.analysis.channels import map_channels
from planarm.analysis.step_match import Schedule
from planarm.analysis.timing import PulseLimits, TimingRules, analyse
from planarm.errors import CaptureError
from planarm_wire.messages import BOARDS, TICKS_HZ

PINS = BOARDS["uno"].joint_pins

DRIVER = PulseLimits(step_high_s=1.9e-6, step_low_s=1.9e-6, dir_setup_s=0.65e-6, dir_hold_s=0.65e-6)
FORMATS = {
    "planarm.vcd": (write_vcd, [], 0.0002),
    "simavr.vcd": (functools.partial(write_vcd, timescale="1ns", scope="logic", initial="x"), [], 0.002),
    "pulseview.vcd": (functools.partial(write_vcd, timescale="1 ns", scope="libsigrok"), [], 0.002),
    "saleae.csv": (write_saleae, SALEAE_MAP, 0.002),
    "sigrok.csv": (write_sigrok, [], 0.3),
}
START_PS = 123_456_700
CLOCK = 1.0035


def schedules_of(train: Train) -> list[Schedule]:
    return [
        Schedule(np.array([p.rise_ps for p in pulses]), np.array([1 if p.positive else -1 for p in pulses], np.int8))
        for pulses in train.joints
    ]


def judged(tmp_path, kind, recorded, planned, rules=None):
    write, words, _ = FORMATS[kind]
    path = tmp_path / kind
    write(path, recorded)
    capture = open_capture(path)
    return analyse(
        capture,
        map_channels(path, capture.channels, words, PINS),
        None if planned is None else schedules_of(planned),
        rules or TimingRules((DRIVER, DRIVER), tolerance_us=1.5),
    )


@pytest.mark.parametrize("kind", FORMATS)
def test_a_faithful_recording_has_no_finding_whatever_its_clock_and_start(kind, tmp_path):
    train = two_joints()
    report = judged(tmp_path, kind, train.scaled(CLOCK).moved(START_PS), train)
    resolution_us = FORMATS[kind][2]
    assert report.ok and not report.findings
    assert report.clock_ppm == pytest.approx(1e6 * (1 / CLOCK - 1), abs=1.0)
    assert report.start_s == pytest.approx(START_PS * 1e-12, abs=1e-6 * max(resolution_us, 1e-3))
    for joint in report.joints:
        assert (joint.steps, joint.steps_planned, joint.net_usteps) == (300, 300, 0)
        assert joint.timing_error.max_us <= resolution_us
        assert joint.high_min_us == pytest.approx(3.125, abs=resolution_us)
        assert joint.dir_setup_min_us == pytest.approx(20.0, abs=resolution_us)


@pytest.mark.parametrize("kind", FORMATS)
def test_each_of_six_defects_is_found_at_its_time_and_joint_and_nothing_else(kind, tmp_path):
    """One missing, one extra, one late by 3 us, one DIR too late, one pulse too short; clock off by 0.35 %."""
    train = two_joints()
    second = train.joints[1]
    turn = next(n for n in range(1, 300) if second[n].positive != second[n - 1].positive)
    spoiled = (
        train.with_extra(1, 40)
        .changed(0, 200, rise_ps=train.joints[0][200].rise_ps + 3_000_000)
        .changed(1, turn + 1, setup_ps=100_000)
        .changed(0, 120, high_ps=900_000)
        .without(0, 30)
    )
    report = judged(tmp_path, kind, spoiled.scaled(CLOCK).moved(START_PS), train)
    due = lambda joint, n: train.joints[joint][n].rise_ps * 1e-12  # noqa: E731
    expected = {
        ("missing", 1): due(0, 30),
        ("late", 1): due(0, 200) + 3e-6,
        ("step_high", 1): due(0, 120) + 0.9e-6,
        ("extra", 2): 0.5 * (due(1, 40) + due(1, 41)),
        ("dir_setup", 2): due(1, turn),
    }
    found = {(f.kind, f.joint): f for f in report.findings}
    assert len(report.findings) == len(expected) == sum(report.counts.values())
    assert set(found) == set(expected)
    for key, path_s in expected.items():
        assert found[key].path_s == pytest.approx(path_s, abs=2e-6), key
        assert found[key].time_s == pytest.approx(path_s * CLOCK + START_PS * 1e-12, abs=2e-6), key
    assert found["late", 1].value_us == pytest.approx(3.0, abs=FORMATS[kind][2] + 0.05)
    assert found["step_high", 1].limit_us == pytest.approx(1.9)
    assert found["dir_setup", 2].value_us == pytest.approx(0.1, abs=FORMATS[kind][2])


@pytest.mark.parametrize("end", ["first", "last"])
def test_a_step_missing_at_an_end_is_that_step(end, tmp_path):
    train = two_joints()
    n = 0 if end == "first" else 299
    report = judged(tmp_path, "planarm.vcd", train.without(0, n).scaled(CLOCK), train)
    assert [(f.kind, f.joint) for f in report.findings] == [("missing", 1)]
    assert report.findings[0].path_s == pytest.approx(train.joints[0][n].rise_ps * 1e-12)


def test_a_step_the_wrong_way_is_told(tmp_path):
    train = two_joints()
    report = judged(tmp_path, "planarm.vcd", train.changed(1, 20, positive=False), train)
    assert report.counts == {"direction": 1}
    assert report.joints[1].wrong_direction == 1


def test_a_recording_of_something_else_is_not_aligned(tmp_path):
    other = two_joints(seed=2).scaled(1.3)
    report = judged(tmp_path, "planarm.vcd", other, two_joints())
    assert not report.ok
    assert not report.aligned or report.counts


def test_a_motion_that_paused_has_its_steps_counted_and_is_told_once(tmp_path):
    train = two_joints()
    middle_ps = train.joints[0][150].rise_ps
    paused = train._each(lambda p: replace(p, rise_ps=p.rise_ps + (700_000_000_000 if p.rise_ps > middle_ps else 0)))
    report = judged(tmp_path, "planarm.vcd", paused.without(1, 250), train)
    assert report.counts == {"stretched": 1, "missing": 1}
    missing = next(f for f in report.findings if f.kind == "missing")
    assert missing.joint == 2
    assert [joint.missing + joint.extra for joint in report.joints] == [0, 1]


@pytest.mark.parametrize("gone", [2, 8])
def test_several_steps_missing_in_a_row_are_each_told(gone, tmp_path):
    train = two_joints()
    spoiled = train
    for _ in range(gone):
        spoiled = spoiled.without(0, 100)
    report = judged(tmp_path, "planarm.vcd", spoiled, train)
    assert report.counts == {"missing": gone}


def test_an_interrupt_that_held_an_edge_up_is_named(tmp_path):
    train = two_joints()
    late = train.changed(0, 100, rise_ps=train.joints[0][100].rise_ps + 5_000_000)
    path = tmp_path / "with_isr.vcd"
    write_vcd(path, late)
    due = train.joints[0][100].rise_ps // 100
    text = path.read_text().replace("$upscope", "$var wire 8 ~ isr $end\n$upscope")
    lines = text.splitlines()
    at = next(n for n, line in enumerate(lines) if line.startswith("#") and int(line[1:]) > due)
    lines[at:at] = [f"#{due - 20_000}", "b10010 ~", f"#{due + 45_000}", "b0 ~"]
    path.write_text("\n".join(lines) + "\n")
    capture = open_capture(path)
    report = analyse(capture, map_channels(path, capture.channels, [], PINS), schedules_of(train), TimingRules())
    assert [(f.kind, f.cause) for f in report.findings] == [("late", "interrupt USART_RX")]


def test_without_a_plan_only_what_the_lines_show_is_told(tmp_path):
    train = two_joints()
    rules = TimingRules((replace(DRIVER, step_high_s=4e-6), DRIVER), band_hz=(1.0, 1e6))
    report = judged(tmp_path, "planarm.vcd", train, None, rules)
    assert report.counts == {"step_high": 300}
    assert report.clock_ppm is None and report.joints[0].timing_error is None
    first = [p.rise_ps for p in train.joints[0]]
    assert report.joints[0].band_s == pytest.approx((first[-1] - first[0]) * 1e-12)
    assert report.joints[0].shortest_interval_us == pytest.approx(np.diff(first).min() / 1e6)
    counted = np.array(report.joints[0].rate_hz) * (report.end_s - report.begin_s) / len(report.joints[0].rate_hz)
    assert np.abs(counted).sum() == pytest.approx(300, abs=2)


def test_the_rate_curve_has_the_sign_of_the_direction(tmp_path):
    report = judged(tmp_path, "planarm.vcd", two_joints(), None)
    rate = np.array(report.joints[0].rate_hz)
    assert (rate[:150] >= 0).all() and (rate[-150:] <= 0).all() and rate.any()


def test_a_plan_of_other_joints_is_refused(tmp_path):
    train = two_joints()
    write_vcd(tmp_path / "a.vcd", train)
    capture = open_capture(tmp_path / "a.vcd")
    with pytest.raises(CaptureError, match="the plan has 1 joints, 2 are mapped"):
        analyse(capture, map_channels(capture.path, capture.channels, [], PINS), schedules_of(train)[:1], TimingRules())


def test_lines_that_never_rise_are_told(tmp_path):
    write_vcd(tmp_path / "a.vcd", replace(two_joints(), joints=((), ())))
    capture = open_capture(tmp_path / "a.vcd")
    with pytest.raises(CaptureError, match="no STEP line rises"):
        analyse(capture, map_channels(capture.path, capture.channels, [], PINS), None, TimingRules())


def test_ticks_are_as_wide_as_the_firmwares():
    assert TICK_PS * TICKS_HZ == 10**12
