"""The core built for this computer under the address sanitizer, and that of a board with four joints.

A library under that sanitizer needs its runtime loaded before anything else, so a child process runs a part of the
firmware suite on it, and all of its tests that use the core with --full.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from firmware_board import Board, NativeFirmware, Schedule, end_motion, run_of, segment_of
from planarm_wire.messages import BOARDS, Fault, State

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
LIBRARY = "PLANARM_NATIVE_LIBRARY"  # conftest.py
SHORT = ("test_firmware_protocol.py", "test_firmware_outcomes.py", "-k", "protocol or quick_stop")
WHOLE = (
    "test_firmware_faults.py",
    "test_firmware_outcomes.py",
    "test_firmware_protocol.py",
    "test_firmware_steps.py",
    "test_firmware_settings.py",
    "test_firmware_stops.py",
    "test_firmware_stretch.py",
    "test_firmware_supervisor.py",
    "test_firmware_switches.py",
)


def test_the_core_under_the_address_sanitizer(
    builder: ModuleType, tmp_path: Path, sized: Callable[[int, int], int]
) -> None:
    try:
        library = builder.build_native(tmp_path, sanitizers="address,undefined")
    except builder.BuildError as error:
        pytest.skip(f"no address sanitizer here (Debian: libasan, with g++): {error}")
    found = subprocess.run(["g++", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    chosen = (SHORT, WHOLE)[sized(0, 1)]
    # The interpreter itself leaks by design.
    settings = {LIBRARY: str(library), "LD_PRELOAD": found.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", "--rootdir", str(ROOT), *chosen],
        env=os.environ | settings,
        capture_output=True,
        text=True,
        check=False,
        cwd=HERE,
    )
    assert done.returncode == 0, (done.stdout + done.stderr)[-6000:]


def test_four_joints_on_this_computer(builder: ModuleType, tmp_path: Path) -> None:
    # Joints that turn round, rest, crawl and run, each for itself: every step on its tick.
    wiring, chance = BOARDS["uno_four"], random.Random(4)
    segments = []
    for _ in range(40):
        moves = []
        for _ in range(wiring.joints):
            interval = chance.choice([wiring.min_interval_ticks + 20, 1500, 4000, 20_000, 50_000])
            steps = chance.randint(0, 197_000 // interval)
            moves.append(run_of(steps, first=1500, interval=interval, positive=chance.random() < 0.5))
        segments.append(segment_of(200_000, *moves, joints=wiring.joints))
    motion = end_motion(segments)
    board = Board(NativeFirmware(builder.build_native(tmp_path, "uno_four"), wiring))
    board.get_ready()
    status = board.stream(motion)
    assert (status.state, status.fault) == (State.READY, Fault.NONE)
    schedule = Schedule.of(motion)
    assert status.ledger.position_usteps == schedule.positions()
    begins = set()
    for joint, steps in enumerate(schedule.steps):
        rises = board.rises(joint)
        begins |= {rise - tick for rise, (tick, _) in zip(rises, steps, strict=True)}
    assert len(begins) == 1
