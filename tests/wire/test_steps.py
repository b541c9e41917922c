"""The closed form of the step times equals summing the intervals, in exact arithmetic."""

from fractions import Fraction
from math import floor

from hypothesis import given, settings
from hypothesis import strategies as st

from planarm_wire import steps
from planarm_wire.messages import Move, Segment

MOVES = st.builds(
    Move,
    st.integers(0, 2 * 200 + 1),
    st.integers(0, 2**30),
    st.integers(0, 2**32 - 1),
    st.integers(-(2**31), 2**31 - 1),
)


@given(MOVES)
@settings(deadline=None)
def test_closed_form_equals_the_sum_of_the_intervals(move: Move) -> None:
    moment, interval = Fraction(0), Fraction(move.interval_q8, 2**8)
    expected = []
    for _ in range(steps.step_count(move)):
        expected.append(move.first_ticks + floor(moment))
        moment += interval
        interval += Fraction(move.add_q16, 2**16)
    assert steps.step_ticks(move) == tuple(expected)


def test_known_steps() -> None:
    # Intervals of 2000, 1900, 1800 ticks after the first step at 100; the other joint turns back once, at 7.
    segment = Segment(2 * 16_000 + 1, (Move(2 * 4 + 1, 100, 2000 << 8, -(100 << 16)), Move(2, 7)))
    assert steps.expand_moves(segment) == ((100, 2100, 4000, 5800), (7,))
    assert [steps.signed_steps(move) for move in segment.moves] == [4, -1]
    assert steps.duration_ticks(segment) == 16_000
    assert steps.is_last(segment)
    assert not steps.is_last(Segment(2 * 16_000, segment.moves))


def test_a_resting_joint_makes_no_step_in_either_direction() -> None:
    assert steps.expand_moves(Segment(20, (Move(0), Move(1)))) == ((), ())
    assert [steps.direction(move) for move in (Move(0), Move(1))] == [-1, 1]


def test_the_floor_goes_down_also_for_a_negative_sum() -> None:
    # n (n - 1) / 2 A = -1 / 2^16 at n = 2 with I = 0: one tick before, not the same tick.
    assert steps.step_ticks(Move(2 * 3, 10, 0, -1)) == (10, 10, 9)
