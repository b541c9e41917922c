"""Whom bring-up talks with: a person at a terminal, or a test that looks at an emulated arm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from planarm.errors import UsageError

T = TypeVar("T")
MOST_TRIES = 5


class Person(Protocol):
    """Answers questions and is told things."""

    def ask(self, question: str, default: str) -> str:
        """Return the answer, `default` where nothing was said."""
        ...

    def tell(self, text: str) -> None:
        """Say something that needs no answer."""
        ...


def ask_until(person: Person, question: str, default: str, read: Callable[[str], T]) -> T:
    """Ask until the answer can be read.

    Args:
        person: who is asked.
        question: what.
        default: the answer where nothing is said.
        read: makes the value of the words; a ValueError says what is wrong with them.

    Raises:
        UsageError: five answers in a row could not be read.
    """
    for _ in range(MOST_TRIES):
        try:
            return read(person.ask(question, default))
        except ValueError as error:
            person.tell(f"  {error}")
    raise UsageError(f"{question}: {MOST_TRIES} answers could not be read; begin again with the numbers at hand")


def number(least: float, most: float) -> Callable[[str], float]:
    """Return what reads a number within limits."""

    def read(words: str) -> float:
        value = float(words)
        if not least <= value <= most:
            raise ValueError(f"{words} is not from {least:g} to {most:g}")
        return value

    return read


def numbers(counts: range, least: float, most: float) -> Callable[[str], tuple[float, ...]]:
    """Return what reads numbers, as many as `counts` has, with commas or blanks between."""
    one = number(least, most)
    wanted = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"

    def read(words: str) -> tuple[float, ...]:
        found = tuple(one(word) for word in words.replace(",", " ").split())
        if len(found) not in counts:
            raise ValueError(f"{len(found)} numbers given, {wanted} are needed, such as 20, 15")
        return found

    return read


def one_of(choices: Sequence[str]) -> Callable[[str], str]:
    """Return what reads one of a few words, or the beginning of one."""

    def read(words: str) -> str:
        fitting = [choice for choice in choices if choice.startswith(words.strip().lower())]
        if words.strip().lower() in choices:
            return words.strip().lower()
        if len(fitting) != 1 or not words.strip():
            raise ValueError(f"{words!r} is none of {', '.join(choices)}")
        return fitting[0]

    return read
