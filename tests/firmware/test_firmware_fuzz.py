"""libFuzzer on the core: bytes, frames, inputs and time in any order break no rule of the pins and do no harm."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from firmware_board import LEAD_TICKS, end_motion, run_of, segment_of
from planarm_wire.boards import Board as Wiring
from planarm_wire.codec import encode
from planarm_wire.messages import (
    BOARDS,
    EMERGENCY_CODE,
    HOLD_CODE,
    Config,
    Enable,
    Home,
    HostMessage,
    Move,
    Override,
    PinMap,
    Query,
    Resume,
    Segments,
    Start,
    Stop,
)

BUILD = Path(__file__).parents[2] / "firmware" / "build.py"
LINE, FRAME, TIME, INPUTS = range(4)


def record(kind: int, data: bytes) -> bytes:
    """One record of a script (firmware/fuzz/fuzz_line.cpp)."""
    return bytes([kind | len(data) << 2]) + data


def frame(message: HostMessage) -> bytes:
    code, payload = encode(message)
    return bytes([FRAME | len(payload) << 2, code]) + payload


def wait(ms: float) -> bytes:
    return bytes([TIME]) + int(ms * 16_000 / 64).to_bytes(2, "little")


def scripts(board: Wiring) -> list[bytes]:
    """A motion that is held, starved, stopped; homing; an emergency: where the fuzzer begins."""
    joints, least = board.joints, board.min_interval_ticks
    away = segment_of(
        60_000, run_of(40, interval=1300), run_of(50_000 // (least + 150), interval=least + 150), joints=joints
    )
    back = segment_of(60_000, run_of(40, interval=1300, positive=False), run_of(30, interval=1900), joints=joints)
    awake = frame(Enable(1)) + wait(25)
    moving = awake + frame(Segments(200, 200, 1, tuple(end_motion((away, back))))) + frame(Start(LEAD_TICKS))
    slow = segment_of(
        700_000,
        Move(2 * 7 + 1, 500, 70_000 << 8, 3 << 8),
        Move(2 * 5, 400, 150_000 << 8, -(9_000 << 8)),
        joints=joints,
    )
    return [
        awake + frame(Segments(200, 200, 1, tuple(end_motion((slow, away))))) + frame(Start(LEAD_TICKS)) + wait(60),
        moving + wait(30),
        moving + record(LINE, bytes([HOLD_CODE])) + wait(9) + frame(Resume()) + wait(9),
        moving + frame(Override(30)) + wait(9) + frame(Stop(1)) + wait(9) + frame(Query()),
        moving + wait(4) + record(LINE, bytes([EMERGENCY_CODE] * 3)) + wait(2),
        moving + wait(4) + frame(Segments(0, 0, 0, (segment_of(0, joints=joints),))) + wait(2),
        frame(Config(PinMap[board.pin_map.upper()], joints, 1, 0b1100, 0, 0, 56, (160_000,) * joints))
        + awake
        + frame(Home(0, 1, 4000, 160_000, 400, 100))
        + wait(20)
        + bytes([INPUTS, 1])
        + wait(20),
    ]


@pytest.mark.skipif(shutil.which("clang++") is None, reason="clang++ is not installed: no libFuzzer")
@pytest.mark.parametrize("board", [pytest.param(BOARDS[name], id=name) for name in ("uno", "uno_four")])
def test_no_input_breaks_a_rule(tmp_path: Path, sized: Callable[[int, int], int], board: Wiring) -> None:
    runs = sized(1500 if board.joints == 2 else 0, 300_000)
    if not runs:
        pytest.skip("clang takes ten seconds for a core: four joints with --full")
    command = [sys.executable, str(BUILD), "fuzz", "--board", board.name, "--out", str(tmp_path)]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    if "libclang_rt.fuzzer" in made.stderr:
        pytest.skip("clang++ has no libFuzzer here (Debian: libclang-rt-dev)")
    assert made.returncode == 0, made.stderr
    corpus = tmp_path / "corpus"
    corpus.mkdir()
    for number, script in enumerate(scripts(board)):
        (corpus / f"script_{number}").write_bytes(script)
    done = subprocess.run(
        [str(tmp_path / "fuzz_line"), str(corpus), f"-runs={runs}", "-seed=1", "-max_len=600", "-len_control=0"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]
