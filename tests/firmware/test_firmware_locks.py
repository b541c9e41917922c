"""For how long the images keep interrupts off: the longest way through each lock in the listing, to the cycle."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_locks import Listing

# Two of each are the instruction between two interrupts. firmware/README.md, budgets: with 11 the sum of `uno` is its
# least interval of 225. `uno_four` has four joints to look at; its sum is 651 of 1,000.
SHORT_CYCLES = {"uno": 13, "uno_slow": 17, "cnc_shield": 17, "uno_four": 17, "cnc_shield_four": 17}
# Around the start of a joint at rest (the sum of `uno` leaves 88, as no step of that joint waits for the other's), and
# what rests: firmware/core/step_engine.cpp, freeze.
START_CYCLES = {"uno": 55, "uno_slow": 55, "cnc_shield": 44, "uno_four": 70, "cnc_shield_four": 70}
FREEZE_CYCLES = {"uno": 93, "uno_slow": 78, "cnc_shield": 60, "uno_four": 224, "cnc_shield_four": 183}
# What finds that a step is missed, and what ends a motion; but in the last the other joint may step.
END_CYCLES = {"serve": 50, "end_steps": 34}

needs_avr_gcc = pytest.mark.skipif(
    shutil.which("avr-gcc") is None, reason="avr-gcc is not installed (Debian: gcc-avr, avr-libc): no image is built"
)


@needs_avr_gcc
@pytest.mark.parametrize("board", SHORT_CYCLES)
def test_locks_that_are_met_while_joints_step_are_short(built_image: Callable[[str], Path], board: str) -> None:
    locked = Listing(built_image(board).with_suffix(".elf")).locked_cycles()

    def longest(name: str) -> int:
        return max(locked.pop(title) for title in list(locked) if f"::{name}(" in title)

    assert longest("start") == START_CYCLES[board]
    assert longest("freeze") == FREEZE_CYCLES[board]
    assert all(longest(name) <= most for name, most in END_CYCLES.items())
    assert len(locked) >= 4
    assert max(locked.values()) <= SHORT_CYCLES[board], locked


@needs_avr_gcc
@pytest.mark.parametrize("board", ["uno", "uno_slow", "uno_four"])
def test_a_joint_that_is_started_is_armed_in_time(built_image: Callable[[str], Path], board: str) -> None:
    # From the look at Timer1 to the output's mode and the interrupt; firmware/hal/uno/hal_step_timer.h asks for 38.
    listing = Listing(built_image(board).with_suffix(".elf"))
    look, mode, interrupts = ("lds", "0x0084"), ("sts", "0x0080"), ("sts", "0x006F")
    assert listing.way_cycles("start", look, mode) == (21 if board == "uno_four" else 19)
    assert listing.way_cycles("start", look, interrupts) == (26 if board == "uno_four" else 24)


class Written(Listing):
    """A listing that is written down."""

    def __init__(self, text: str) -> None:
        self.text = text


def test_calls_loops_and_ways_are_counted() -> None:
    # Two turns of a loop, with a call in each that goes the way of its number.
    listing = Written(
        """
00000010 <looks()>:
  10:\tin\tr25, 0x3f\t; 63
  12:\tcli
  14:\tldi\tr24, 0x02\t; 2
  16:\tsubi\tr24, 0x01\t; 1
  18:\trcall\t.+14\t; 0x28 <edge>
  1a:\tcpse\tr24, r1
  1c:\trjmp\t.-8\t; 0x16 <looks()+0x6>
  1e:\tout\t0x3f, r25\t; 63
  20:\tpop\tr28
  22:\tret

00000028 <edge>:
  28:\tcpse\tr24, r1
  2a:\trjmp\t.+6\t; 0x32 <edge+0xa>
  2c:\tlds\tr30, 0x0088\t; 0x800088
  30:\tret
  32:\tret
"""
    )
    edge = {1: 1 + 2 + 4, 0: 2 + 2 + 4}  # by what R24 is there
    turns = [1 + 3 + edge[1] + 1 + 2, 1 + 3 + edge[0] + 2]
    assert listing.locked_cycles() == {"looks()": 1 + 1 + sum(turns) + 1 + 2 + 4}


def test_a_loop_without_an_end_is_refused() -> None:
    listing = Written(
        "00000010 <waits>:\n  10:\tcli\n  12:\tsbis\t0x05, 2\t; 5\n  14:\trjmp\t.-4\t; 0x12\n  16:\tnop\n"
    )
    with pytest.raises(AssertionError, match="locked in a loop without an end, at 12"):
        listing.locked_cycles()
