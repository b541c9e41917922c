"""The pytest plugin: an emulated Uno as a fixture, and what it did kept when its test fails.

::

    @pytest.mark.uno(firmware="blink.hex")
    def test_blinks(uno):
        uno.run(seconds=1)
        assert len(uno.edges("D13")) == 2

The emulator is imported when a fixture asks for it, so that the plugin costs other test runs nothing.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from planarm_sim.bench import Bench
    from planarm_sim.board import Uno

__all__ = ["Artefacts", "artefacts_of", "bench", "make_uno", "uno"]

MARKER = (
    "uno(firmware=FILE, **settings): the program of the fixture `uno`, Intel HEX or ELF, relative to the test's file "
    "or to the root directory; settings as Uno.from_file takes them (baud=, bootloader=, ...)"
)

BENCH_MARKER = (
    "bench(drivers=[{driver, step, direction, ...}], rig=RIG, faults=FILE): what stands around the board of `bench`; "
    "each driver as planarm_sim.drivers.wiring_of takes it, the rig a planarm_sim.Rig"
)


class Artefacts:
    """What the fixtures of one test can tell when it fails: files, written into a folder of the test's own.

    Attributes:
        writers: by file name, who writes it.
    """

    def __init__(self) -> None:
        self.writers: dict[str, Callable[[Path], None]] = {}

    def add(self, name: str, write: Callable[[Path], None]) -> None:
        """Have `write` called with the path of the file `name` should the test fail."""
        self.writers[name] = write

    def keep(self, folder: Path) -> list[str]:
        """Write all of them; returns the names of those that had something to write."""
        if self.writers:
            folder.mkdir(parents=True, exist_ok=True)
        for name, write in self.writers.items():
            (folder / name).unlink(missing_ok=True)  # an older run's
            write(folder / name)
        return [name for name in self.writers if (folder / name).exists()]


_ARTEFACTS = pytest.StashKey[Artefacts]()


def artefacts_of(node: pytest.Item) -> Artefacts:
    """The artefacts of a test; other fixtures that emulate add theirs here."""
    return node.stash.setdefault(_ARTEFACTS, Artefacts())


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options that choose program and folder."""
    group = parser.getgroup("uno", "emulated Arduino Uno")
    group.addoption("--uno-firmware", metavar="FILE", help="program of the fixture `uno` for tests that name none")
    group.addoption("--uno-artefacts", metavar="DIR", help="where the boards of failed tests leave what they did")
    parser.addini("uno_firmware", "program of the fixture `uno` for tests that name none", default="")
    parser.addini("uno_artefacts", "where the boards of failed tests leave what they did", default="uno-artefacts")


def pytest_configure(config: pytest.Config) -> None:
    """Tell pytest of the marker."""
    config.addinivalue_line("markers", MARKER)
    config.addinivalue_line("markers", BENCH_MARKER)


@pytest.fixture
def make_uno(request: pytest.FixtureRequest) -> Callable[..., Uno]:
    """A factory of boards: `make_uno("blink.hex", baud=9600)`; without a program, the one of marker or option."""
    artefacts = artefacts_of(request.node)
    made: list[Uno] = []

    def make(firmware: str | Path | None = None, **settings: Any) -> Uno:  # noqa: ANN401 - they are Uno.from_file's
        from planarm_sim.board import Uno  # noqa: PLC0415 - see the module's text

        chosen, defaults = _program_of(request)
        board = Uno.from_file(_found(firmware or chosen, request), **{**defaults, **settings})
        made.append(board)
        _keep_what_it_does(board, artefacts, "" if len(made) == 1 else f"-{len(made)}")
        return board

    return make


@pytest.fixture
def uno(make_uno: Callable[..., Uno]) -> Uno:
    """An emulated Uno at power-up, with the program of the marker `uno`, of --uno-firmware, or of `uno_firmware`."""
    return make_uno()


@pytest.fixture
def bench(uno: Uno, request: pytest.FixtureRequest) -> Bench:
    """The board of the fixture `uno` with drivers, motors and an arm around it, as the marker `bench` says.

    Let time pass by the bench: `bench.run(seconds=1)`. When the test fails, what the arm did is kept as bench.json and
    motion.csv.
    """
    from planarm_sim.bench import Bench  # noqa: PLC0415 - see the module's text
    from planarm_sim.drivers import wiring_of  # noqa: PLC0415
    from planarm_sim.faults import inject, load_schedule  # noqa: PLC0415
    from planarm_sim.plant import desk_arm  # noqa: PLC0415

    marker = request.node.get_closest_marker("bench")
    settings = dict(marker.kwargs) if marker is not None else {}
    drivers = [wiring_of(**entry) for entry in settings.pop("drivers", ())]
    if not drivers:
        raise pytest.UsageError(
            f"{request.node.nodeid} asks for a bench, and nothing says which drivers are on it: mark the test with "
            '@pytest.mark.bench(drivers=[{"driver": "a4988", "step": "D2", "direction": "D5"}])'
        )
    rig, faults = settings.pop("rig", None), settings.pop("faults", None)
    if settings:
        raise pytest.UsageError(f"{request.node.nodeid}: the marker bench does not know {', '.join(settings)}")
    made = Bench(uno, rig or desk_arm(len(drivers)), drivers)
    if faults is not None:
        inject(made, load_schedule(_found(faults, request)))
    artefacts = artefacts_of(request.node)
    artefacts.add("bench.json", made.write_report)
    artefacts.add("motion.csv", made.write_motion)
    return made


def _program_of(request: pytest.FixtureRequest) -> tuple[str, dict[str, Any]]:
    marker = request.node.get_closest_marker("uno")
    settings = dict(marker.kwargs) if marker is not None else {}
    firmware = settings.pop("firmware", None)
    if firmware is None:
        firmware = request.config.getoption("--uno-firmware") or request.config.getini("uno_firmware")
    return str(firmware or ""), settings


def _found(firmware: str | Path, request: pytest.FixtureRequest) -> Path:
    """The program's path: as it is, beside the test's file, or below the root directory."""
    if not str(firmware):
        raise pytest.UsageError(
            f"{request.node.nodeid} asks for an Uno, and nothing says what it runs: mark the test with "
            "@pytest.mark.uno(firmware=FILE), or give --uno-firmware FILE, or set uno_firmware in the configuration"
        )
    places = [request.path.parent / firmware, request.config.rootpath / firmware, Path(firmware)]
    return next((place for place in places if place.exists()), Path(firmware))


def _keep_what_it_does(board: Uno, artefacts: Artefacts, suffix: str) -> None:
    from planarm_sim.recording import TRACED_PINS, write_profile  # noqa: PLC0415 - see the module's text
    from planarm_sim.trace import write_serial_log  # noqa: PLC0415

    artefacts.add(f"pins{suffix}.vcd", lambda path: board.write_vcd(path, TRACED_PINS))

    def profile(path: Path) -> None:
        if board.is_observed:
            write_profile(path, board.insight())

    artefacts.add(f"profile{suffix}.json", profile)
    artefacts.add(f"serial{suffix}.csv", lambda path: write_serial_log(path, board.serial.log))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Keep what the boards of a failed test did, and tell in its report where."""
    report = yield
    artefacts = item.stash.get(_ARTEFACTS, None)
    if report.failed and call.when != "teardown" and artefacts is not None:
        folder = _folder_of(item)
        if names := artefacts.keep(folder):
            report.sections.append(("emulated Uno", f"{', '.join(names)} kept in {folder}"))
    return report


def _folder_of(item: pytest.Item) -> Path:
    config = item.config
    chosen = config.getoption("--uno-artefacts") or config.getini("uno_artefacts")
    top = Path(chosen)
    if not top.is_absolute():
        top = (config.invocation_params.dir if config.getoption("--uno-artefacts") else config.rootpath) / top
    return top / re.sub(r"[^\w.-]+", "_", item.nodeid).strip("_")
