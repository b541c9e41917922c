"""Paper B's environments on the emulated Uno: steps as planned, and no link ever at an obstacle at its time."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from moving_scenes import clearance_at, environment, quiet
from planarm.errors import NoPathError, SceneError
from planarm.link.arm_record import ArmSetup
from planarm.link.transport import open_transport
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.pipeline import plan_scene, run_scene
from planarm.record.arm_findings import judge_arm
from planarm.record.look import judge_emulated_arm, judge_pins
from planarm.run_folder.summary import planned_figures
from planarm.scene import ObstacleMotion
from planarm.stepping.certify import certify
from planarm.streaming.plan_stream import stream

QUEUED_S = 1.0
"""The device's queue holds less than this of such a slow motion, and hides a pause of the host for as long."""


def on_the_bench(plan):
    """Stream the plan to the emulated Uno; what the pins and the arm did."""
    with closing(open_transport("sim://", 250_000, ArmSetup(plan.scene, plan.segments.start_usteps))) as line:
        stream(plan.segments, plan.certificate, line, None)
        findings = judge_pins(plan.segments, line.pins)
        return findings, judge_emulated_arm(plan, findings, line.arm)


@pytest.fixture(scope="module")
def plan():
    return plan_scene(environment(1, faster=1.6), quiet)


@pytest.fixture(scope="module")
def run(plan):
    return on_the_bench(plan)


def assert_as_planned_and_clear(plan, findings, arm):
    assert findings.comparison.agrees, findings.comparison.explain()
    assert arm.clean, arm.explain()
    # The links as the plant had them, 2000 times a second, looked at by shapely every 25 ms.
    q_rad = arm.record.q_rad[-len(arm.t_s) :]
    for at in range(0, len(arm.t_s), 50):
        assert clearance_at(plan.scene, q_rad[at], float(arm.t_s[at])) > 0.5 * plan.scene.arm.link_width_cm


def test_steps_are_the_plans_and_no_link_touches_an_obstacle_at_its_time(plan, run):
    assert plan.certificate.ok, plan.certificate.explain()
    assert plan.moving.delay_margin_s >= plan.scene.moving.delay_margin_s
    plain, modified = planned_figures(plan)["rules"]
    assert plain["outcome"] == "contact"
    assert plain["what"].startswith("obstacles[1] touches a link at sample 18")
    assert (modified["outcome"], modified["what"]) == ("reached", "reached at sample 65")
    assert_as_planned_and_clear(plan, *run)


@pytest.mark.parametrize(("number", "smoothing"), [(1, "pso"), (2, "none"), (2, "pso")])
def test_both_environments_run_at_their_own_pace(number, smoothing, sized):
    if not sized(0, 1):
        pytest.skip("the other environments at their own pace take a minute each: --full")
    plan = plan_scene(environment(number, smoothing=smoothing), quiet)
    assert plan.certificate.ok, plan.certificate.explain()
    assert_as_planned_and_clear(plan, *on_the_bench(plan))


PAUSE = """
seed = 1
zero = "first_step"
[[faults]]
kind = "host.pause"
at_s = 3.0
for_s = {for_s}
"""


@pytest.mark.parametrize(("for_s", "replans"), [(0.6, 0), (2.5, 1)], ids=["within its margin", "beyond"])
def test_an_arm_that_is_held_up_goes_on_late_or_is_planned_again_and_touches_nothing(for_s, replans, tmp_path, sized):
    """The host does nothing for a while: the queue starves, and the arm rests on its path until segments come."""
    if not sized(0, 1):
        pytest.skip("emulates a minute of motion: --full")
    faults = tmp_path / "pause.toml"
    faults.write_text(PAUSE.format(for_s=for_s))
    summary = run_scene(environment(1, faster=1.6), "sim://", tmp_path / "out", quiet, faults=faults)
    assert len(summary["replans"]) == replans
    assert summary["arm_touches"] == 0
    assert summary["arm_clean"]
    assert summary["tip_error_mm"] < 0.1  # it has arrived
    late_s = max([summary["late_s"], *(one["late_s"] for one in summary["replans"])])
    assert max(0.0, for_s - QUEUED_S) < late_s < for_s + 0.5


def sooner(motion, by_s):
    """The motion, begun earlier."""
    times = tuple(max(0.0, t - by_s) + 1e-3 * n for n, t in enumerate(motion.times_s))
    return replace(motion, times_s=times)


def test_an_arm_that_was_late_by_more_than_its_margin_is_seen_to_touch(plan, run):
    """The same record among obstacles that are 3 s ahead: the findings name what the links meet."""
    ahead = tuple(replace(o, motion=sooner(o.motion, 3.0)) for o in plan.scene.obstacles)
    _, arm = run
    start_tick = int(arm.record.ticks[-1]) - round(float(arm.t_s[-1]) * 16e6)
    again = judge_arm(replace(plan, scene=replace(plan.scene, obstacles=ahead)), arm.record, start_tick)
    assert again.record.touches
    assert "touched obstacles[" in again.explain()


def test_start_and_goal_must_be_nodes_that_can_be_taken():
    scene = environment(1)
    with pytest.raises(SceneError, match=r"task\.goal_cm: .* is no node of the grid"):
        plan_scene(replace(scene, task=replace(scene.task, goal_cm=(-8.5, 90.0))), quiet)
    with pytest.raises(SceneError, match=r"task\.goal_cm: .* out of reach"):
        plan_scene(replace(scene, task=replace(scene.task, goal_cm=(-90.0, 90.0))), quiet)
    short = replace(scene, moving=replace(scene.moving, samples=30))
    with pytest.raises(NoPathError, match="reaches the goal within 30 samples"):
        plan_scene(short, quiet)


def test_the_certificate_goes_red_when_an_obstacle_is_elsewhere_at_the_time(plan):
    scene = plan.scene
    tip = plan.trajectory.sample(np.array([4.0]))[0]
    assert clearance_at(scene, tip[0], 4.0) > scene.margin_cm
    # Obstacle 1 darts to where the tip is after 4 s: it comes a moment before and leaves a moment later.
    x, y = forward(Arm.from_spec(scene.arm), tip[0])[-1]
    near = (x - scene.obstacles[0].center_cm[0], y - scene.obstacles[0].center_cm[1])
    far = (near[0], near[1] + 300.0)
    dart = ObstacleMotion((0.0, 3.9, 4.0, 4.1), ((0.0, 0.0), far, near, far), False)
    moved = replace(scene, obstacles=(replace(scene.obstacles[0], motion=dart), *scene.obstacles[1:]))
    checks = certify(moved, plan.trajectory, plan.train, plan.segments).checks
    bad = next(check for check in checks if check.name.startswith("clearance"))
    assert bad.verdict == "red"
    assert "obstacles[1] at 3.9" in bad.where or "obstacles[1] at 4.0" in bad.where
