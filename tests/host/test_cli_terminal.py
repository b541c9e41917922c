"""A table's reader may leave, as head does; `planarm.cli.main` gives that its exit code."""

import os
import sys

import pytest

from planarm.cli.terminal import terminal


def test_a_reader_that_left_is_a_broken_pipe(monkeypatch):
    reading, writing = os.pipe()
    os.close(reading)
    gone = os.fdopen(writing, "w", buffering=1)
    monkeypatch.setattr(sys, "stdout", gone)
    with pytest.raises(BrokenPipeError):
        terminal().print("a line")
    with pytest.raises(BrokenPipeError):
        gone.close()  # what it still held
