"""Runs that misbehave on purpose, by their setting "do": what the engines and their tests are held against.

`kind = "self-test"` in a file checks that a machine or cluster survives crashes, memory hogs and endless runs.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping

from planarm.campaign.task import Figures, Value
from planarm.errors import SceneError

CRASH_AFTER_S = 0.5
"""A worker that dies while it still starts takes its Dask nanny along; a real run, with its imports, dies later."""

DEEDS = ("answer", "raise", "crash", "hang", "hog")


def run_self_test(settings: Mapping[str, Value]) -> tuple[str, str, Figures]:
    """Do what the setting "do" says for the number "seed".

    Raises:
        SceneError: no such deed.
        RuntimeError: asked for.
        MemoryError: for "hog", where limits.memory_mb holds.
    """
    deed, seed = settings.get("do", "answer"), settings.get("seed", 0)
    if deed == "raise":
        raise RuntimeError(f"run {seed} was asked to raise")
    if deed == "crash":
        time.sleep(CRASH_AFTER_S)
        os.kill(os.getpid(), signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
    if deed == "hang":
        time.sleep(3600.0)
    if deed == "hog":
        return "ok", "", {"bytes": len(bytearray(64 << 30))}
    if deed not in DEEDS:
        raise SceneError("self-test", "do", f"{deed!r} given, one of {', '.join(DEEDS)} expected")
    return "ok", "", {"square": int(str(seed)) ** 2}
