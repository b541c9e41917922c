"""The same batches on a Dask cluster (`pip install planarm[cluster]`)."""

from __future__ import annotations

import importlib
import queue
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError
from itertools import islice
from types import TracebackType
from typing import Any, Self

from planarm.campaign.engine import WAITING_BATCHES, Rows
from planarm.campaign.task import Batch, Row
from planarm.campaign.worker import failed_row, run_batch
from planarm.errors import ClusterError, UsageError

LOOK_S = 1.0
"""Where nothing finishes, the workers are counted so often."""
ANSWER_S = 5.0
"""The scheduler has at least so long for its answer: a busy one takes seconds, with workers that are well."""


class DaskEngine:
    """Workers of a Dask cluster; use it as a context manager.

    Args:
        address: the scheduler's, like tcp://HOST:8786.
        patience_s: how long there may be no worker, or no answer from the scheduler (at least ANSWER_S).

    Raises:
        UsageError: dask.distributed is not installed, or no scheduler answers there.
    """

    def __init__(self, address: str, patience_s: float) -> None:
        try:
            distributed = importlib.import_module("distributed")  # an optional package
        except ImportError as error:
            raise UsageError("--dask needs the package dask.distributed: pip install 'planarm[cluster]'") from error
        try:
            self._client: Any = distributed.Client(address, timeout="5s")
        except (OSError, ValueError) as error:
            raise UsageError(f"--dask {address}: no Dask scheduler answers there ({error})") from error
        self._died = distributed.KilledWorker
        self._address = address
        self._patience_s = patience_s
        self._alive_s = time.monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()

    def run(self, batches: Iterator[Batch]) -> Rows:
        """See `planarm.campaign.engine.Engine`.

        Dask itself gives the batch of a worker that dies to another one; after some deaths it gives the batch up, and
        with it whatever waited for the same workers. What was given up is split into single runs; single ones that are
        given up are run alone in the end, one after the other, and one that is given up even so is a failed row.

        Raises:
            ClusterError: no worker was there for `patience_s`, or the scheduler is gone; what is finished was yielded.
        """
        self._alive_s = time.monotonic()
        at_once = WAITING_BATCHES * max(self._count_workers(), 1)
        given_up: list[Batch] = []
        yield from self._carry_out(batches, at_once, given_up)
        suspects: list[Batch] = []
        yield from self._carry_out(_singles(given_up), at_once, suspects)
        for suspect in suspects:
            guilty: list[Batch] = []
            yield from self._carry_out(iter([suspect]), 1, guilty)
            for batch in guilty:
                reason = "its worker died each time: a crash, out of memory, or longer than limits.task_s"
                yield [failed_row(batch, reason)]

    def _carry_out(self, batches: Iterator[Batch], at_once: int, given_up: list[Batch]) -> Rows:
        """Yield the rows of batches, some of which are on the cluster at once; append those that Dask gives up."""
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        under_way: dict[str, tuple[Any, Batch]] = {}

        def submit(following: Iterable[Batch]) -> None:
            for batch in following:
                future = self._client.submit(run_batch, batch, pure=False)
                under_way[future.key] = future, batch
                future.add_done_callback(done.put)

        submit(islice(batches, at_once))
        try:
            while under_way:
                key = self._next_done(done).key
                future, batch = under_way[key]
                rows = self._rows(future)
                del under_way[key]
                if rows is None:
                    given_up.append(batch)
                else:
                    yield rows
                submit(islice(batches, 1))
        finally:
            self._client.cancel([future for future, _ in under_way.values()])

    def _next_done(self, done: queue.SimpleQueue[Any]) -> Any:  # noqa: ANN401 - dask.distributed has no types
        """Wait for the next batch that is finished or given up, as long as there are workers."""
        while True:
            try:
                return done.get(timeout=min(LOOK_S, self._patience_s))
            except queue.Empty:
                self._look_at_workers()

    def _rows(self, future: Any) -> list[Row] | None:  # noqa: ANN401
        """Fetch a batch's rows, None where it was given up; a worker that dies with them has them computed again."""
        while not future.cancelled():
            try:
                rows: list[Row] = future.result(timeout=self._patience_s)
            except CancelledError:
                break
            except TimeoutError:
                self._look_at_workers()
            except self._died:
                return None
            else:
                self._alive_s = time.monotonic()
                return rows
        raise self._lost("the connection to its scheduler was lost")

    def _look_at_workers(self) -> None:
        """Go on waiting if there are workers, or were not long ago."""
        if self._count_workers():
            self._alive_s = time.monotonic()
        elif time.monotonic() - self._alive_s > self._patience_s:
            raise self._lost(f"it has had no worker for {self._patience_s:g} s (limits.cluster_s)")

    def _count_workers(self) -> int:
        answer_s = max(self._patience_s, ANSWER_S)
        try:
            return len(self._client.nthreads(callback_timeout=answer_s))
        except TimeoutError as error:
            reason = f"its scheduler has not answered for {answer_s:g} s (limits.cluster_s, at least {ANSWER_S:g})"
            raise self._lost(reason) from error
        except OSError as error:
            raise self._lost(f"its scheduler is gone ({error})") from error

    def _lost(self, reason: str) -> ClusterError:
        return ClusterError(
            f"--dask {self._address}: {reason}; finished runs are kept: start workers there, or another cluster, and"
            " go on with --resume"
        )


def _singles(batches: list[Batch]) -> Iterator[Batch]:
    """Yield the runs of some batches, each as a batch of its own."""
    return (batch.single(task) for batch in batches for task in batch.tasks)
