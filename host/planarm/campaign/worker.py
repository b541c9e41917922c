"""What happens on a worker: the runs of a batch, one after the other, within their limits."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker

from planarm.campaign.self_test import run_self_test
from planarm.campaign.task import Batch, Figures, Row, Task, task_key

TOO_LONG = 113
"""Exit code of a worker that gave up a run which took too long: compiled code cannot be interrupted."""


def run_batch_alone(batch: Batch) -> list[Row]:
    """As `run_batch`, on a worker that does nothing else, so that its memory may be limited."""
    _limit_memory(batch.limits.memory_mb)
    return run_batch(batch)


def run_batch(batch: Batch) -> list[Row]:
    """Carry out the runs of a batch; each leaves a row, whatever happens inside it."""
    return [_run(batch, task) for task in batch.tasks]


def _run(batch: Batch, task: Task) -> Row:
    key = task_key(batch.kind, batch.scenes[task.scene], task, batch.options)
    watch = threading.Timer(batch.limits.task_s, os._exit, (TOO_LONG,))
    watch.daemon = True
    began_s = time.perf_counter()
    watch.start()
    try:
        verdict, reason, figures = _outcome(batch, task)
    except Exception as error:  # noqa: BLE001 - a run that fails is a row that says why, and the others go on
        verdict, reason, figures = "failed", f"{type(error).__name__}: {error}", {}
    finally:
        watch.cancel()
    return Row(task, key, verdict, reason, time.perf_counter() - began_s, figures)


def _outcome(batch: Batch, task: Task) -> tuple[str, str, Figures]:
    if batch.kind == "self-test":
        return run_self_test(task.settings)
    from planarm.campaign.work import run_kind  # noqa: PLC0415 - brings planners and emulator, which take seconds

    return run_kind(batch.kind, batch.scenes[task.scene], task.settings, batch.options)


def leave_ctrl_c_to_parent() -> None:
    """Ignore Ctrl-C, which the terminal sends to all of its processes: the parent decides what ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def failed_row(batch: Batch, reason: str) -> Row:
    """Return the row of a run that took its worker with it."""
    (task,) = batch.tasks
    key = task_key(batch.kind, batch.scenes[task.scene], task, batch.options)
    return Row(task, key, "failed", reason, 0.0, {})


def _limit_memory(memory_mb: int) -> None:
    """Have the system refuse more memory, so that one run fails instead of the machine; not on Windows."""
    if memory_mb and sys.platform != "win32":
        import resource  # noqa: PLC0415 - there is none on Windows

        size = memory_mb << 20
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (size, hard))


@contextmanager
def started_deaf_to_ctrl_c() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C from their first instruction on, also while they import.

    A Ctrl-C meanwhile is kept for the end of the context, unless another thread takes it. On Windows, where nothing can
    be kept back, workers hear it until `leave_ctrl_c_to_parent`.
    """
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # its start would let the signal through again (CPython below 3.13)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
