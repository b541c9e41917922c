"""A table of strings, for a terminal or for Markdown."""

from dataclasses import dataclass
from math import isfinite


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table of strings for a terminal or for Markdown."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int
    """How many leading columns hold words; the others hold numbers."""

    def markdown(self) -> str:
        """Return the table in Markdown."""
        ruler = ["---" if column < self.words else "---:" for column in range(len(self.header))]
        lines = [f"| {' | '.join(cells)} |" for cells in (self.header, ruler, *self.rows)]
        return f"## {self.title}\n\n" + "\n".join(lines)


def number(value: float, decimals: int) -> str:
    """Return a number with so many decimals, or "none" where there is none."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}" if isfinite(value) else "none"  # + 0.0: no minus zero
