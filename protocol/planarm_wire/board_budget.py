"""What the released images take of their processor, measured on the emulator (firmware/README.md, budgets)."""

from __future__ import annotations

from typing import Final

COMPARE_TICKS: Final = 75
"""A step that a compare output makes."""
RUN_COMPARE_TICKS: Final = 83
"""The same with its fraction in the run instead of a register."""
SECOND_MATCH_TICKS: Final = 38 + 90
"""A step whose pulse ends by a second match: an interrupt at its rise and one at its fall."""
PORT_TICKS: Final = 84
"""A step on another pin by the same interrupt."""
SCHEDULED_TICKS: Final = 63 + 106
"""A step of joint 3 or 4: an interrupt at its rise and one at its fall."""

STEP_INTERRUPT_TICKS: Final[dict[str, tuple[int, ...]]] = {
    "uno": (COMPARE_TICKS,) * 2,
    "uno_four": (RUN_COMPARE_TICKS,) * 2 + (SCHEDULED_TICKS,) * 2,
    "uno_slow": (SECOND_MATCH_TICKS,) * 2,
    "cnc_shield": (PORT_TICKS,) * 2,
    "cnc_shield_four": (PORT_TICKS,) * 2 + (SCHEDULED_TICKS,) * 2,
}
"""Of each board, by its name: each joint's step."""

READ_TICKS: Final = 7_000
READ_JOINT_TICKS: Final = 4_000
"""The main program's work on a segment, and on each joint that it moves, from the rates at which it just keeps up: two
joints at 12,000 to 15,000 ticks with a busy line; with the queue filled beforehand two at 9,200 (uno) and 9,900, three
at 12,800, four at 15,000 (uno_four)."""
SLICE_JOINT_TICKS: Final = 4_000
"""The same on each joint in each further slice of it."""

PREPARED_SLICES: Final = 3
"""Of so many slices a joint has runs at once, the one being executed included (firmware/core/step_engine.h)."""

LINE_LOAD: Final = 0.1
"""Share of the processor that the interrupts of a busy line take."""
STRETCHED_JOINT_TICKS: Final = 8_500
"""What a board needs more for a segment that is stretched, for each joint of its image: with those of 0.5 and 1 ms uno
keeps up at one every 2.0 ms; uno_four at one every 2.5 ms with two joints moving, 3.4 ms with three, 4.2 ms with four.
"""
SLOWED_TICKS: Final = 2_300
SLOWED_JOINT_TICKS: Final = 4800
"""The main program's work on a slice of the path that is slowed down, and on each joint that moves in it: cycles of
`Motion::open_slice`, of `Cursor::take` (3,500 to 4,100 on average) and of the passes that they come in."""
SLOWED_ANEW_TICKS: Final = 900
"""More for each such joint where a slice is not as long as the one before: how many steps it has is not known then."""
READ_SLOWED_TICKS: Final = 1_000
READ_SLOWED_JOINT_TICKS: Final = 950
"""What a segment's first slice takes more, and for each joint of the board: `Motion::read_next_segment`."""
LINE_PASS_TICKS: Final = 4_700
UNSEEN_SLICES: Final = 3
"""The longest pass that looks at the line, and of how many slices that are followed by one of the same segment one is
followed by such a pass, where time is short (firmware/core/motion.cpp)."""
WAITING_LINE_LOAD: Final = 0.06
"""Share of the processor that the interrupts of a full line take which is not answered."""
SLOWED_SPARE_TICKS: Final = 4_000
"""A slowed slice must be ready so long before it begins. Measured on the emulator (docs/decisions/0137): at the rates
where this is just so every hold rests, at many moments of a slice, on a line that is silent, full of queries or full of
repeated segments."""
LATEST_READ_TICKS: Final = 40_000
"""How long before its start a segment must be there."""
LEAST_SHARE: Final = 0.05
"""Keeps an overloaded board's time finite."""


def work_ticks(joints: int, further_slices: int) -> int:
    """Return the main program's work on a segment of an arm with so many joints, cut into so many slices and one."""
    return READ_TICKS + joints * (READ_JOINT_TICKS + SLICE_JOINT_TICKS * further_slices)
