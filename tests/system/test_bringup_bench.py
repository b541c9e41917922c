"""Setup and calibration on the emulated bench: an arm that is not what its owner says is found out."""

from contextlib import closing
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from planarm.bringup.arm_answers import ArmAnswers, JointAnswers
from planarm.bringup.calibrate import MORE_POINTS, TouchedPoint, calibrate
from planarm.bringup.guided import touch_points
from planarm.bringup.nudge import Mover
from planarm.bringup.setup import try_joints
from planarm.link.arm_record import ArmSetup
from planarm.link.transport import open_transport
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.transmission import Transmission
from planarm.streaming.plan_stream import stream

SAID = ArmAnswers("said", (20.0, 15.0))
START = (radians(60.0), radians(-70.0))


class Beside:
    """A person beside the emulated arm: sees joints turn, reads marks to a tenth of a degree, and points to 0.1 mm."""

    def __init__(self, transport, lengths_cm):
        self.transport, self.lengths_cm = transport, lengths_cm
        self.marked = self.angles()
        self.told = []

    def angles(self):
        self.transport.arm.settle(0.3)
        return np.degrees(self.transport.arm.record().q_rad[-1])

    def tell(self, text):
        self.told.append(text)
        if "now turns" in text:
            self.marked = self.angles()

    def ask(self, question, default):
        if "Which way" in question:
            turned = (self.angles() - self.marked)[int(question.split("joint ")[1][0]) - 1]
            return "not at all" if abs(turned) < 0.1 else "counter-clockwise" if turned > 0 else "clockwise"
        if "Make a mark" in question:
            self.marked, self.joint = self.angles(), int(question.split("joint ")[1][0]) - 1
        if "By how many degrees" in question:
            return f"{abs((self.angles() - self.marked)[self.joint]):.1f}"
        if "Where is the tip" in question:
            arm = Arm(self.lengths_cm, (0.0, 0.0), ((-9.0, 9.0),) * len(self.lengths_cm))
            tip = forward(arm, np.radians(self.angles()))[-1]
            return f"{tip[0]:.2f}, {tip[1]:.2f}"
        return default


def bench(plant, at_rad=START):
    """A line to a board with the plant around it, its arm at START or elsewhere."""
    start = tuple(int(n) for n in np.round(Transmission.of(plant).usteps(np.array(at_rad))))
    return closing(open_transport("sim://", 250_000, ArmSetup(plant, start)))


def mover_on(line, at_rad=START):
    return Mover(lambda plan, certificate: stream(plan, certificate, line, None), at_rad)


def test_a_reversed_joint_and_another_gear_are_found_out():
    true = SAID.with_joint(0, JointAnswers(gear_ratio=4.0)).with_joint(1, JointAnswers(reversed=True))
    with bench(true.scene()) as line:
        mover = mover_on(line)
        found = try_joints(Beside(line, SAID.link_lengths_cm), SAID, mover)
        stands = np.degrees(line.arm.record().q_rad[-1])
    assert (found.joints[0].reversed, found.joints[1].reversed) == (False, True)
    assert abs(found.joints[0].gear_ratio - 4.0) < 0.02, "read to a tenth of a degree over 75"
    assert abs(found.joints[1].gear_ratio - 5.0) < 0.02
    assert "measured" in found.joints[0].measured
    np.testing.assert_allclose(np.degrees(mover.q_rad), stands, atol=0.5)


def test_an_arm_of_other_lengths_and_zeros_is_calibrated_within_what_touching_allows():
    true = replace(SAID, link_lengths_cm=(20.37, 14.68))
    plant = true.scene()
    with bench(plant) as line:
        person = Beside(line, true.link_lengths_cm)
        # The owner believes that the arm stood two and three degrees elsewhere when its motors began to count.
        believed = (START[0] - radians(2.0), START[1] + radians(3.0))
        points = touch_points(person, SAID.scene(), mover_on(line, believed), 6)
    assert all(isinstance(point, TouchedPoint) for point in points) and len(points) == 6
    found = calibrate(SAID.scene(), points)
    np.testing.assert_allclose(found.link_lengths_cm, true.link_lengths_cm, atol=0.03)
    np.testing.assert_allclose(np.degrees(found.zero_offsets_rad), [2.0, -3.0], atol=0.15)
    assert max(found.before_mm) > 8.0 and found.rms_mm < 0.3


ARMS = {1: (20.0,), 3: (18.0, 14.0, 9.0), 4: (18.0, 14.0, 11.0, 8.0)}
AT = (radians(60.0), radians(-70.0), radians(-30.0), radians(40.0))


@pytest.mark.parametrize(("links", "wiring"), [(1, "own"), (3, "cnc_shield")])
def test_the_last_joint_of_an_arm_of_one_or_three_links_is_found_out(links, wiring):
    said, at_rad = ArmAnswers("said", ARMS[links], wiring=wiring), AT[:links]
    true = said.with_joint(links - 1, JointAnswers(gear_ratio=4.0, reversed=True))
    with bench(true.scene(), at_rad) as line:
        found = try_joints(Beside(line, said.link_lengths_cm), said, mover_on(line, at_rad))
    assert [joint.reversed for joint in found.joints] == [False] * (links - 1) + [True]
    np.testing.assert_allclose([j.gear_ratio for j in found.joints], [j.gear_ratio for j in true.joints], atol=0.02)


@pytest.mark.parametrize(("links", "wiring"), [(1, "cnc_shield"), (4, "own")])
def test_an_arm_of_one_or_four_links_is_calibrated(links, wiring):
    said, at_rad = ArmAnswers("said", ARMS[links], wiring=wiring), AT[:links]
    true = replace(said, link_lengths_cm=tuple(1.02 * length for length in ARMS[links]))
    off_rad = np.radians((2.0, -3.0, 1.0, 2.0)[:links])
    with bench(true.scene(), at_rad) as line:
        person, mover = Beside(line, true.link_lengths_cm), mover_on(line, tuple(np.array(at_rad) - off_rad))
        found = calibrate(said.scene(), touch_points(person, said.scene(), mover, links + MORE_POINTS))
    np.testing.assert_allclose(found.link_lengths_cm, true.link_lengths_cm, atol=0.05)
    np.testing.assert_allclose(found.zero_offsets_rad, off_rad, atol=radians(0.3))
    assert max(found.before_mm) > 5.0 and found.rms_mm < 0.4
