"""The example with limit switches does what its text says: home, jog, goto, on the emulated arm."""

from pathlib import Path

import numpy as np
import pytest

from planarm.errors import NoPathError
from planarm.link.arm_record import ArmSetup
from planarm.link.positions import Positions
from planarm.link.transport import open_transport
from planarm.operations.arm_moves import goto, jog
from planarm.operations.homing import home
from planarm.scene import load_scene
from planarm.streaming.standing import look, look_and_configure, nearest, pose_of, start_usteps, tell

SCENE = Path(__file__).resolve().parents[2] / "examples" / "stop_and_switches.toml"
PORT = "/dev/ttyUNO"


@pytest.fixture
def positions(tmp_path):
    return Positions(tmp_path / "state" / "positions.json")


def degrees_of(scene, usteps):
    return np.degrees(pose_of(scene, usteps)[0])


def test_home_then_jog_then_goto_on_the_example(positions, sized):
    """With --full from the task's start, 44 s of the board's time; else from near the switches."""
    scene = load_scene(SCENE)
    start = sized(nearest(scene, np.radians([168.0, -143.0])), start_usteps(scene))
    line = open_transport("sim://", 250_000, ArmSetup(scene, start, None))
    line.clock.wait_until(0.05)
    homed = home(line, PORT, scene, positions)
    np.testing.assert_allclose(degrees_of(scene, homed.usteps), [177.0, -152.0], atol=0.1)
    standing = look_and_configure(line, PORT, scene, positions)
    assert (standing.how, standing.usteps) == ("homed", homed.inside_usteps)
    np.testing.assert_allclose(degrees_of(scene, standing.usteps), [174.0, -149.0], atol=0.1)
    for joint, degrees in ((0, -10.0), (1, 10.0)):
        jog(line, scene, look_and_configure(line, PORT, scene, positions), joint, np.radians(degrees), ignore)
    goto(line, scene, look_and_configure(line, PORT, scene, positions), scene.task.goal_cm, ignore)
    line.arm.settle(0.2)
    standing = look(line, PORT, scene, positions)
    np.testing.assert_allclose(pose_of(scene, standing.usteps)[0], line.arm.record().q_rad[-1], atol=np.radians(0.1))
    assert line.arm.record().lost_full_steps == (0, 0)


@pytest.mark.parametrize(("joint", "inside_deg"), [(0, -20.0), (1, 20.0)])
def test_a_joint_outside_its_limits_is_jogged_inwards_and_not_farther_out(positions, joint, inside_deg):
    """The first segments end outside, too: the board's soft limits are taken around where the arm stands."""
    scene = load_scene(SCENE)
    start = nearest(scene, np.radians([178.0, -153.0]))
    line = open_transport("sim://", 250_000, ArmSetup(scene, start, None))
    line.clock.wait_until(0.05)
    tell(line, PORT, scene, positions, start, "zeroed")
    with pytest.raises(NoPathError):
        jog(line, scene, look_and_configure(line, PORT, scene, positions), joint, -np.radians(inside_deg), ignore)
    jog(line, scene, look_and_configure(line, PORT, scene, positions), joint, np.radians(inside_deg), ignore)
    turned = degrees_of(scene, look(line, PORT, scene, positions).usteps) - degrees_of(scene, start)
    assert turned[joint] == pytest.approx(inside_deg, abs=0.05)


def ignore(_told):
    pass
