"""Builds the firmware's core for this computer once a session."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from firmware_board import EmulatedFirmware, Firmware, NativeFirmware

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def native_firmware(tmp_path_factory: pytest.TempPathFactory) -> NativeFirmware:
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed: the firmware's core cannot be built for this computer")
    out = tmp_path_factory.mktemp("firmware")
    build = [sys.executable, str(ROOT / "firmware" / "build.py"), "native", "--out", str(out)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return NativeFirmware(out / "libplanarm_firmware.so")


@pytest.fixture(scope="session")
def emulated_firmware() -> EmulatedFirmware:
    return EmulatedFirmware(ROOT / "firmware" / "release" / "uno.hex")


@pytest.fixture(params=["native", "emulated"])
def firmware(request: pytest.FixtureRequest) -> Firmware:
    """Both boards, one after the other."""
    chosen: Firmware = request.getfixturevalue(f"{request.param}_firmware")
    return chosen
