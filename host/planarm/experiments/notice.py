"""What a long comparison tells its progress to."""

from collections.abc import Callable

Notice = Callable[[str, float], None]
"""Told a stage's name and the share of it that is done, 0 to 1."""


def silent(_stage: str, _share: float) -> None:
    """Take it, and tell nobody."""
