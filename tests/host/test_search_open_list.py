"""The ring of buckets: as many as a power of two and at least those asked for, all empty."""

import numpy as np
import pytest

from planarm.search.open_list import NONE, make_open_list


@pytest.mark.parametrize("buckets", [1, 2, 3, 31, 32, 33, 1000])
def test_the_ring_has_room_for_all_buckets_that_can_be_in_use(buckets):
    entries = np.empty(8, np.int32)
    queue = make_open_list(buckets, entries, entries.copy())
    assert queue.ring.size >= buckets and queue.ring.size & (queue.ring.size - 1) == 0
    assert (queue.ring == NONE).all() and not queue.counts.any()
    assert queue.node is entries
