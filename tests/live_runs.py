"""Live runs on the emulated Uno with obstacles that appear, and what the board's pins and the arm showed."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from planarm.analysis.step_count import Waveform, compare_steps, measure_steps
from planarm.link.arm_record import ArmSetup
from planarm.link.transport import open_transport
from planarm.model.arm import Arm
from planarm.model.collision import pose_clearance_cm
from planarm.model.kinematics import forward
from planarm.model.shapes import obstacle_set, shape_of
from planarm.operations.arrivals import Listed
from planarm.operations.replanning import first_plan, run_live
from planarm.scene import MechanicsSpec, Obstacle, load_scene
from planarm.stepping.segments import expand
from planarm_wire.messages import TICKS_HZ

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
LENGTHS = (18.0, 26.0)
START, GOAL = (-0.3, 0.9), (2.2, 0.5)
SETTLE_S = 0.3


def scene_of():
    """The example's motors on a short inner link, so that the arm can fold past what stands in its way; fast joints.

    Motors follow their steps within about a millimetre, and swing after a stop: 3 mm of clearance are kept for that.
    """
    scene = load_scene(EXAMPLES / "energy_two_links.toml")
    arm = replace(scene.arm, link_lengths_cm=LENGTHS)
    tips = [tuple(map(float, forward(Arm.from_spec(arm), q)[-1])) for q in (START, GOAL)]
    return replace(
        scene,
        arm=arm,
        joints=tuple(replace(j, max_speed_rad_s=2.5, max_acceleration_rad_s2=12.0) for j in scene.joints),
        mechanics=MechanicsSpec.usual(LENGTHS),
        obstacles=(),
        workspace=replace(scene.workspace, clearance_cm=0.3),
        task=replace(scene.task, start_rad=START, goal_rad=GOAL, start_cm=tips[0], goal_cm=tips[1]),
        roadmap=replace(scene.roadmap, nodes=1500, cost="time"),
    )


LINKS = {3: ((2.6, -0.35, 0.85), 0.8), 4: ((1.2, 0.3, -0.2, 0.1), 0.5)}
"""Goal and joint speed of the scenes with three and four links: the queue of uno_four holds their stops."""


def scene_with_links(links):
    """An example with three or four links without its obstacles, and lighter, so that it hardly swings; on uno_four."""
    scene = load_scene(EXAMPLES / f"{'three' if links == 3 else 'four'}_links.toml")
    goal, speed_rad_s = LINKS[links]
    tip = tuple(map(float, forward(Arm.from_spec(scene.arm), np.array(goal))[-1]))
    return replace(
        scene,
        joints=tuple(replace(joint, max_speed_rad_s=speed_rad_s) for joint in scene.joints),
        mechanics=replace(scene.mechanics, end_masses_kg=(0.03,) * links),
        obstacles=(),
        workspace=replace(scene.workspace, clearance_cm=0.3),
        task=replace(scene.task, goal_rad=goal, goal_cm=tip),
        roadmap=replace(scene.roadmap, nodes=2000, cost="time"),
    )


SCENE = scene_of()


def with_jerk(scene, jerk_rad_s3):
    """The scene with a limit of jerk in every joint."""
    return replace(scene, joints=tuple(replace(joint, max_jerk_rad_s3=jerk_rad_s3) for joint in scene.joints))


def by_time(scene, budget_s):
    """The scene with its path optimised for time."""
    return replace(scene, planner=replace(scene.planner, objective="time", budget_s=budget_s))


class CountedTime:
    """In place of `time` where a path is optimised for it: so much that a budget is the same work each time.

    Seconds go by as they are asked for: on an idle computer a generation takes about this long.
    """

    READING_S = 2e-4

    def __init__(self):
        self._now_s = 0.0

    def perf_counter(self):
        self._now_s += self.READING_S
        return self._now_s


def quiet(_stage, _share):
    pass


class Outcome:
    """One run on the emulated Uno, and what its arm really did."""

    def __init__(self, arrivals, scene=SCENE, beside=None):
        self.scene, self.arm = scene, Arm.from_spec(scene.arm)
        first = first_plan(scene, quiet)
        setup = ArmSetup(scene, first[1].segments.start_usteps)
        with closing(open_transport("sim://", 250_000, setup)) as line:
            self.result = run_live(scene, line, Listed(arrivals), quiet, perf_counter, first, beside)
            line.arm.settle(SETTLE_S)
            self.record = line.arm.record()
            pins = list(zip(scene.board.step_pins, scene.board.dir_pins, strict=True))[: len(scene.joints)]
            self.measured = [measure_steps(waveform(line.pins, a), waveform(line.pins, b)) for a, b in pins]

    @property
    def spliced(self):
        return [new for new in self.result.new_plans if new.spliced_at_s is not None]

    def comparison(self):
        """The pins against the last plan: with no stop in between it is all that was executed."""
        made = expand(self.result.plans[-1].segments)
        return compare_steps([(joint.ticks, joint.directions) for joint in made.steps], self.measured)

    def longest_pause_s(self):
        """Between two steps of any joint at the pins."""
        every = np.sort(np.concatenate([joint.ticks for joint in self.measured]))
        return np.diff(every).max() / TICKS_HZ

    def require_clear(self):
        """No contact with anything but what was unavoidable."""
        for one in self.result.encounters:
            if one.verdict != "unavoidable":
                assert self.least_clearance_cm(one) > 0.5 * self.scene.arm.link_width_cm

    def least_clearance_cm(self, encounter):
        """Of the links' centre lines from the obstacle, from its appearing on, by the emulated arm's own angles."""
        appeared = (self.result.began_s + encounter.at_s) * TICKS_HZ
        poses = self.record.q_rad[self.record.ticks >= appeared]
        obstacles = obstacle_set([shape_of(encounter.obstacle)])
        return min(pose_clearance_cm(self.arm, q, obstacles) for q in poses[::4])

    def inside_at_once(self, encounter):
        """Whether the obstacle appeared where the arm was."""
        appeared = (self.result.began_s + encounter.at_s) * TICKS_HZ
        pose = self.record.q_rad[np.searchsorted(self.record.ticks, appeared)]
        apart_cm = pose_clearance_cm(self.arm, pose, obstacle_set([shape_of(encounter.obstacle)]))
        return apart_cm <= 0.5 * self.scene.arm.link_width_cm


def tip_at(plan, share):
    q_rad, *_ = plan.trajectory.sample(np.array([share * plan.trajectory.duration_s]))
    return forward(Arm.from_spec(plan.scene.arm), q_rad)[0, -1]


def circle(x, y, diameter):
    return Obstacle("circle", (float(x), float(y)), float(diameter))


def waveform(pins, pin):
    edges = pins.edges(pin)
    return Waveform(edges["cycle"], edges["level"])
