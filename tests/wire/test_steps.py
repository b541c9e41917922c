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
    st.one_of(st.integers(0, 2**32 - 1), st.integers(2**24 - 3, 2**24 + 3)),
    st.integers(-(2**31), 2**31 - 1),
)


@given(MOVES)
@settings(deadline=None)
def test_closed_form_equals_the_sum_of_the_intervals(move: Move) -> None:
    moment, interval = Fraction(0), Fraction(move.interval_q8, 2**8)
    expected = []
    few, slow = steps.step_count(move) <= 128, move.interval_q8 >= 2**24
    low_bytes = move.add.to_bytes(4, "little", signed=True)[:3]  # 256 of these, modulo 2^32
    add = Fraction(move.add if slow or not few else int.from_bytes(low_bytes, "little", signed=True))
    add /= 2**8 if few else 2**16
    for _ in range(steps.step_count(move)):
        expected.append(move.first_ticks + floor(moment))
        moment += interval
        interval += add
    assert steps.step_ticks(move) == tuple(expected)


def test_known_steps() -> None:
    # Intervals of 2000, 1900, 1800 ticks after the first step at 100; the other joint turns back once, at 7.
    segment = Segment(2 * 16_000 + 1, (Move(2 * 4 + 1, 100, 2000 << 8, -(100 << 8)), Move(2, 7)))
    assert steps.expand_moves(segment) == ((100, 2100, 4000, 5800), (7,))
    assert [steps.signed_steps(move) for move in segment.moves] == [4, -1]
    assert steps.duration_ticks(segment) == 16_000
    assert steps.is_last(segment)
    assert not steps.is_last(Segment(2 * 16_000, segment.moves))


def test_known_slow_steps() -> None:
    # Intervals of 65536, 65535.5 and 65535 ticks; an add that is more than 16 bits of ticks.
    assert steps.step_ticks(Move(2 * 4, 10, 1 << 24, -128)) == (10, 65_546, 131_081, 196_616)
    assert steps.step_ticks(Move(2 * 3, 10, 1 << 24, 70_000 << 8)) == (10, 65_546, 201_082)


def test_known_steps_of_a_move_of_many() -> None:
    # Up to 128 steps the add counts 2^-8 ticks, from 129 on 2^-16.
    few, many = (Move(2 * count, 0, 1000 << 8, 256) for count in (128, 129))
    assert steps.step_ticks(few)[-1] == 127 * 1000 + 127 * 126 // 2
    assert steps.step_ticks(many)[-1] == 128 * 1000 + 128 * 127 // 2 // 256


@given(st.integers(0, 300), st.booleans(), st.integers(0, 2**32 - 1), st.integers(-(2**23), 2**23 - 1))
def test_a_move_of_its_numbers(count: int, positive: bool, interval_q8: int, add: int) -> None:
    move = Move(2 * count + positive, 5, interval_q8, add)
    assert steps.move_of(count, positive, 5, interval_q8, steps.add_q16(move)) == move


def test_a_resting_joint_makes_no_step_in_either_direction() -> None:
    assert steps.expand_moves(Segment(20, (Move(0), Move(1)))) == ((), ())
    assert [steps.direction(move) for move in (Move(0), Move(1))] == [-1, 1]


def test_the_floor_goes_down_also_for_a_negative_sum() -> None:
    # n (n - 1) / 2 A = -1 / 2^8 at n = 2 with I = 0: one tick before, not the same tick.
    assert steps.step_ticks(Move(2 * 3, 10, 0, -1)) == (10, 10, 9)
