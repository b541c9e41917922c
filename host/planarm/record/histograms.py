"""Histograms of step timing: how far each step is from its time, how far apart steps are, how long pulses are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planarm.plan import Findings
from planarm.stepping.plan import SegmentPlan
from planarm.stepping.segments import expand
from planarm_wire.messages import TICKS_HZ

Floats = NDArray[np.float64]
Ticks = NDArray[np.int64]

US = 1e6 / TICKS_HZ
ERROR_BARS_TICKS = 12
"""Errors are told tick by tick up to this far, and beyond it in one bar."""
INTERVAL_BARS = 36
WIDTH_BARS = 24


def error_histogram(plan: SegmentPlan, findings: Findings, start_tick: int) -> dict[str, Any] | None:
    """Return how many steps are how many ticks from their scheduled tick; None when the counts differ."""
    if findings.comparison.max_timing_error_ticks is None:
        return None
    errors = [
        seen.ticks - joint.ticks - start_tick for joint, seen in zip(expand(plan).steps, findings.measured, strict=True)
    ]
    most = ERROR_BARS_TICKS
    reach = min(most, max(2, *(int(np.abs(e).max(initial=0)) for e in errors)))
    counts = [np.bincount(np.clip(e, -reach, reach) + reach, minlength=2 * reach + 1).tolist() for e in errors]
    return {"ticks": list(range(-reach, reach + 1)), "counts": counts, "us_per_tick": US}


def interval_histogram(ticks: Sequence[Ticks]) -> dict[str, Any] | None:
    """Return how many intervals between steps are how long, in bars of equal ratio; None with no interval."""
    gaps_us = [US * np.diff(joint).astype(np.float64) for joint in ticks]
    every = np.concatenate(gaps_us)
    every = every[every > 0.0]
    if not len(every):
        return None
    edges = np.geomspace(every.min() * 0.999, every.max() * 1.001, INTERVAL_BARS + 1)
    counts = [np.histogram(gaps, edges)[0].tolist() for gaps in gaps_us]
    return {"edges_us": [float(f"{edge:.5g}") for edge in edges], "counts": counts, "log": True}


def width_histogram(pulses: Sequence[tuple[Ticks, Ticks]]) -> dict[str, Any] | None:
    """Return how many STEP pulses are how long; None without a pulse.

    Args:
        pulses: for each joint its rising and its falling edges.
    """
    widths = []
    for rises, falls in pulses:
        ends = np.searchsorted(falls, rises, side="right")
        whole = ends < len(falls)
        widths.append(US * (falls[ends[whole]] - rises[whole]).astype(np.float64))
    every = np.concatenate(widths)
    if not len(every):
        return None
    low, high = every.min() - 0.5 * US, every.max() + 0.5 * US
    edges = np.linspace(low, max(high, low + WIDTH_BARS * US), WIDTH_BARS + 1)
    counts = [np.histogram(width, edges)[0].tolist() for width in widths]
    return {"edges_us": [float(f"{edge:.6g}") for edge in edges], "counts": counts, "log": False}


def pin_names(pins: tuple[str, str]) -> str:
    """Return the STEP and the DIR pin of a joint in words."""
    return f"STEP {pins[0]}, DIR {pins[1]}"
