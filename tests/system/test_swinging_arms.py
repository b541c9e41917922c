"""No arm that the certificate lets pass loses a step in the emulator: random arms and motions, some of them shaken.

The emulated arm is fed with the expanded steps on their ticks, and with the same held once at a random moment, by the
path clock's rule. The default run takes a slice, `--full` some hundred motions. What is told beside: how often the
certificate refuses what would have lost nothing.
"""

from dataclasses import replace

import numpy as np

from joint_motions import laden, through
from planarm.errors import TimingError
from planarm.link.sim_bench import rig_of
from planarm.scene.motor import MotorSpec
from planarm.stepping.check_motion import Planned
from planarm.stepping.check_swing import NAME, NAME_HELD, check_swing
from planarm.stepping.expand import expand
from planarm.stepping.stopping import _over_start_stop
from planarm.stepping.train import JointSteps, StepTrain
from planarm_sim.plant import Plant
from planarm_wire.messages import TICKS_HZ

LEAD_TICKS = 160_000
SETTLE_S = 0.3
PHASES_PER_STEP = 256
CLOCK_STEP_S = 1e-4

MOTORS = (
    MotorSpec(current_a=1.7),
    MotorSpec(0.8, 2.0, 2.0, 1.4, 3e-3, 24.0, 1.2e-5, 0.03),  # a long NEMA 17
    MotorSpec(1.9, 2.8, 2.8, 1.13, 3.6e-3, 36.0, 4.8e-5, 0.07),  # NEMA 23
    MotorSpec(0.16, 0.6, 0.6, 10.0, 9e-3, 24.0, 2.0e-6, 0.008, damping_nm_s=1e-4),  # a small one, damped otherwise
)


def emulated(scene, train):
    """The emulated arm after a motion, and each rotor's largest lag in full steps (every 0.1 ms)."""
    plant = Plant(rig_of(scene, train.start_usteps), sample_cycles=1600)
    events = []
    for m, (steps, start, joint) in enumerate(zip(train.steps, train.start_usteps, scene.joints, strict=True)):
        at = start + np.concatenate([[0], np.cumsum(steps.directions, dtype=np.int64)])
        rows = np.ones((len(at), 4), np.int64)
        rows[:, 0] = np.concatenate([[0], steps.ticks + LEAD_TICKS])
        rows[:, 1], rows[:, 2] = m, at * (PHASES_PER_STEP // joint.microsteps)
        events.append(rows)
    plant.take(np.concatenate(events))
    plant.run_to(train.duration_ticks + LEAD_TICKS + int(SETTLE_S * TICKS_HZ))
    motion, lags = plant.motion(), []
    for m, (rows, joint) in enumerate(zip(events, scene.joints, strict=True)):
        asked = rows[np.searchsorted(rows[:, 0], motion["cycle"], side="right") - 1, 2] / PHASES_PER_STEP
        lags.append(np.abs(asked - motion["rotor_rad"][:, m] * joint.steps_per_rev / (2.0 * np.pi)).max())
    return plant, np.array(lags)


def held(scene, trajectory, segments, train, begin_s, pause_s):
    """The train with its path clock held once: slowed down by half of the allowance, frozen, sped up by half of it."""
    starts = np.cumsum([0, *(one.duration_flags >> 1 for one in segments.segments)]) / TICKS_HZ
    times_s = np.arange(0.0, trajectory.duration_s, 0.001)
    segment = np.clip(np.searchsorted(starts, times_s, side="right") - 1, 0, len(segments.allowances) - 1)
    slow = np.array([one.slow_per_s for one in segments.allowances])[segment]
    fast = np.array([one.fast_per_s for one in segments.allowances])[segment]
    over = _over_start_stop(scene, trajectory.sample(times_s)[1])
    tau, rate, rests_s, phase, path = 0.0, 1.0, pause_s, "runs", [0.0]
    while tau < trajectory.duration_s and len(path) < 400_000:
        k = min(int(1000.0 * tau), len(times_s) - 1)
        if phase == "runs" and tau >= begin_s:
            phase = "slows"
        if phase == "slows":
            rate = max(0.001, rate - 0.5 * slow[k] * CLOCK_STEP_S)
            phase = "rests" if rate * over[k] <= 1.0 else phase
        elif phase == "rests":
            rests_s -= CLOCK_STEP_S
            phase = "rests" if rests_s > 0.0 else "over"
        elif phase == "over":
            rate = min(1.0, rate + 0.5 * fast[k] * CLOCK_STEP_S)
        tau += 0.0 if phase == "rests" else rate * CLOCK_STEP_S
        path.append(tau)
    real_s = CLOCK_STEP_S * np.arange(len(path))
    rising = np.concatenate([[True], np.diff(path) > 0.0])

    def moved(ticks):
        return np.rint(np.interp(ticks / TICKS_HZ, np.array(path)[rising], real_s[rising]) * TICKS_HZ).astype(np.int64)

    steps = tuple(JointSteps(moved(one.ticks), one.directions) for one in train.steps)
    return StepTrain(train.start_usteps, steps, int(real_s[-1] * TICKS_HZ), train.wiring)


def random_motion(rng):
    """An arm with one to four links and loads, and a motion: through random poses, or to and fro in short moves."""
    joints = int(rng.integers(1, 5))
    scene = laden(joints, tuple(rng.uniform(0.0, 0.3, joints)), microsteps=int(rng.choice([1, 2, 4, 8, 16])))
    motor = MOTORS[int(rng.integers(len(MOTORS)))]
    scene = replace(scene, joints=tuple(replace(one, motor=motor) for one in scene.joints))
    scene = replace(scene, motion=replace(scene.motion, acceleration_share=float(rng.choice([0.4, 0.8]))))
    if rng.random() < 0.6:
        way, amount = rng.uniform(-0.3, 0.3, joints), np.radians(rng.uniform(1.0, 16.0))
        way[rng.integers(joints)] = 1.0
        moves = np.outer([0.3 * (k // 2) + k % 2 for k in range(int(rng.integers(3, 9)))], amount * way)
        poses = rng.uniform(-1.5, 1.5, joints) + moves
    else:
        poses = rng.uniform(-1.7, 1.7, (3, joints))
    return scene, poses


def test_what_the_certificate_lets_pass_loses_no_step(sized):
    rng = np.random.default_rng(118)
    told = {"green": 0, "refused": 0, "refused for nothing": 0, "lost": 0, "holds": 0}
    ratios = []
    while told["green"] < sized(12, 300) or told["lost"] < sized(1, 40):
        scene, poses = random_motion(rng)
        try:
            trajectory, _, segments = through(scene, poses, 0.2)
        except TimingError:
            continue
        made = expand(segments)
        if not 0.2 < trajectory.duration_s < 6.0:
            continue
        checks = check_swing(Planned.of(trajectory), segments, made, scene)
        red = {name: any(c.verdict == "red" for c in checks if c.name.endswith(name)) for name in (NAME, NAME_HELD)}
        plant, lags = emulated(scene, made)
        loses = bool(plant.slips())
        told["lost"] += loses
        if red[NAME]:
            told["refused"] += 1
            told["refused for nothing"] += not loses
            continue
        found = np.array([check.value for check in checks[: len(scene.joints)]])
        assert not loses, (poses, found, lags)
        told["green"] += 1
        ratios.append(found.max() / lags.max())
        if not red[NAME_HELD]:
            for _ in range(2):
                begin_s, pause_s = rng.uniform(0.0, trajectory.duration_s), rng.uniform(0.0, 0.3)
                stretched = held(scene, trajectory, segments, made, begin_s, pause_s)
                told["holds"] += 1
                assert not emulated(scene, stretched)[0].slips(), (poses, begin_s, pause_s)
    print(told, f"lags of the certificate by those of the emulated arm: {min(ratios):.2f} to {max(ratios):.2f}")
    assert min(ratios) > 0.7
    assert max(ratios) < 1.6
