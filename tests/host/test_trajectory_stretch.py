"""Changes of the path clock that the motors' torque allows, against torques computed at random rates of the clock."""

from dataclasses import replace

import numpy as np
import pytest

from host_scenes import make_scene
from motion_paths import joint, waves
from planarm.dynamics.motor_terms import Load
from planarm.stepping.check_motion import Planned
from planarm.stepping.check_stop import check_stop
from planarm.stepping.check_torque import joint_torques_nm, motor_torque_shares
from planarm.stepping.schedule import encode
from planarm.stepping.stopping import allowances
from planarm.stepping.table import table_of
from planarm.trajectory.limits import Limits
from planarm.trajectory.stretch import torque_changes
from planarm.trajectory.timing import fastest_motion


def heavy_scene(rng, gravity):
    """An arm whose motors, not its limits of acceleration, hold it back; in part above their corner speed."""
    one = joint(speed=6.0, acceleration=200.0, usteps_per_rev=48_000 if gravity else 16_000)
    scene = replace(make_scene(), joints=(one, one), coupling=((1.0, 0.0), (1.0, 1.0)))
    mechanics = replace(
        scene.mechanics,
        gravity=gravity,
        end_masses_kg=tuple(rng.uniform(0.05, 0.15, 2).tolist()),
        coulomb_friction_nm=(0.05, 0.03),
        viscous_friction_nm_s=(0.03, 0.02),
    )
    return replace(scene, mechanics=mechanics)


def shares_of_torque(scene, q, speeds, accelerations):
    joints_nm = joint_torques_nm(scene.arm.link_lengths_cm, scene.mechanics, q, speeds, accelerations)
    return motor_torque_shares(scene, joints_nm, speeds, accelerations)


@pytest.mark.parametrize("gravity", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_motors_keep_their_torque_at_every_rate_of_the_clock(seed, gravity):
    """20,000 moments, rates up to 1 and changes as large as allowed; some come within a tenth of all there is."""
    rng = np.random.default_rng(seed)
    scene = heavy_scene(rng, gravity)
    load = Load.of(scene, 0.5)
    motion = fastest_motion(waves(rng), Limits.of_joints(scene.joints, 0.8, load))
    q, speeds, accelerations = motion.sample(rng.uniform(0.0, motion.duration_s, 20_000))
    changes = torque_changes(load, q, speeds, accelerations)
    u = rng.uniform(0.0, 1.0, len(q))[:, None]
    u[:2000] = 1.0
    nearest = 0.0
    for row, sign in enumerate((-1.0, 1.0)):
        moving = np.isfinite(changes[row]) & (changes[row] > 0.0)
        change = sign * np.where(moving, changes[row], 0.0)[:, None]
        shares = shares_of_torque(scene, q, u * speeds, u**2 * accelerations + change * speeds)[moving]
        assert shares.max() <= 0.5 * (1.0 + 1e-9)
        nearest = max(nearest, float(shares.max()))
    assert nearest > 0.45
    assert (changes > 0.0).mean() > 0.95  # a motion that uses four fifths of the torque can nearly always be slowed


def test_a_segments_allowance_asks_no_more_torque_than_there_is():
    """By the acceleration alone the clock could change twice as fast; such a plan turns the certificate red."""
    rng = np.random.default_rng(3)
    scene = heavy_scene(rng, gravity=False)
    load = Load.of(scene, scene.motion.torque_share)
    motion = fastest_motion(waves(rng), Limits.of_joints(scene.joints, 0.8, load))
    _, plan = encode(scene, motion)
    planned, table = Planned.of(motion), table_of(plan)
    strong = replace(scene.joints[0], motor=replace(scene.joints[0].motor, holding_torque_nm=50.0))
    strong = replace(scene, joints=(strong, strong))
    untold = allowances(motion, strong, [segment.duration_flags >> 1 for segment in plan.segments])
    slow, without = (np.array([one.slow_per_s for one in told]) for told in (plan.allowances, untold))
    assert np.all(slow <= without + 1e-9)
    assert (slow < 0.5 * without).mean() > 0.3

    def red(told):
        checks = check_stop(replace(plan, allowances=told), table, planned, scene)
        return [check.name for check in checks if check.verdict == "red"]

    assert red(plan.allowances) == []
    assert any("slowing" in name for name in red(untold))
    assert any("speeding up" in name for name in red(untold))
