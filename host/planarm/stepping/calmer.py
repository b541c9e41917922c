"""What would calm a motion under which rotors swing too far: lower accelerations of all joints, tried out."""

from collections.abc import Callable
from dataclasses import replace
from math import degrees

from planarm.errors import TimingError
from planarm.scene import Scene
from planarm.stepping.certificate import Certificate
from planarm.stepping.check_motion import Planned
from planarm.stepping.check_swing import NAME, NAME_HELD, NAME_STOPPED, check_swing
from planarm.stepping.expand import expand
from planarm.stepping.schedule import encode
from planarm.trajectory.motion import Trajectory

KEY = "joints.max_acceleration_deg_s2"
SHARES = (0.75, 0.5, 0.35, 0.25, 0.15, 0.1)
"""Of every joint's acceleration, tried from above."""


def with_advice(scene: Scene, certificate: Certificate, timing: Callable[[Scene], Trajectory]) -> Certificate:
    """Return a certificate whose red lags name accelerations that pass; as it is where others are red, or none passes.

    Args:
        scene: what was asked for.
        certificate: of its plan.
        timing: times the plan's path for a scene with other joints; it may raise TimingError.
    """
    red = [check for check in certificate.checks if check.verdict == "red"]
    if not red or not all(check.name.endswith((NAME, NAME_HELD, NAME_STOPPED)) for check in red):
        return certificate
    share = _passing_share(scene, timing)
    if share is None:
        return certificate
    passing = ", ".join(f"{degrees(share * joint.max_acceleration_rad_s2):.6g}" for joint in scene.joints)
    return Certificate(
        tuple(
            replace(check, setting=check.setting.replace(KEY, f"{KEY} (to {passing}, tried)", 1))
            if check.verdict == "red"
            else check
            for check in certificate.checks
        )
    )


def _passing_share(scene: Scene, timing: Callable[[Scene], Trajectory]) -> float | None:
    """Return the largest share of all accelerations at which no rotor swings too far; None where none was found."""
    for share in SHARES:
        joints = tuple(
            replace(joint, max_acceleration_rad_s2=share * joint.max_acceleration_rad_s2) for joint in scene.joints
        )
        calmer = replace(scene, joints=joints)
        try:
            trajectory = timing(calmer)
            _, plan = encode(calmer, trajectory)
        except TimingError:
            continue
        checks = check_swing(Planned.of(trajectory), plan, expand(plan), calmer)
        if all(check.verdict != "red" for check in checks):
            return share
    return None
