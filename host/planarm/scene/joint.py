"""`[[joints]]`: a joint's motor, gear, driver and limits."""

from dataclasses import dataclass, field
from math import pi

from planarm.scene.motor import MotorSpec
from planarm_wire.drivers import DRIVERS, DriverRow


@dataclass(frozen=True, slots=True)
class JointSpec:
    """A joint's stepper motor, gear and limits.

    `reversed` is True when the motor's positive sense turns the joint clockwise; `zero_offset_rad` is the joint's angle
    when all motors stand at micro-step 0. `max_jerk_rad_s3` is None where jerk has no limit.
    """

    steps_per_rev: int
    microsteps: int
    gear_ratio: float
    driver: str
    max_speed_rad_s: float
    max_acceleration_rad_s2: float
    reversed: bool = False
    zero_offset_rad: float = 0.0
    motor: MotorSpec = field(default_factory=MotorSpec)
    max_jerk_rad_s3: float | None = None
    step_high_s: float | None = None
    """Least high time of a STEP pulse; None: what `driver` needs as a rule. So for the next."""
    step_low_s: float | None = None

    @property
    def driver_row(self) -> DriverRow:
        """What the joint's driver asks of its inputs."""
        return DRIVERS[self.driver].with_pulses(self.step_high_s, self.step_low_s)

    @property
    def usteps_per_rad(self) -> float:
        """Micro-steps of the motor for one radian behind its gear, whatever the sense."""
        return self.steps_per_rev * self.microsteps * self.gear_ratio / (2.0 * pi)
