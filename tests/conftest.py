"""Settings of all tests."""

import gc
import os
import signal
from collections.abc import Callable, Iterator

import pytest
from hypothesis import settings

# A clean checkout's verdict must not depend on the day: there Hypothesis draws the same examples each time.
settings.register_profile("same-examples", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("same-examples")

# Thousands of collected tests and Numba's trees live to the end: to look through them again and again for what is no
# longer used took a tenth of the time.
gc.set_threshold(50_000, 10, 10)


def pytest_collection_finish() -> None:
    gc.freeze()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--full", action="store_true", help="run campaigns at the size that proves the claim (minutes each)"
    )


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C as in a terminal, for this process and what it starts: a background shell or nohup lets it be ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def sized(pytestconfig: pytest.Config) -> Callable[[int, int], int]:
    """`sized(small, full)`: how many cases a campaign takes, the small slice unless `--full` is given."""
    full = bool(pytestconfig.getoption("--full"))
    return lambda small, whole: whole if full else small
