"""The same batches on a Dask cluster (`pip install planarm[cluster]`)."""

from __future__ import annotations

import importlib
from collections import deque
from collections.abc import Iterator
from itertools import islice
from types import TracebackType
from typing import Any, Self

from planarm.campaign.engine import WAITING_BATCHES, Rows
from planarm.campaign.task import Batch
from planarm.campaign.worker import failed_row, run_batch
from planarm.errors import UsageError


class DaskEngine:
    """Workers of a Dask cluster; use it as a context manager.

    Args:
        address: the scheduler's, like tcp://HOST:8786.

    Raises:
        UsageError: dask.distributed is not installed, or no scheduler answers there.
    """

    def __init__(self, address: str) -> None:
        try:
            distributed = importlib.import_module("distributed")  # an optional package
        except ImportError as error:
            raise UsageError("--dask needs the package dask.distributed: pip install 'planarm[cluster]'") from error
        try:
            self._client: Any = distributed.Client(address, timeout="5s")
        except (OSError, ValueError) as error:
            raise UsageError(f"--dask {address}: no Dask scheduler answers there ({error})") from error
        self._died = distributed.KilledWorker
        self._as_completed = distributed.as_completed

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()

    def run(self, batches: Iterator[Batch]) -> Rows:
        """See `planarm.campaign.engine.Engine`.

        Dask itself gives the batch of a worker that dies to another one; after some deaths it gives the batch up, which
        is then split into single runs, and a single one that is given up is a failed row.
        """
        singles: deque[Batch] = deque()
        ahead = WAITING_BATCHES * max(len(self._client.nthreads()), 1)
        first = [self._submit(batch) for batch in islice(batches, ahead)]
        under_way = self._as_completed(first)
        try:
            for future in under_way:
                batch = future.planarm_batch
                if future.status == "finished":
                    yield future.result()
                elif not isinstance(future.exception(), self._died):
                    raise future.exception()
                elif len(batch.tasks) > 1:
                    singles.extend(batch.single(task) for task in batch.tasks)
                else:
                    reason = "its worker died each time: a crash, out of memory, or longer than limits.task_s"
                    yield [failed_row(batch, reason)]
                following = singles.popleft() if singles else next(batches, None)
                if following is not None:
                    under_way.add(self._submit(following))
                while singles:
                    under_way.add(self._submit(singles.popleft()))
        finally:
            self._client.cancel(list(under_way.futures))

    def _submit(self, batch: Batch) -> Any:  # noqa: ANN401 - dask.distributed has no types
        future = self._client.submit(run_batch, batch, pure=False)
        future.planarm_batch = batch
        return future
