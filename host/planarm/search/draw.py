"""Random subsets of a neighbourhood for Chaos A*, the same on every platform and with or without Numba.

Paper C calls the algorithm chaotic but defines nothing chaotic: the subset is random. Here it is a function of the
seed and a counter, not of a generator's state, so what is drawn at a node does not depend on the order of expansion.
The hash is a 32-bit multiply-xorshift mixer (two rounds of x ^= x >> 16, x *= 0x45d9f3b); every product stays below
2^63, so plain signed integers hold it.
"""

import numpy as np
from numpy.typing import NDArray

from planarm_wire.kernel_cache import kernel

_MASK = 0xFFFFFFFF
_MULTIPLIER = 0x045D9F3B
_STEP = 0x61C88647  # 2^32 less the golden ratio's share of it: successive counters lie far apart


@kernel
def mix(word: int) -> int:
    """Return a hash of a 32-bit word, 0 <= hash < 2^32; different words give different hashes."""
    word &= _MASK
    word = ((word ^ (word >> 16)) * _MULTIPLIER) & _MASK
    word = ((word ^ (word >> 16)) * _MULTIPLIER) & _MASK
    return word ^ (word >> 16)


@kernel
def draw_subset(order: NDArray[np.int64], drawn: int, seed: int, counter: int) -> None:
    """Put a random subset of 0 .. order.size - 1, drawn without replacement, into the first `drawn` places of `order`.

    `seed` and `counter` are non-negative and below 2^63; the same two give the same subset.
    """
    state = mix(mix(mix(mix(seed) ^ (seed >> 32)) ^ counter) ^ (counter >> 32))
    for i in range(order.size):
        order[i] = i
    for i in range(drawn):
        state = (state + _STEP) & _MASK
        chosen = i + ((mix(state) * (order.size - i)) >> 32)
        order[i], order[chosen] = order[chosen], order[i]
