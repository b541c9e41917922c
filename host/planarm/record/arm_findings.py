"""What the emulated arm really did, held against the plan: tip error over time, lost steps, broken rules, touches."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm.link.arm_record import ArmRecord, Touch
from planarm.model.arm import Arm
from planarm.model.kinematics import forward
from planarm.model.moving import first_touches, moving_set
from planarm.plan import Plan
from planarm.scene import Scene
from planarm_wire.messages import TICKS_HZ

SETTLE_S = 0.25
"""Emulated time after the last step, in which the arm comes to rest."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmFindings:
    """The arm against its plan.

    Attributes:
        record: what the arm did.
        t_s: moments of the samples since the motion's start, shape (n,).
        tip_error_mm: distance of the end effector from where the plan has it at each of them, shape (n,).
        places: for each loss in the record, when and where on the path it was, in words.
        touches: for each touch in the record, when, where and what, in words.
    """

    record: ArmRecord
    t_s: NDArray[np.float64]
    tip_error_mm: NDArray[np.float64]
    places: tuple[str, ...]
    touches: tuple[str, ...]

    @property
    def clean(self) -> bool:
        """Whether no step was lost, no rule broken and nothing touched."""
        record = self.record
        return not (any(record.lost_full_steps) or record.lost or record.broken_rules or record.touches)

    def explain(self) -> str:
        """Say in a sentence what went wrong, and where it began."""
        return "; ".join([*self._lost_words(), *self._rule_words(), *self._touch_words()]) or "the arm did as planned"

    def figures(self) -> dict[str, Any]:
        """The run's figures for the summary."""
        record = self.record
        worst = int(np.argmax(self.tip_error_mm))
        return {
            "arm_max_tip_error_mm": round(float(self.tip_error_mm[worst]), 6),
            "arm_max_tip_error_at_s": round(float(self.t_s[worst]), 6),
            "arm_end_tip_error_mm": round(float(self.tip_error_mm[-1]), 6),
            "arm_lost_full_steps": list(record.lost_full_steps),
            "arm_broken_rules": len(record.broken_rules),
            "arm_touches": len(record.touches),
            "arm_clean": self.clean,
        }

    def _lost_words(self) -> list[str]:
        words = []
        for motor, steps in enumerate(self.record.lost_full_steps, start=1):
            events = [i for i, loss in enumerate(self.record.lost) if loss.motor == motor]
            if steps or events:
                first = f", first at {self.places[events[0]]}" if events else ""
                times = f" in {len(events)} slips" if len(events) > 1 else ""
                words.append(f"joint {motor} lost {abs(steps)} full steps{times}{first}")
        return words

    def _rule_words(self) -> list[str]:
        broken = self.record.broken_rules
        counts = Counter((b.motor, b.rule) for b in broken)
        words = []
        for (motor, rule), count in counts.items():
            first = next(b for b in broken if (b.motor, b.rule) == (motor, rule))
            words.append(
                f"joint {motor}'s driver saw {rule} broken {count} times, first with {first.measured_us:.4g} us where "
                f"{first.limit_us:.4g} us are needed"
            )
        return words

    def _touch_words(self) -> list[str]:
        return [f"{self.touches[0]} ({len(self.touches)} touches in all)"] if self.touches else []


def judge_arm(
    plan: Plan, record: ArmRecord, start_tick: int, obstacles: tuple[Scene, int] | None = None
) -> ArmFindings:
    """Hold what the arm did against the plan.

    Args:
        plan: what was planned.
        record: what the arm did.
        start_tick: moment of the plan's zero, on the record's clock.
        obstacles: whose, and the tick of their time 0; None takes the plan's scene and zero.
    """
    trajectory = plan.trajectory
    t_s = (record.ticks - start_tick) / TICKS_HZ
    during = t_s >= 0.0
    if not during.any():
        during[-1] = True
    t_s, q_rad = t_s[during], record.q_rad[during]
    arm = Arm.from_spec(plan.scene.arm)
    of, zero_tick = obstacles or (plan.scene, start_tick)
    record = replace(record, touches=(*record.touches, *moving_touches(record, of, zero_tick)))
    planned = trajectory.sample(np.clip(t_s, 0.0, trajectory.duration_s))[0]
    errors_cm = forward(arm, q_rad)[:, -1] - forward(arm, planned)[:, -1]

    def place(ticks: int) -> str:
        return _place(plan, (ticks - start_tick) / TICKS_HZ)

    return ArmFindings(
        record=record,
        t_s=t_s,
        tip_error_mm=10.0 * np.hypot(errors_cm[:, 0], errors_cm[:, 1]),
        places=tuple(place(loss.ticks) for loss in record.lost),
        touches=tuple(_touch_words(touch, place(touch.ticks)) for touch in record.touches),
    )


def moving_touches(record: ArmRecord, scene: Scene, zero_tick: int) -> list[Touch]:
    """Return the first touch of each moving obstacle with the arm as it really moved; resting ones touch by themselves.

    Args:
        record: what the arm did.
        scene: the obstacles.
        zero_tick: their time 0, on the record's clock.
    """
    if scene.moving is None:
        return []
    since = record.ticks >= zero_tick
    t_s, q_rad = (record.ticks[since] - zero_tick) / TICKS_HZ, record.q_rad[since]
    if not len(t_s):
        return []
    moving = moving_set(scene, float(t_s[-1]))
    found = first_touches(moving, t_s, forward(Arm.from_spec(scene.arm), q_rad), 0.5 * scene.arm.link_width_cm)
    return [
        Touch(zero_tick + round(t_s[pose] * TICKS_HZ), int(link) + 1, number)
        for number, ((pose, link), obstacle) in enumerate(zip(found, scene.obstacles, strict=True), start=1)
        if pose >= 0 and obstacle.motion is not None
    ]


def _place(plan: Plan, at_s: float) -> str:
    trajectory = plan.trajectory
    s = float(np.interp(at_s, trajectory.t_s, trajectory.s))
    return f"{at_s:.6f} s, {trajectory.path.place(s)}"


def _touch_words(touch: Touch, place: str) -> str:
    if touch.obstacle == 0:
        return f"joint {touch.link} ran into its stop at {place}"
    return f"link {touch.link} touched obstacles[{touch.obstacle}] at {place}"
