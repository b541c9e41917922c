"""The hard motions of `data/reference_motion*.toml`, their steps, and how much of them the device's queue holds."""

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from motion_paths import JointCurve, joint
from planarm.scene import JointSpec
from planarm.stepping.quantise import quantise
from planarm.stepping.train import StepTrain
from planarm.trajectory.timing import time_path
from planarm_wire.codec import encoded_bytes
from planarm_wire.messages import QUEUE_BYTES, QUEUE_FRAME_BYTES, Segment, Segments
from planarm_wire.rates import MESSAGE_SEGMENTS, SHARED_PAYLOAD_BYTES
from planarm_wire.steps import duration_ticks

DATA = Path(__file__).parent / "data"
REFERENCES = {2: DATA / "reference_motion.toml", 4: DATA / "reference_motion_four.toml"}
"""By the number of joints."""
BORDERS = (0.0, 2.0, 5.0)


def reference_train(joints: int = 2) -> tuple[StepTrain, tuple[JointSpec, ...]]:
    """The steps of the motion, and the joints that make them."""
    told = tomllib.loads(REFERENCES[joints].read_text(encoding="utf-8"))
    size, rate, phase = (np.array(told[name]) for name in ("size_rad", "rate", "phase_rad"))
    one = joint(told["max_speed_rad_s"], told["max_acceleration_rad_s2"], told["usteps_per_rev"])

    def along(function, power):
        def of_each(s):
            terms = size * rate**power * function(rate * s[..., None, None] + phase)
            return list(np.moveaxis(terms.sum(axis=-1), -1, 0))

        return of_each

    path = JointCurve(along(np.sin, 0), along(np.cos, 1), along(lambda x: -np.sin(x), 2), borders=BORDERS)
    axes = (one,) * joints
    return quantise(time_path(path, axes), axes), axes


def least_held_ticks(segments: Sequence[Segment], queue_bytes: int = QUEUE_BYTES) -> int:
    """The least path time in a queue that holds whole messages from any segment on, where more follow."""
    sizes = [encoded_bytes(segment) for segment in segments]
    head = encoded_bytes(Segments(0, 0, 0, (segments[0],))) - sizes[0]
    least = sum(map(duration_ticks, segments))
    for begin in range(len(segments)):
        used, at = 0, begin
        while at < len(segments):
            pair = sum(sizes[at : at + MESSAGE_SEGMENTS])
            count = MESSAGE_SEGMENTS if head + pair <= SHARED_PAYLOAD_BYTES else 1
            used += head + sum(sizes[at : at + count]) + QUEUE_FRAME_BYTES
            if used > queue_bytes:
                least = min(least, sum(map(duration_ticks, segments[begin:at])))
                break
            at += count
    return least
