"""The bucket queue against Python's heapq: same order, whatever the buckets' width."""

import heapq

import numpy as np
import pytest

from planarm.search.open_list import BUCKET, MADE, NONE, WAITING, make_open_list, pop, with_more_room

LONGEST_CM = 1.0


def push(queue, bucket, f_cm, node, live):
    """Put an entry where the search puts it."""
    entry, place = queue.counts[MADE], max(bucket, queue.counts[BUCKET]) & (queue.ring.size - 1)
    queue.f_cm[entry], queue.node[entry], queue.below[entry] = f_cm, node, queue.ring[place]
    queue.ring[place] = entry
    live[node] = entry
    queue.counts[MADE] += 1
    queue.counts[WAITING] += 1


@pytest.mark.parametrize("buckets_per_cm", [1e-6, 0.7, 16.0, 300.0])
@pytest.mark.parametrize("seed", range(5))
def test_entries_leave_as_from_one_heap_lowest_f_first_then_newest(buckets_per_cm, seed):
    random = np.random.default_rng(seed)
    nodes = 60
    live = np.full(nodes, NONE)
    queue = make_open_list(2.0 * LONGEST_CM * buckets_per_cm, 8)
    heap, made, f_cm = [], 0, 0.0
    while made < 500:
        for _ in range(random.integers(0, 6)):
            # Multiples of 1/8 make many equal f; what is pushed lies up to two moves above what was popped last.
            new_f = f_cm + random.integers(0, 17) / 8.0 * LONGEST_CM
            node = int(random.integers(nodes))
            if made == queue.node.size:
                queue = with_more_room(queue)
            push(queue, int(new_f * buckets_per_cm), new_f, node, live)
            heapq.heappush(heap, (new_f, -made, node))
            made += 1
        if random.random() < 0.1:  # a node is closed: none of its entries counts any more
            live[random.integers(nodes)] = NONE
        while heap and live[heap[0][2]] != -heap[0][1]:
            heapq.heappop(heap)
        expected = heap[0][2] if heap else NONE
        node = pop(*queue, live)
        assert node == expected
        if heap:
            f_cm = heapq.heappop(heap)[0]
    assert made >= 500


def test_an_empty_list_gives_no_node():
    assert pop(*make_open_list(1.0, 4), np.full(3, NONE)) == NONE
