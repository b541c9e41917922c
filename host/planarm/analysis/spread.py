"""Sizes of errors in bounded memory: exact maximum and mean square, quantiles to the nanosecond."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

BIN_PS = 1000
BINS = 1 << 20
"""Up to a millisecond; larger ones share the last bin."""


@dataclass(frozen=True, slots=True)
class Spread:
    """How large the absolute values are, in microseconds; p50 and p99 rounded up to the nanosecond."""

    p50_us: float
    p99_us: float
    max_us: float
    rms_us: float


@dataclass(slots=True, eq=False)
class SpreadBins:
    """Collects absolute values, array by array."""

    bins: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(BINS, np.int64), init=False)
    count: int = field(default=0, init=False)
    largest_ps: float = field(default=0.0, init=False)
    squares: float = field(default=0.0, init=False)

    def add(self, errors_ps: npt.NDArray[np.float64]) -> None:
        """Take more values, of either sign."""
        if not len(errors_ps):
            return
        sizes = np.abs(errors_ps)
        places = np.minimum(np.ceil(sizes / BIN_PS), BINS - 1).astype(np.int64)
        found = np.bincount(places)
        self.bins[: len(found)] += found
        self.count += len(sizes)
        self.largest_ps = max(self.largest_ps, float(sizes.max()))
        self.squares += float(sizes @ sizes)

    def spread(self) -> Spread | None:
        """Return the sizes, None without a value."""
        if not self.count:
            return None
        rms_ps = float(np.sqrt(self.squares / self.count))
        return Spread(self._quantile_us(0.5), self._quantile_us(0.99), 1e-6 * self.largest_ps, 1e-6 * rms_ps)

    def _quantile_us(self, share: float) -> float:
        place = int(np.searchsorted(np.cumsum(self.bins), np.ceil(share * self.count)))
        return 1e-6 * min(place * BIN_PS if place < BINS - 1 else self.largest_ps, self.largest_ps)
