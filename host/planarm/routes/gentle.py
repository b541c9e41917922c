"""A motion that keeps the joints' limits of jerk, proved free: averaged over a window, gently enough to cut little."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planarm.errors import TimingError
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.scene import Scene
from planarm.smoothing.joint_spline import JointSpline
from planarm.smoothing.smooth_path import Floats
from planarm.trajectory.check import limit_use
from planarm.trajectory.jerk import STEP_S, Mean, largest_jerks, mean_of
from planarm.trajectory.limits import Limits
from planarm.trajectory.motion import Trajectory
from planarm.trajectory.timing import fastest_motion
from planarm.workspace.joint_proof import joint_world, prove_pieces
from planarm.workspace.proof import PROVED

ROOM_CM = 0.02
"""Plans with a limit of jerk keep so much more from obstacles, for what the averaged motion cuts."""

GENTLER = 0.75
MOST_ROUNDS = 24
"""With each round the accelerations fall by GENTLER, and what is cut by its cube."""

ROUNDING = 1e-6


def jerk_limits(scene: Scene) -> Floats | None:
    """Return the largest jerk of each joint in rad/s^3, inf where it has none; None when no joint has a limit."""
    limits = [joint.max_jerk_rad_s3 for joint in scene.joints]
    if all(limit is None for limit in limits):
        return None
    return np.array([np.inf if limit is None else limit for limit in limits])


@dataclass(frozen=True, slots=True, eq=False)
class Gentle:
    """A motion that keeps limits of jerk, and of what it is the mean."""

    trajectory: Trajectory
    mean: Mean


def gentle_motion(scene: Scene, margin_cm: float, fastest: Trajectory, limits: Limits, jerks_rad_s3: Floats) -> Gentle:
    """Return a motion near to a timed one, within the limits and the jerks, proved free on a tenth of its own grid.

    Args:
        scene: the scene.
        margin_cm: least distance of a link's centre line to an obstacle.
        fastest: the fastest motion along the path, longer than a moment.
        limits: what it was timed under.
        jerks_rad_s3: the largest jerk of each joint, inf for none.

    Raises:
        TimingError: however gently it is driven, it is not free or does not keep a limit; the message says which, where
            and what to change.
    """

    def driven(share: float) -> Mean:
        slower = replace(limits, accelerations_rad_s2=share * limits.accelerations_rad_s2)
        return mean_of(fastest if share == 1.0 else fastest_motion(fastest.path, slower), jerks_rad_s3)

    return _gentlest(scene, margin_cm, limits, jerks_rad_s3, driven, 0)


def gentle_rest(
    scene: Scene,
    margin_cm: float,
    before: Mean,
    step: int,
    paths: tuple[JointSpline, JointSpline],
    limits: Limits,
    jerks_rad_s3: Floats,
) -> Gentle:
    """Return a motion that leaves the mean of another at a step, for another path, at its speed and acceleration.

    Args:
        scene: the scene.
        margin_cm: least distance of a link's centre line to an obstacle, from that step on.
        before: what is left.
        step: of its mean; earlier ones stay as they are.
        paths: the whole path, and the part of it after the step.
        limits: what the joints can.
        jerks_rad_s3: as `gentle_motion`.

    Raises:
        TimingError: as `gentle_motion`; or the motion cannot be slowed down in time for what follows.
    """
    whole, rest = paths
    rate = before.motion.path_at(step * STEP_S)[1]

    def driven(share: float) -> Mean:
        slower = replace(limits, accelerations_rad_s2=share * limits.accelerations_rad_s2)
        motion = fastest_motion(rest, slower, start_rate=rate)
        return before.left_for(before.motion.left_for(whole, step * STEP_S, motion), step)

    return _gentlest(scene, margin_cm, limits, jerks_rad_s3, driven, step)


def _gentlest(
    scene: Scene,
    margin_cm: float,
    limits: Limits,
    jerks_rad_s3: Floats,
    driven: Callable[[float], Mean],
    first: int,
) -> Gentle:
    """Return the mean driven with the largest share of the acceleration that keeps everything, from a step on."""
    arm, world = Arm.from_spec(scene.arm), joint_world(scene, margin_cm)
    share, problem = 1.0, ""
    for _ in range(MOST_ROUNDS):
        mean = driven(share)
        if not mean.keeps(jerks_rad_s3):  # a window that was given, of a motion that is left
            problem, share = "has too much jerk where it leaves the one before", GENTLER * share
            continue
        made = mean.trajectory(arm)
        path = made.path
        assert isinstance(path, JointSpline)
        verdict, s = prove_pieces(world, path.borders_s[first:], path.coefficients[first:])
        if verdict != PROVED:
            problem = f"is not free at {path.place(float(s))}"
        else:
            problem = _beyond(mean.motion, made, arm, scene, limits, jerks_rad_s3)
        if not problem:
            return Gentle(made, mean)
        share *= GENTLER
    raise TimingError(
        f"{scene.source}: with the limits of jerk the motion {problem}, even at {100.0 * share:.2g} % of the "
        "acceleration; raise joints.max_jerk_deg_s3 or motion.tolerance_cm, or leave it more workspace.clearance_cm"
    )


def _beyond(motion: Trajectory, made: Trajectory, arm: Arm, scene: Scene, limits: Limits, jerks_rad_s3: Floats) -> str:
    """Say which limit the averaged motion exceeds, and where; empty when it keeps all of them."""
    jerks, when_s = largest_jerks(made)
    for j in np.flatnonzero(jerks > jerks_rad_s3):
        return f"has {jerks[j]:.5g} rad/s^3 in joint {j + 1} at {when_s[j]:.4f} s, more than {jerks_rad_s3[j]:.5g}"
    use = limit_use(made, limits)
    for name, values in (("speed", use.speed), ("acceleration", use.acceleration), ("torque", use.torque)):
        place, joint = np.unravel_index(int(np.argmax(values)), values.shape)
        if values[place, joint] > 1.0 + ROUNDING:
            return f"has {values[place, joint]:.5g} of joint {joint + 1}'s {name} at {made.t_s[place]:.4f} s"
    lag_s = 0.5 * (made.duration_s - motion.duration_s)
    t_s = np.linspace(0.0, made.duration_s, len(made.t_s))
    tips = [forward(arm, one.sample(at)[0])[:, -1] for one, at in ((made, t_s), (motion, t_s - lag_s))]
    off_cm = np.hypot(*(tips[0] - tips[1]).T)
    if off_cm.max() > scene.motion.tolerance_cm:
        return f"leaves the path by {off_cm.max():.3f} cm at {t_s[off_cm.argmax()]:.4f} s"
    return ""
