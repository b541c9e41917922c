"""A run's record: what a page shows of it, held against the stages' own values."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import trapezoid

from planarm.cli.main import main
from planarm.dynamics.rigid_body import RigidBody, kinetic_energy_j
from planarm.errors import LinkError, StepsDifferError
from planarm.pipeline import plan_scene, run_scene
from planarm.record.curves import planned_curves, step_rates_hz
from planarm.record.histograms import interval_histogram, width_histogram
from planarm.record.outcome import Outcome, StreamSample
from planarm.record.run_record import run_record
from planarm.run_folder.folder import read_record
from planarm.scene import ObstacleMotion, load_scene

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
SCENE = load_scene(SCENARIOS / "arm.toml")


def quiet(_stage, _share):
    return None


@pytest.fixture(scope="module")
def plan():
    return plan_scene(SCENE, quiet)


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    out = tmp_path_factory.mktemp("clean")
    return run_scene(SCENE, "sim://", out, quiet), out


def failed(tmp_path, name, kind):
    with pytest.raises(kind):
        run_scene(SCENE, "sim://", tmp_path, quiet, faults=SCENARIOS / name)
    return read_record(tmp_path)


def test_a_clean_run_is_green_and_its_figures_are_the_summary(clean):
    summary, out = clean
    record = read_record(out)
    assert record["verdict"]["state"] in ("green", "amber")
    assert record["error"] is None
    assert record["summary"] == json.loads(json.dumps(summary))
    steps = summary["steps_at_pins"]
    assert [sum(row) for row in record["timing"]["errors"]["counts"]] == steps
    assert sum(map(sum, record["timing"]["widths"]["counts"])) == sum(steps)
    assert [sum(row) for row in record["timing"]["intervals"]["counts"]] == [n - 1 for n in steps]


def test_the_real_curve_keeps_the_largest_error_and_the_streams_time_is_the_plans(clean):
    summary, out = clean
    record = read_record(out)
    assert max(record["real"]["tip_error_mm"]) == pytest.approx(summary["arm_max_tip_error_mm"], abs=1e-4)
    stream = record["stream"]
    late = [t - path for t, path in zip(stream["t_s"], stream["path_s"], strict=True) if path > 0.05]
    assert all(-1e-6 < one < 0.06 for one in late), "a status tells segments that have ended, soon after their end"


def test_the_page_is_drawn_again_from_the_record_byte_by_byte(clean, tmp_path, capsys):
    _, out = clean
    with pytest.raises(SystemExit) as left:
        main(["report", str(out), "--out", str(tmp_path), "--json"])
    assert left.value.code == 0
    assert json.loads(capsys.readouterr().out)["report"] == str(tmp_path / "report.html")
    assert (tmp_path / "report.html").read_bytes() == (out / "report.html").read_bytes()


def test_a_jammed_rotor_is_red_with_every_slip_at_its_moment(tmp_path):
    record = failed(tmp_path, "mechanics_stall.toml", StepsDifferError)
    assert record["verdict"]["state"] == "red"
    slips = [event for event in record["events"] if "slipped" in event["text"]]
    assert slips and all(0.1 < event["t_s"] < 0.5 for event in slips), "jammed from 0.1 s on, for 0.1 s"
    injected = [event["t_s"] for event in record["events"] if event["lane"] == "injected"]
    assert injected[0] == pytest.approx(0.1, abs=0.02)


def test_what_is_sent_again_is_on_the_time_axis(tmp_path):
    summary = run_scene(SCENE, "sim://", tmp_path, quiet, faults=SCENARIOS / "line_drop.toml")
    record = read_record(tmp_path)
    again = [event for event in record["events"] if "sent again" in event["text"]]
    assert sum(int(event["text"].split()[0]) for event in again) == summary["retransmissions"] > 0
    assert all(event["lane"] == "line" and event["severity"] == "warn" for event in again)
    assert all(event["t_s"] < record["stream"]["t_s"][-1] for event in again)
    moments = record["stream"]["t_s"]
    assert len(set(moments)) == len(moments), "a resending is no status of its own"


def test_a_pulled_cable_leaves_a_whole_folder_with_the_error_in_it(tmp_path):
    record = failed(tmp_path, "line_unplug.toml", LinkError)
    assert record["error"]["kind"] == "StreamError"
    assert record["verdict"]["why"] == record["error"]["message"]
    assert [event["text"].split(":")[0] for event in record["events"] if event["lane"] == "line"] == ["StreamError"]
    at_pins, planned = record["summary"]["steps_at_pins"], record["summary"]["steps_planned"]
    assert sum(at_pins) > 0 and all(made <= whole for made, whole in zip(at_pins, planned, strict=True))
    assert json.loads((tmp_path / "summary.json").read_text())["error"]["kind"] == "StreamError"
    assert (tmp_path / "report.html").is_file()


def test_planned_energy_is_the_bodys_and_work_ends_as_heat(plan):
    curves, scene = planned_curves(plan), plan.scene
    q, qd, _ = plan.trajectory.sample(np.array(curves["t_s"]))
    middle = len(q) // 2
    joules = kinetic_energy_j(RigidBody.of(scene), q[middle], qd[middle])
    assert curves["kinetic_mj"][middle] == pytest.approx(1e3 * joules, rel=1e-3)
    friction = np.array(scene.mechanics.coulomb_friction_nm) * np.abs(qd)
    friction = friction + np.array(scene.mechanics.viscous_friction_nm_s) * qd**2
    lost_j = trapezoid(friction.sum(axis=1), curves["t_s"])
    # An arm that lies flat and rests at both ends has only its friction to pay for.
    assert curves["work_mj"][-1] == pytest.approx(1e3 * lost_j, rel=0.02)


def test_torque_shares_are_those_of_the_certificate(plan):
    shares = planned_curves(plan)["torque_percent"]
    checks = {check.name: check.value for check in plan.certificate.checks}
    for joint, row in enumerate(shares, start=1):
        largest = 100 * checks[f"joint {joint} share of the pull-out torque"]
        assert 0.8 * largest < max(row) < 1.05 * largest


def test_a_rate_is_one_over_the_interval_around_a_moment_and_peaks_are_kept():
    times_s = np.array([0.0, 0.1, 0.2, 0.21, 0.31])
    rates = step_rates_hz(times_s, np.array([1, 1, 1, 1, -1], np.int8), np.linspace(0.0, 0.4, 9))
    assert rates[0] == pytest.approx(10.0)
    assert rates[4] == pytest.approx(100.0), "0.2 s to 0.21 s"
    assert rates[5] == pytest.approx(-10.0)
    assert rates[7] == 0.0, "after the last step there is no rate"


def test_histograms_of_nothing_are_none():
    nothing = np.empty(0, np.int64)
    assert interval_histogram([nothing, nothing]) is None
    assert width_histogram([(nothing, nothing)]) is None


def test_on_a_real_port_time_comes_from_what_the_device_told(plan):
    samples = tuple(StreamSample(7.0 + t, max(0.0, t - 0.012), int(t * 50), 3, "running") for t in (0.0, 0.1, 0.2))
    outcome = Outcome(plan, {}, samples)
    assert outcome.start_s == pytest.approx(7.012)
    record = run_record(outcome)
    assert record["real"] is None and record["pins"] is None and record["timing"]["errors"] is None
    assert record["timing"]["intervals"] is not None, "as planned"


def test_a_moving_obstacle_is_told_where_it_is_over_time(plan):
    motion = ObstacleMotion((0.0, 1.0), ((0.0, 0.0), (4.0, -2.0)), False)
    [obstacle] = plan.scene.obstacles
    scene = replace(plan.scene, obstacles=(replace(obstacle, motion=motion),))
    [told] = run_record(Outcome(replace(plan, scene=scene), {}))["obstacles"]
    times, (dx, dy) = np.array(told["motion"]["t_s"]), told["motion"]["offset_cm"]
    np.testing.assert_allclose(dx, 4.0 * np.minimum(times, 1.0), atol=1e-3)
    np.testing.assert_allclose(dy, -2.0 * np.minimum(times, 1.0), atol=1e-3)
    assert times[-1] > plan.trajectory.duration_s
