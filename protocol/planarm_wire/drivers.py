"""Step/dir drivers as rows of data: what each asks of its inputs, and where each value is from.

Host and emulator both read them: one to plan and to judge waveforms, the other to enforce them. Times are minima in
seconds; None where the maker states no such rule, or one that follows from the others. The makers' sheets were read
through code and pages that quote them, named per row in `source`; where two disagree the row says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

__all__ = ["DRIVERS", "RULES", "DriverRow"]

RULES = ("step_high", "step_low", "step_period", "dir_setup", "dir_hold", "enable_setup", "mode_setup", "wake_up")
"""Names of the rules, each a column with the suffix _s."""


@dataclass(frozen=True, slots=True)
class DriverRow:
    """One driver.

    Attributes:
        name: as a scene has it.
        title: as people call it.
        step_high_s: STEP high. Shorter: no step.
        step_low_s: STEP low between two pulses. Shorter: the pulses are one, the second makes no step.
        step_period_s: from rise to rise. Shorter: no step.
        dir_setup_s: DIR before the rise of STEP. Shorter: a step the old way.
        dir_hold_s: DIR after the rise of STEP. Shorter: a step the new way.
        enable_setup_s: ENABLE before the rise of STEP. Shorter: the step is lost.
        mode_setup_s: micro-step pins before the rise of STEP. Shorter: a step of the old size.
        wake_up_s: from SLEEP released, or from motor supply, to the first step. Shorter: the step is lost.
        modes: micro-steps by the levels of the mode pins, first pin first; empty when switches on the board set them.
        microsteps: every resolution it has.
        counts_disabled: whether steps still move its phase while ENABLE is off.
        home_deg: electrical angle that it takes when it gets power.
        source: where the values are from, by column; "all" for those not named.
    """

    name: str
    title: str
    step_high_s: float
    step_low_s: float
    step_period_s: float | None
    dir_setup_s: float | None
    dir_hold_s: float | None
    enable_setup_s: float | None
    mode_setup_s: float | None
    wake_up_s: float | None
    modes: Mapping[tuple[int, ...], int]
    microsteps: tuple[int, ...]
    counts_disabled: bool
    home_deg: float
    source: Mapping[str, str]

    def limit_s(self, rule: str) -> float | None:
        """The least time of a rule of RULES, in seconds."""
        value: float | None = getattr(self, f"{rule}_s")
        return value

    def with_pulses(self, high_s: float | None, low_s: float | None) -> DriverRow:
        """The same driver on a board that needs other pulses; None keeps what the row says."""
        return replace(
            self,
            step_high_s=self.step_high_s if high_s is None else high_s,
            step_low_s=self.step_low_s if low_s is None else low_s,
        )


def _levels(*bits: str) -> list[tuple[int, ...]]:
    return [tuple(map(int, b)) for b in bits]


_A4988_MODES = dict(zip(_levels("000", "100", "010", "110", "111"), (1, 2, 4, 8, 16), strict=True))
_DRV8825_MODES = dict(
    zip(_levels("000", "100", "010", "110", "001", "101", "011", "111"), (1, 2, 4, 8, 16, 32, 32, 32), strict=True)
)

_ROWS = (
    DriverRow(
        name="a4988",
        title="Allegro A4988",
        step_high_s=1e-6,
        step_low_s=1e-6,
        step_period_s=None,
        dir_setup_s=0.2e-6,
        dir_hold_s=0.2e-6,
        enable_setup_s=0.2e-6,
        mode_setup_s=0.2e-6,
        wake_up_s=1000e-6,
        modes=_A4988_MODES,
        microsteps=(1, 2, 4, 8, 16),
        counts_disabled=True,
        home_deg=45.0,
        source={
            "all": "A4988 sheet, figure 1 (tA to tD) and sleep mode, as quoted by laurb9/StepperDriver src/A4988.h, "
            "esphome pull request 1597 and Marlin Configuration_adv.h, which agree",
            "counts_disabled": "A4988 sheet, enable input: the translator's inputs stay active",
            "home_deg": "A4988 sheet, table 2: home state, 45 degrees",
        },
    ),
    DriverRow(
        name="drv8825",
        title="Texas Instruments DRV8825",
        step_high_s=1.9e-6,
        step_low_s=1.9e-6,
        step_period_s=4e-6,
        dir_setup_s=0.65e-6,
        dir_hold_s=0.65e-6,
        enable_setup_s=0.65e-6,
        mode_setup_s=0.65e-6,
        wake_up_s=1700e-6,
        modes=_DRV8825_MODES,
        microsteps=(1, 2, 4, 8, 16, 32),
        counts_disabled=True,
        home_deg=45.0,
        source={
            "all": "DRV8825 sheet, 6.6 timing requirements 1 to 7, as quoted by laurb9/StepperDriver src/DRV8825.h and "
            "Marlin Configuration_adv.h, which agree",
            "home_deg": "DRV8825 sheet, indexer: home state, 45 degrees",
        },
    ),
    *(
        DriverRow(
            name=name,
            title=f"Trinamic {name.upper()}, stand-alone",
            step_high_s=0.1e-6,
            step_low_s=0.1e-6,
            step_period_s=None,
            dir_setup_s=0.02e-6,
            dir_hold_s=0.02e-6,
            enable_setup_s=None,
            mode_setup_s=None,
            wake_up_s=None,
            modes=modes,
            microsteps=tuple(sorted(modes.values())),
            counts_disabled=True,
            home_deg=45.0,
            source={
                "all": "TMC2208 and TMC2209 sheets, STEP/DIR timing (tSH, tSL at the 12 MHz internal clock; tDSU, "
                "tDSH), as quoted by applied-ee.github.io and by Klipper Config_Reference.md (step_pulse_duration)",
                "modes": "TMC2208 and TMC2209 sheets, MS1 and MS2 in stand-alone mode",
            },
        )
        for name, modes in (
            ("tmc2208", dict(zip(_levels("00", "10", "01", "11"), (8, 2, 4, 16), strict=True))),
            ("tmc2209", dict(zip(_levels("00", "10", "01", "11"), (8, 32, 64, 16), strict=True))),
        )
    ),
    DriverRow(
        name="dm542",
        title="Leadshine DM542 and its kin",
        step_high_s=2.5e-6,
        step_low_s=2.5e-6,
        step_period_s=None,
        dir_setup_s=5e-6,
        dir_hold_s=None,
        enable_setup_s=5e-6,
        mode_setup_s=None,
        wake_up_s=None,
        modes={},
        microsteps=(1, 2, 4, 8, 16, 32, 64, 128),
        counts_disabled=False,
        home_deg=45.0,
        source={
            "all": "DM542T manual as quoted by industrialmonitordirect.com (2.5 us, 200 kHz) and grblHAL/RP2040 issue "
            "100 (5 us from ENA to DIR and from DIR to PUL)",
            "microsteps": "DM542 manual, switches 5 to 8; the settings by pulses a turn (5, 10, 25 ...) are left out",
        },
    ),
    DriverRow(
        name="tb6600",
        title="TB6600 boards",
        step_high_s=3e-6,
        step_low_s=3e-6,
        step_period_s=None,
        dir_setup_s=1.5e-6,
        dir_hold_s=1.5e-6,
        enable_setup_s=None,
        mode_setup_s=None,
        wake_up_s=None,
        modes={},
        microsteps=(1, 2, 4, 8, 16, 32),
        counts_disabled=False,
        home_deg=45.0,
        source={
            "all": "Marlin Configuration_adv.h (3 us, 1.5 us, which it calls a guess); boards vary: users of "
            "StepperDriver issue 60 and FastAccelStepper issue 83 needed up to 30 us"
        },
    ),
)

DRIVERS: Mapping[str, DriverRow] = {row.name: row for row in _ROWS}
"""Every driver by name."""
