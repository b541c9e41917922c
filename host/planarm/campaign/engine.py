"""Where batches run: processes of this machine, or a Dask cluster, behind one small interface.

Neither schedules anything of its own: `concurrent.futures` and `dask.distributed` do. What this file adds is what a
campaign needs of them: a worker that dies takes its batches down with it, so these are split, and a run that kills
the worker on which it is alone is a failed row. Rows come in whatever order they finish.
"""

from __future__ import annotations

import multiprocessing
import time
from collections import deque
from collections.abc import Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Protocol, TypeAlias

from planarm.campaign.task import Batch, Row
from planarm.campaign.worker import failed_row, leave_ctrl_c_to_parent, run_batch_alone, started_deaf_to_ctrl_c

WAITING_BATCHES = 2
"""Batches handed out ahead for each worker, so that none waits for its next."""


Rows: TypeAlias = Generator[list[Row], None, None]


class Engine(Protocol):
    """Runs batches somewhere."""

    def run(self, batches: Iterator[Batch]) -> Rows:
        """Yield the rows of each batch as it finishes; closing the iterator stops the work."""


class LocalEngine:
    """Processes on this machine.

    Args:
        workers: how many.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._context = multiprocessing.get_context("spawn")

    def run(self, batches: Iterator[Batch]) -> Rows:
        """See `Engine`."""
        suspects: deque[Batch] = deque()
        again: deque[Batch] = deque()
        while True:
            pool = self._pool(self._workers)
            try:
                yield from self._until_broken(pool, batches, again)
                break
            except _WorkerDied as died:
                suspects.extend(died.batches)
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
                stop_processes(pool)
            # What was under way when a worker died is run alone, one by one, so that the guilty run is known.
            while suspects:
                yield from self._run_alone(suspects.popleft())

    def _pool(self, workers: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(workers, mp_context=self._context, initializer=leave_ctrl_c_to_parent)

    def _until_broken(self, pool: ProcessPoolExecutor, batches: Iterator[Batch], again: deque[Batch]) -> Rows:
        running: dict[Future[list[Row]], Batch] = {}
        exhausted = False
        while True:
            while not exhausted and len(running) < WAITING_BATCHES * self._workers:
                batch = again.popleft() if again else next(batches, None)
                if batch is None:
                    exhausted = True
                else:
                    try:
                        with started_deaf_to_ctrl_c():
                            running[pool.submit(run_batch_alone, batch)] = batch
                    except BrokenProcessPool:
                        again.append(batch)
                        raise _WorkerDied(list(running.values())) from None
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            broken = [future for future in done if isinstance(future.exception(), BrokenProcessPool)]
            for future in done - set(broken):
                del running[future]
                yield future.result()
            if broken:
                raise _WorkerDied(list(running.values()))

    def _run_alone(self, batch: Batch) -> Rows:
        """Run a batch's runs one at a time, each in a process of its own."""
        for task in batch.tasks:
            single = batch.single(task)
            pool = self._pool(1)
            began_s = time.monotonic()
            try:
                with started_deaf_to_ctrl_c():
                    future = pool.submit(run_batch_alone, single)
                rows = future.result()
            except BrokenProcessPool:
                rows = [failed_row(single, why_died(time.monotonic() - began_s, batch.limits.task_s))]
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
                stop_processes(pool)
            yield rows


class _WorkerDied(Exception):  # noqa: N818 - an event inside this file
    """A worker died; `batches` were under way."""

    def __init__(self, batches: list[Batch]) -> None:
        super().__init__(f"{len(batches)} batches were under way")
        self.batches = batches


def why_died(took_s: float, task_s: float) -> str:
    """Say why a run took its worker with it."""
    if took_s >= task_s:
        return f"took longer than limits.task_s = {task_s:g} s"
    return "its worker died: a crash, or out of memory (limits.memory_mb)"


def stop_processes(pool: ProcessPoolExecutor) -> None:
    """End what still runs in a pool that is given up: a run in compiled code ends no other way."""
    for process in list((pool._processes or {}).values()):
        process.kill()
