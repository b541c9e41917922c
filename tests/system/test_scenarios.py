"""Everything that can go wrong, one file each in tests/scenarios: the schedule, and what should come of it as data."""

import tomllib
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planarm.errors import DeviceFault, HostKilledError, LinkError
from planarm.link.arm_record import ArmSetup
from planarm.link.transport import open_transport
from planarm.pipeline import plan_scene
from planarm.record.look import judge_emulated_arm, judge_pins
from planarm.scene import BoardSpec, load_scene
from planarm.streaming.plan_stream import options_for, stream
from planarm_sim.faults import KINDS, load_schedule

FOLDER = Path(__file__).resolve().parents[1] / "scenarios"
SCENARIOS = sorted(path for path in FOLDER.glob("*.toml") if path.name != "arm.toml")
REST_RAD = 1e-4


@pytest.fixture(scope="module")
def plan():
    scene = replace(load_scene(FOLDER / "arm.toml"), board_spec=BoardSpec(stop_input=True))
    return plan_scene(scene, lambda _stage, _share: None)


class Outcome:
    """One run of the short motion under a schedule of faults."""

    def __init__(self, plan, faults):
        self.kind, self.position, self.retransmissions = "done", None, 0
        with closing(
            open_transport("sim://", 250_000, ArmSetup(plan.scene, plan.segments.start_usteps, faults))
        ) as line:
            try:
                how = options_for(plan.scene, plan.segments)
                result = stream(plan.segments, plan.certificate, line, None, how)
                self.retransmissions = result.retransmissions
            except (LinkError, DeviceFault, HostKilledError) as error:
                names = {LinkError: "link", DeviceFault: "fault", HostKilledError: "killed"}
                self.kind = next(name for kind, name in names.items() if isinstance(error, kind))
                self.position = getattr(error, "position", None)
            line.arm.settle(1.0)
            self.switch_pin = line.uno.pin("A1").level
            self.arm = judge_emulated_arm(plan, judge_pins(plan.segments, line.pins), line.arm)
        if self.kind == "done" and not self.arm.clean:
            self.kind = "arm"


def check(outcome, expected):
    """Every key of `expected` is a statement about the outcome."""
    record = outcome.arm.record
    lost = record.lost_full_steps
    told = " ".join(record.faults)
    expected = dict(expected)
    assert expected.pop("why")
    statements = {
        "outcome": lambda value: outcome.kind == value,
        "position": lambda value: outcome.position.certainty.value == value,
        "lost_full_steps": lambda value: list(lost) == value,
        "lost_some_steps": lambda value: any(lost) == value,
        "lost_in_fours": lambda motor: lost[motor - 1] != 0 and lost[motor - 1] % 4 == 0,
        "slips_of": lambda motor: any(loss.motor == motor and abs(loss.full_steps) == 4 for loss in record.lost),
        "tip_error_mm_below": lambda value: outcome.arm.tip_error_mm.max() < value,
        "retransmissions_at_least": lambda value: outcome.retransmissions >= value,
        "told": lambda value: value in told,
        "rests": lambda value: (np.ptp(record.q_rad[-40:], axis=0).max() < REST_RAD) == value,
        "moves": lambda value: (np.ptp(record.q_rad, axis=0).max() > 0.01) == value,
        "switch_pin_low": lambda value: (outcome.switch_pin == 0) == value,
    }
    for key, value in expected.items():
        assert statements[key](value), (key, value, outcome.kind, outcome.position, lost, told, outcome.arm.explain())


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_what_goes_wrong_has_its_written_outcome(plan, path):
    check(Outcome(plan, path), tomllib.loads(path.read_text())["expected"])


def test_every_kind_of_fault_is_in_some_scenario():
    assert {fault.kind for path in SCENARIOS for fault in load_schedule(path).faults} == set(KINDS)


def test_the_same_schedule_gives_the_same_run_and_another_seed_another(plan, tmp_path):
    path = tmp_path / "noise.toml"
    path.write_text('seed = 1\nzero = "power_up"\n[[faults]]\nkind = "line.flip"\nshare = 0.005\n')
    first, again = Outcome(plan, path), Outcome(plan, path)
    np.testing.assert_array_equal(first.arm.record.q_rad, again.arm.record.q_rad)
    assert first.arm.record.faults == again.arm.record.faults
    path.write_text(path.read_text().replace("seed = 1", "seed = 2"))
    assert Outcome(plan, path).arm.record.faults != first.arm.record.faults


def test_without_faults_the_short_motion_is_clean(plan):
    outcome = Outcome(plan, None)
    assert outcome.kind == "done"
    assert outcome.arm.tip_error_mm.max() < 1.0
