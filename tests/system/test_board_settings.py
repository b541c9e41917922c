"""What a scene says of its board holds on the emulated one: inputs, power, polarity, soft limits; and no arm falls."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planarm.errors import LinkError
from planarm.link.arm_record import ArmSetup
from planarm.link.exchange import open_session, request
from planarm.link.position import Certainty, StreamFault
from planarm.link.positions import Positions
from planarm.link.stream_values import position_of
from planarm.link.transport import open_transport
from planarm.model.transmission import Transmission
from planarm.operations.arm_moves import goto, jog
from planarm.operations.homing import home
from planarm.pipeline import plan_scene
from planarm.record.look import judge_emulated_arm, judge_pins
from planarm.scene import BoardSpec, LimitSwitchSpec, load_scene
from planarm.streaming.plan_stream import options_for, stream
from planarm.streaming.pressed import switch_doubts
from planarm.streaming.standing import look, look_and_configure, pose_of, require_standing, tell, usteps_at
from planarm_wire.messages import EMERGENCY_CODE, Clear, Enable, Fault, Query, State

SCENE = Path(__file__).resolve().parents[1] / "scenarios" / "arm.toml"
PORT = "/dev/ttyUNO"
STEP, ENABLE = "D9", "D8"
TICKS_S = 1.0 / 16e6
STOPPED_S = 0.0001
"""From the contact's opening to the last edge: the main loop looks at its pin in every pass."""


@pytest.fixture(scope="module")
def plan():
    return plan_scene(
        replace(load_scene(SCENE), limit_switches=(), board_spec=BoardSpec()), lambda _stage, _share: None
    )


@pytest.fixture
def positions(tmp_path):
    return Positions(tmp_path / "positions.json")


def line_to(scene, usteps, faults=None):
    return open_transport("sim://", 250_000, ArmSetup(scene, usteps, faults))


def run(plan, scene, faults=None):
    """Stream the plan of a scene on the board of another, told where its arm stands; return the line and the result."""
    line = line_to(scene, plan.segments.start_usteps, faults)
    session = open_session(line)
    request(line, session, position_of(plan.segments.start_usteps, session.joints))
    return line, lambda: stream(plan.segments, plan.certificate, line, None, options_for(scene, plan.segments))


def with_board(plan, **settings):
    return replace(plan.scene, board_spec=BoardSpec(**settings))


def ends_rad(plan):
    """Joint 1 where the plan begins and ends."""
    return Transmission.of(plan.scene).q_rad([plan.train.start_usteps, plan.train.end_usteps])[:, 0]


def rises_s(line, pin):
    edges = line.pins.edges(pin)
    return edges["cycle"][edges["level"] == 1] * TICKS_S


def falls_s(line, pin):
    edges = line.pins.edges(pin)
    return edges["cycle"][edges["level"] == 0] * TICKS_S


@pytest.mark.parametrize("releases", [False, True])
def test_an_open_stop_contact_ends_the_run_with_its_fault(plan, tmp_path, releases):
    faults = tmp_path / "stop.toml"
    faults.write_text('[[faults]]\nkind = "mechanics.stop_input"\nat_s = 0.2\n')
    line, go = run(plan, with_board(plan, stop_input=True, emergency_releases=releases), faults)
    with pytest.raises(
        StreamFault, match="the stop input opened; the position is lost; close the stop circuit"
    ) as told:
        go()
    assert told.value.position.certainty is not Certainty.EXACT
    line.arm.settle(0.1)
    steps = rises_s(line, STEP)
    assert steps[-1] <= steps[0] + 0.2 + STOPPED_S
    released = line.uno.pin(ENABLE).level == 1
    assert released == releases


def test_a_stop_contact_that_is_open_from_the_start_is_told_of_and_nothing_moves(plan, tmp_path):
    faults = tmp_path / "stop.toml"
    faults.write_text('zero = "power_up"\n[[faults]]\nkind = "mechanics.stop_input"\n')
    line, go = run(plan, with_board(plan, stop_input=True), faults)
    with pytest.raises(Exception, match="the stop input opened"):
        go()
    assert len(rises_s(line, STEP)) == 0


def test_the_stop_input_is_not_watched_unless_the_scene_says_so(plan):
    line, go = run(plan, plan.scene)
    line.uno.pin("A0").drive(1)
    go()


def test_idle_drivers_are_released_after_the_time_told(plan):
    line, go = run(plan, with_board(plan, idle_release_s=5.0))
    go()
    assert line.uno.pin(ENABLE).level == 0
    end_s = max(rises_s(line, pin)[-1] for pin in ("D9", "D10"))
    line.arm.settle(6.0)
    released_s = rises_s(line, ENABLE)[-1]
    assert 5.0 <= released_s - end_s < 5.1


def test_active_high_drivers_are_driven_high_and_make_every_step(plan):
    scene = with_board(plan, enable_active_high=True)
    line, go = run(plan, scene)
    go()
    assert line.uno.pin(ENABLE).level == 1
    line.arm.settle(0.5)
    assert judge_emulated_arm(replace(plan, scene=scene), judge_pins(plan.segments, line.pins), line.arm).clean


def test_the_first_step_waits_until_the_drivers_are_awake_and_the_host_knows(plan):
    line, go = run(plan, with_board(plan, wake_s=0.6))
    result = go()
    enabled_s = falls_s(line, ENABLE)[-1]
    first_s = min(rises_s(line, pin)[0] for pin in ("D9", "D10"))
    assert 0.6 <= first_s - enabled_s < 0.7
    first_tick = min(joint.ticks[0] for joint in plan.train.steps if len(joint.ticks)) * TICKS_S
    assert result.began_s.least - 1e-3 <= first_s - first_tick <= result.began_s.most + 1e-3


def test_drivers_that_are_awake_are_not_waited_for_again(plan, positions):
    scene, start = with_board(plan, wake_s=3.0), plan.segments.start_usteps
    line = line_to(scene, start)
    line.clock.wait_until(0.05)
    tell(line, PORT, scene, positions, start, "zeroed")
    took_s = []
    for degrees in (-1.0, 1.0):
        standing = look_and_configure(line, PORT, scene, positions)
        took_s.append(jog(line, scene, standing, 1, np.radians(degrees), lambda _told: None)[1].duration_s)
    assert took_s[0] > 3.0
    assert took_s[1] < 1.0


def test_a_switch_that_the_arm_presses_in_a_run_is_a_fault_that_names_the_joint(plan):
    q_rad = ends_rad(plan)
    switch = LimitSwitchSpec(1, "A1", float(0.5 * q_rad.sum()), bool(q_rad[1] > q_rad[0]), 0.001)
    line, go = run(plan, replace(plan.scene, limit_switches=(switch,)))
    with pytest.raises(StreamFault, match="the device stopped: joint 1: a limit switch closed during a motion; jog"):
        go()
    assert line.uno.pin(ENABLE).level == 0, "the drivers go on holding"


def test_a_board_with_narrower_soft_limits_refuses_the_plan_and_names_the_joint(plan):
    low, high = plan.scene.arm.joint_limits_rad[0]
    q_rad = ends_rad(plan)
    between = float(0.5 * q_rad.sum())
    limits = (low, between) if q_rad[1] > q_rad[0] else (between, high)
    arm = replace(plan.scene.arm, joint_limits_rad=(limits, plan.scene.arm.joint_limits_rad[1]))
    _line, go = run(plan, replace(plan.scene, arm=arm))
    with pytest.raises(StreamFault, match="joint 1: a segment would leave a joint's soft limits; check the start"):
        go()


def test_a_jog_exactly_to_the_limit_is_lawful(plan, positions):
    """The certificate takes it, and the board does not refuse it."""
    start = usteps_at(plan.scene, plan.scene.task.start_cm)
    at_rad = start[1] / plan.scene.joints[1].usteps_per_rad
    limits = (plan.scene.arm.joint_limits_rad[0], (at_rad - np.radians(7.3), np.pi))
    scene = replace(plan.scene, arm=replace(plan.scene.arm, joint_limits_rad=limits))
    line = line_to(scene, start)
    line.clock.wait_until(0.05)
    tell(line, PORT, scene, positions, start, "zeroed")
    standing = look_and_configure(line, PORT, scene, positions)
    jog(line, scene, standing, 1, np.radians(-7.3), lambda _told: None)
    assert look_and_configure(line, PORT, scene, positions).usteps[1] == round(
        limits[1][0] * scene.joints[1].usteps_per_rad
    )


def test_a_jog_onto_a_switch_is_warned_of_before_and_then_ends_with_its_fault(plan, positions):
    start = plan.segments.start_usteps
    scene = with_switches_near(plan.scene, start)
    line = line_to(scene, start)
    line.clock.wait_until(0.05)
    tell(line, PORT, scene, positions, start, "zeroed")
    standing, said = look_and_configure(line, PORT, scene, positions), []
    with pytest.raises(StreamFault, match="joint 2: a limit switch closed during a motion"):
        jog(line, scene, standing, 1, np.radians(-3.0), lambda _told: None, said.append)
    assert [text.split(" on the way")[0] for text in said] == ["joint 2 presses its limit switch"]


def upright(scene, tip_kg=0.1):
    return replace(scene, mechanics=replace(scene.mechanics, gravity=True, end_masses_kg=(0.0, tip_kg)))


def upright_run(scene, build):
    """Stream an upright arm's plan on a board around which `build` makes an arm; return the plan and what it did."""
    plan = plan_scene(scene, lambda _stage, _share: None)
    assert plan.certificate.ok, plan.certificate.explain()
    line, go = run(plan, build(plan.scene))
    go()
    line.arm.settle(0.5)
    return plan, line


@pytest.mark.parametrize("active_high", [False, True])
def test_an_upright_arm_runs_to_its_end_without_a_lost_step(plan, active_high):
    """Held by hand until its drivers carry it: the resistors on ENABLE keep them off while the board's pins float."""
    settings = BoardSpec(enable_active_high=active_high)
    plan, line = upright_run(replace(upright(plan.scene, 0.05), board_spec=settings), lambda scene: scene)
    found = judge_emulated_arm(plan, judge_pins(plan.segments, line.pins), line.arm)
    assert found.clean
    record = line.arm.record()
    goal_rad = Transmission.of(plan.scene).q_rad(np.array(plan.train.end_usteps))
    np.testing.assert_allclose(record.q_rad[-1], goal_rad, atol=np.radians(0.5))
    if not active_high:
        start_rad = Transmission.of(plan.scene).q_rad(np.array(plan.train.start_usteps))
        before = record.ticks < falls_s(line, ENABLE)[-1] / TICKS_S
        np.testing.assert_allclose(record.q_rad[before], np.tile(start_rad, (before.sum(), 1)), atol=1e-12)


def test_an_upright_arm_whose_motor_is_too_weak_for_it_loses_steps(plan):
    """The scene says 1.7 A, the driver is set to a ninth of that: less than gravity needs."""

    def weak(scene):
        motor = replace(scene.joints[0].motor, current_a=0.19)
        return replace(scene, joints=(replace(scene.joints[0], motor=motor), scene.joints[1]))

    plan, line = upright_run(upright(plan.scene, 0.05), weak)
    found = judge_emulated_arm(plan, judge_pins(plan.segments, line.pins), line.arm)
    assert not found.clean
    assert {one.motor for one in line.arm.record().lost} == {1}


def with_switches_near(scene, usteps):
    """A switch a degree from where the arm stands, for each joint."""
    at_rad = pose_of(scene, usteps)[0] + np.radians([1.0, -1.0])
    switches = tuple(LimitSwitchSpec(j + 1, f"A{j + 1}", float(at_rad[j]), j == 0, 0.001) for j in range(2))
    return replace(scene, limit_switches=switches)


def test_homing_again_does_not_let_go_of_an_upright_arm(plan, positions):
    start = plan.segments.start_usteps
    scene = with_switches_near(upright(plan.scene), start)
    line = line_to(scene, start)
    line.clock.wait_until(0.05)
    said = []
    home(line, PORT, scene, positions, said.append)
    assert "joint 1 falls when the drivers are released" in said[0]
    before = line.arm.record().q_rad[-1]
    released = len(rises_s(line, ENABLE))
    home(line, PORT, scene, positions)
    assert len(rises_s(line, ENABLE)) == released, "ENABLE never went high"
    line.arm.settle(0.2)
    np.testing.assert_allclose(line.arm.record().q_rad[-1], before, atol=np.radians(0.1))


def test_an_upright_arm_on_a_board_with_other_settings_is_not_released_but_told_of(plan, positions):
    scene = upright(plan.scene)
    line = line_to(scene, plan.segments.start_usteps)
    line.clock.wait_until(0.05)
    session = open_session(line)
    request(line, session, Enable(1))  # by another program: nobody noted what it told
    with pytest.raises(LinkError, match=r"may have other settings.*falls when the drivers.*reset button") as refused:
        look_and_configure(line, PORT, scene, positions)
    assert "Support the arm" in str(refused.value)
    assert line.uno.pin(ENABLE).level == 0


def test_an_arm_that_lies_flat_is_told_its_scenes_settings_anew(plan, positions):
    stopping = with_board(plan, stop_input=True)
    line = line_to(stopping, plan.segments.start_usteps)
    line.clock.wait_until(0.05)
    request(line, open_session(line), Enable(1))  # by another program
    assert look_and_configure(line, PORT, stopping, positions).session.status.state is State.IDLE
    line.uno.pin("A0").drive(1)
    line.arm.settle(0.1)
    assert request(line, open_session(line), Query()).fault is Fault.STOP_INPUT


def test_a_board_that_lost_its_place_in_an_emergency_is_not_believed(plan, positions):
    stopping, start = with_board(plan, stop_input=True), plan.segments.start_usteps
    line = line_to(stopping, start)
    line.clock.wait_until(0.05)
    tell(line, PORT, stopping, positions, start, "zeroed")
    assert look_and_configure(line, PORT, stopping, positions).how == "zeroed"
    line.uno.pin("A0").drive(1)
    line.arm.settle(0.1)
    assert look_and_configure(line, PORT, stopping, positions).how is None
    line.uno.pin("A0").drive(0)
    request(line, open_session(line), Clear())
    assert look_and_configure(line, PORT, stopping, positions).how is None, "also after the fault was cleared"


def held_upright(plan, positions, **settings):
    """A board that was told where its upright arm stands, and holds it."""
    start = plan.segments.start_usteps
    scene = replace(upright(with_switches_near(plan.scene, start), tip_kg=0.05), board_spec=BoardSpec(**settings))
    line = line_to(scene, start)
    line.clock.wait_until(0.05)
    tell(line, PORT, scene, positions, start, "zeroed")
    assert line.uno.pin(ENABLE).level == 0, "an arm that would fall is held from when its place is told"
    assert look_and_configure(line, PORT, scene, positions).how == "zeroed"
    return line, scene


def test_an_arm_that_fell_when_its_idle_drivers_were_released_is_not_believed(plan, positions):
    line, scene = held_upright(plan, positions, idle_release_s=5.0)
    line.arm.settle(6.0)
    assert line.uno.pin(ENABLE).level == 1
    standing = look_and_configure(line, PORT, scene, positions)
    assert standing.how is None
    with pytest.raises(LinkError, match="released its drivers, without which this arm would fall"):
        require_standing(standing, scene, plan.segments.start_usteps)


def test_an_arm_that_lies_flat_stays_where_its_idle_drivers_left_it(plan, positions):
    scene, start = with_board(plan, idle_release_s=5.0), plan.segments.start_usteps
    line = line_to(scene, start)
    line.clock.wait_until(0.05)
    tell(line, PORT, scene, positions, start, "zeroed")
    assert line.uno.pin(ENABLE).level == 1, "nobody asked for its drivers"
    request(line, look_and_configure(line, PORT, scene, positions).session, Enable(1))
    assert line.uno.pin(ENABLE).level == 0
    line.arm.settle(6.0)
    assert line.uno.pin(ENABLE).level == 1
    assert look_and_configure(line, PORT, scene, positions).how == "zeroed"


def commands_that_clear(plan, line, scene, positions):
    return (
        lambda: look_and_configure(line, PORT, scene, positions),
        lambda: home(line, PORT, scene, positions),
        lambda: tell(line, PORT, scene, positions, plan.segments.start_usteps, "zeroed"),
        lambda: jog(line, scene, look(line, PORT, scene, positions), 1, np.radians(-1.0), lambda _told: None),
    )


def test_no_command_clears_the_fault_in_which_drivers_hold_an_upright_arm(plan, positions):
    line, scene = held_upright(plan, positions)
    released = len(rises_s(line, ENABLE))
    line.write(bytes([EMERGENCY_CODE] * 3))
    line.arm.settle(0.1)
    for command in commands_that_clear(plan, line, scene, positions):
        with pytest.raises(
            LinkError, match=r"fault emergency_stop.*joint 1 falls.*Support the arm, press the board's reset"
        ):
            command()
        assert look(line, PORT, scene, positions).how is None
    line.arm.settle(0.1)
    assert line.uno.pin(ENABLE).level == 0
    assert len(rises_s(line, ENABLE)) == released, "ENABLE never went high"


def test_a_fault_whose_drivers_were_released_at_once_is_cleared(plan, positions):
    line, scene = held_upright(plan, positions, emergency_releases=True)
    line.write(bytes([EMERGENCY_CODE] * 3))
    line.arm.settle(0.1)
    assert line.uno.pin(ENABLE).level == 1
    tell(line, PORT, scene, positions, plan.segments.start_usteps, "zeroed")
    assert look(line, PORT, scene, positions).how == "zeroed"
    assert line.uno.pin(ENABLE).level == 0


@pytest.mark.parametrize("closed", [True, False])
def test_a_switch_that_contradicts_the_known_place_is_told_before_a_motion(plan, positions, tmp_path, closed):
    """A broken wire reads as pressed where the switches are normally closed; else it takes a short."""
    start = plan.segments.start_usteps
    far_rad = pose_of(plan.scene, start)[0] + np.radians([10.0, -10.0])
    switches = tuple(LimitSwitchSpec(j + 1, f"A{j + 1}", float(far_rad[j]), j == 0, 0.001, closed) for j in range(2))
    scene = replace(plan.scene, limit_switches=switches)
    for state in ("stuck_open", "stuck_closed"):
        faults = tmp_path / "wire.toml"
        told = f'[[faults]]\nkind = "mechanics.limit_switch"\nswitch = 2\nstate = "{state}"\n'
        faults.write_text(f'zero = "power_up"\n{told}')
        line = line_to(scene, start, faults)
        line.clock.wait_until(0.05)
        tell(line, PORT, scene, positions, start, "zeroed")
        standing, said = look_and_configure(line, PORT, scene, positions), []
        broken = (state == "stuck_open") == closed
        assert bool(standing.doubts) == broken
        if broken:
            refusal = r"joint 2: its limit switch on A2 reads pressed at -.* degrees.*broken wire.*normally_closed"
            with pytest.raises(LinkError, match=refusal):
                require_standing(standing, scene, start)
            with pytest.raises(LinkError, match=refusal):
                goto(line, scene, standing, scene.task.goal_cm, lambda _told: None)
        else:
            require_standing(standing, scene, start)
        jog(line, scene, standing, 1, np.radians(-1.0), lambda _told: None, said.append)
        assert said == ([standing.doubts] if broken else [])


def test_a_switch_that_should_be_pressed_and_is_not_is_told_and_one_nearby_may_be_either(plan):
    start = plan.segments.start_usteps
    at_rad = pose_of(plan.scene, start)[0]
    for beyond_deg, doubted in ((5.0, True), (1.0, False), (-1.0, False)):
        switch = LimitSwitchSpec(2, "A2", float(at_rad[1] + np.radians(beyond_deg)), False, 0.001)
        scene = replace(plan.scene, limit_switches=(switch,))
        assert not switch_doubts(scene, start, 0b10)
        assert ("reads released" in switch_doubts(scene, start, 0b00)) == doubted
