"""Rate codes: round down, by less than a sixteenth, over six decades."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planarm_wire.messages import NEED_UNIT_TICKS
from planarm_wire.rates import MAX_CODE, RATE_UNIT_PER_S, need_code, rate_code, rate_per_s, rate_value


def test_values_by_hand() -> None:
    assert [rate_value(code) for code in (0, 1, 15, 16, 31, 32, 33, 48, 255)] == [
        0,
        1,
        15,
        16,
        31,
        32,
        34,
        64,
        31 << 14,
    ]


@given(st.integers(0, MAX_CODE))
def test_every_code_comes_back(code: int) -> None:
    assert rate_code(rate_per_s(code)) == code


@given(st.floats(0.06, 1800.0))
def test_codes_round_down_by_less_than_a_sixteenth(rate: float) -> None:
    told = rate_per_s(rate_code(rate))
    assert told <= rate < told * (1 + 1 / 16) + RATE_UNIT_PER_S


def test_values_grow_with_the_code_and_end_at_the_largest() -> None:
    values = [rate_value(code) for code in range(MAX_CODE + 1)]
    assert values == sorted(set(values))
    assert rate_code(float("inf")) == MAX_CODE


@pytest.mark.parametrize("rate", [-1.0, float("nan")])
def test_no_rate(rate: float) -> None:
    with pytest.raises(ValueError, match="a rate is 0 or more"):
        rate_code(rate)
    with pytest.raises(ValueError, match="a path time is 0 or more"):
        need_code(rate)


def test_a_code_outside_a_byte() -> None:
    with pytest.raises(ValueError, match="0 to 255, not 256"):
        rate_value(256)


def test_needs_round_up() -> None:
    assert [need_code(t) for t in (0, 1, NEED_UNIT_TICKS, NEED_UNIT_TICKS + 1)] == [0, 1, 1, 2]
    assert need_code(1e12) == MAX_CODE
