"""The main job on real input: both cases of paper C's Table I, every planner, down to the emulated Uno's pins."""

import json
from pathlib import Path

import numpy as np
import pytest

from planarm.cli.main import main
from planarm.plan_file import load_plan
from planarm.stepping.segments import expand
from planarm_sim.trace import read_vcd

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PLANNERS = ("a_star", "modified_a_star", "chaos_a_star", "chs")


@pytest.fixture(scope="module", params=[(case, planner) for case in (1, 2) for planner in PLANNERS], ids=str)
def run(request, tmp_path_factory):
    """One run of the command line in virtual time: its exit code, its JSON, its folder."""
    case, planner = request.param
    out = tmp_path_factory.mktemp("run")
    scene = EXAMPLES / f"table1_case{case}.toml"
    with pytest.MonkeyPatch.context() as patch:
        printed: list[str] = []
        patch.setattr("builtins.print", lambda *words, **_: printed.append(" ".join(map(str, words))))
        with pytest.raises(SystemExit) as left:
            main(["run", str(scene), "--planner", planner, "--json", "--out", str(out)])
    return left.value.code, printed, out


def test_the_run_succeeds_and_prints_one_json_object(run):
    code, printed, _ = run
    assert code == 0, printed
    summary = json.loads(printed[-1])
    assert {"path_length_cm", "plan_ms", "motion_s", "steps_planned", "steps_at_pins"} <= set(summary)


def test_steps_at_the_pins_equal_the_plan_on_their_very_ticks(run):
    summary = json.loads((run[2] / "summary.json").read_text())
    assert summary["steps_at_pins"] == summary["steps_planned"]
    assert min(summary["steps_planned"]) > 1000
    assert summary["max_step_timing_error_ticks"] == 0


def test_the_tip_ends_within_the_bound_of_the_scene(run):
    """Half a micro-step a joint times its lever arm; under 0.5 mm in the shipped scenes."""
    summary = json.loads((run[2] / "summary.json").read_text())
    assert summary["tip_error_mm"] <= summary["tip_bound_mm"] < 0.5


def test_pulses_keep_the_protocols_least_widths(run):
    """protocol/messages.toml: 2 us high, 2 us low, 20 us from DIR to STEP."""
    summary = json.loads((run[2] / "summary.json").read_text())
    assert summary["min_pulse_high_us"] >= 2.0
    assert summary["min_pulse_low_us"] >= 2.0
    assert summary["min_dir_setup_us"] >= 20.0


def test_the_trace_on_disk_holds_the_plans_steps(run):
    """A second witness: the VCD file, read back, against the plan file, read back."""
    out = run[2]
    plan = load_plan(out / "run.plan")
    vcd = read_vcd(out / "trace.vcd")
    schedule = expand(plan.segments)
    rises = [vcd.edges[pin]["cycle"][vcd.edges[pin]["level"] == 1] for pin in ("D9", "D10")]
    begin = min(r[0] for r in rises) - min(joint.ticks[0] for joint in schedule.steps)
    for seen, joint in zip(rises, schedule.steps, strict=True):
        np.testing.assert_array_equal(seen - begin, joint.ticks)


def test_the_pictures_are_there(run):
    for name in ("workspace.png", "joint_angles.png", "step_rates.png"):
        assert (run[2] / name).read_bytes().startswith(b"\x89PNG")
