"""Chaos A*'s random subsets: real subsets, uniform, and a function of seed and counter alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planarm.search.draw import draw_subset, mix

word = st.integers(0, 2**63 - 1)


def subset(count, drawn, seed, counter, before=99):
    order = np.full(count, before, np.int64)
    draw_subset(order, drawn, seed, counter)
    assert sorted(order) == list(range(count))
    return order[:drawn].tolist()


@settings(deadline=None)
@given(word, word, st.integers(1, 68))
def test_a_draw_depends_on_seed_and_counter_alone(seed, counter, drawn):
    assert subset(68, drawn, seed, counter) == subset(68, drawn, seed, counter, before=3)


@settings(deadline=None)
@given(st.integers(0, 2**40))
def test_high_bits_of_seed_and_counter_count(low):
    draws = {tuple(subset(44, 23, seed, counter)) for seed, counter in ((low, 5), (low + 2**41, 5), (low, 5 + 2**41))}
    assert len(draws) == 3


def test_the_hash_is_the_documented_one_in_plain_integers():
    """Two rounds of x ^= x >> 16, x *= 0x45d9f3b and a last x ^= x >> 16, on 32 bits."""
    for value in (0, 1, 2, 0xDEADBEEF, 0xFFFFFFFF):
        expected = value
        for _ in range(2):
            expected = (expected ^ expected >> 16) * 0x45D9F3B % 2**32
        assert mix(value) == expected ^ expected >> 16


@pytest.mark.parametrize(("count", "drawn"), [(8, 5), (44, 23)])
def test_every_neighbour_is_drawn_equally_often(count, drawn):
    """Over n draws a neighbour's count has the standard deviation sqrt(n p (1 - p)); five of them are allowed."""
    draws = 4000
    times = np.zeros(count)
    for counter in range(draws):
        times[subset(count, drawn, 7, counter)] += 1
    p = drawn / count
    assert np.abs(times - draws * p).max() < 5.0 * np.sqrt(draws * p * (1.0 - p))
