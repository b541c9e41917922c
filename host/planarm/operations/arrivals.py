"""Where obstacles come from while an arm moves: a list with times, or a file that somebody writes to meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from planarm.errors import SceneError
from planarm.scene import Obstacle
from planarm.scene.arrivals import Arrival, load_arrivals


class Listed:
    """Obstacles at given times."""

    def __init__(self, arrivals: Sequence[Arrival]) -> None:
        self._waiting = sorted(arrivals, key=lambda arrival: arrival.at_s)

    def new(self, motion_s: float) -> Sequence[Obstacle]:
        """Return those whose time has come."""
        come = [arrival.obstacle for arrival in self._waiting if arrival.at_s <= motion_s]
        self._waiting = self._waiting[len(come) :]
        return come


class Watched:
    """A file of obstacles, looked at each time it has changed; those that were added are new.

    A file that is missing is empty. One that cannot be read yet, as while it is being written, is looked at again.
    `problem` tells what was wrong the last time, empty when nothing was.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen: tuple[int, int] | None = None
        self._known: tuple[Obstacle, ...] = ()
        self.problem = ""

    def new(self, motion_s: float) -> Sequence[Obstacle]:
        """Return what the file holds and did not hold before; its `at_s` are not looked at."""
        try:
            state = self._path.stat()
        except FileNotFoundError:
            return ()
        if (state.st_mtime_ns, state.st_size) == self._seen:
            return ()
        try:
            found = tuple(arrival.obstacle for arrival in load_arrivals(self._path))
        except SceneError as error:
            self.problem = str(error)
            return ()
        self._seen, self.problem = (state.st_mtime_ns, state.st_size), ""
        added = [obstacle for obstacle in found if obstacle not in self._known]
        self._known = (*self._known, *added)
        return added
