"""What a search answers; that there is no path is an answer, not an error."""

from dataclasses import dataclass
from enum import Enum

from planarm.search.path import Path


class SearchStatus(Enum):
    """How a search ended."""

    FOUND = "found"
    NO_PATH = "no path"
    START_BLOCKED = "start blocked"
    GOAL_BLOCKED = "goal blocked"
    ELBOW = "elbow cannot change"


@dataclass(frozen=True, slots=True)
class SearchResult:
    """The answer of a search."""

    status: SearchStatus
    reason: str
    """A sentence that says why there is no path; empty when there is one."""
    path: Path | None
    """The path, when the status is FOUND."""
    expanded: int
    """Nodes closed by the search."""
    generated: int
    """Entries put on its open list: nodes reached for the first time or by a shorter way."""
    plan_s: float
    """Wall time of the search in seconds, without compiling or loading its kernels, and without the bound."""
    bound_cm: float = 0.0
    """No path on this map with the same rule for moves is shorter (docs/planners.md: which paths); 0 for no path."""
    cost: float | None = None
    """Where the objective is not the length: sum over the moves, rad of joint travel or s at the joints' top speeds."""

    note: str = ""
    """A sentence that says in what the path is less than was asked for; empty when in nothing."""

    @property
    def gap(self) -> float:
        """By what share the path is longer than the bound: no path is better by more."""
        if self.path is None or self.bound_cm <= 0.0:
            return 0.0
        return max(0.0, self.path.length_cm / self.bound_cm - 1.0)
