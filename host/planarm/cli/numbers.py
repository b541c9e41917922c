"""Numbers on the command line; what is none is told with what was given and what is expected."""

from __future__ import annotations

import argparse
from math import isfinite


def finite(text: str) -> float:
    """Return a number, no infinity and no NaN."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} given, a number expected")
    return value


def positive(text: str) -> float:
    """Return a number above 0."""
    value = finite(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} given, a number above 0 expected")
    return value


def whole(text: str) -> int:
    """Return a whole number."""
    try:
        return int(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} given, a whole number expected") from error


def count(text: str) -> int:
    """Return a whole number above 0."""
    value = whole(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text!r} given, a whole number above 0 expected")
    return value
