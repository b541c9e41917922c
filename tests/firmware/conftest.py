"""Builds the firmware's core for this computer once a session."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from firmware_board import EmulatedFirmware, Firmware, NativeFirmware

LIBRARY = "PLANARM_NATIVE_LIBRARY"
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def native_firmware(tmp_path_factory: pytest.TempPathFactory) -> NativeFirmware:
    """The core under the undefined-behaviour sanitizer, or the library that test_firmware_sanitizers.py names."""
    if LIBRARY in os.environ:
        return NativeFirmware(Path(os.environ[LIBRARY]))
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed: the firmware's core cannot be built for this computer")
    out = tmp_path_factory.mktemp("firmware")
    build = [sys.executable, str(ROOT / "firmware" / "build.py"), "native", "--out", str(out)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return NativeFirmware(out / "libplanarm_firmware.so")


@pytest.fixture(scope="session")
def builder() -> ModuleType:
    """firmware/build.py as a module."""
    spec = importlib.util.spec_from_file_location("firmware_build", ROOT / "firmware" / "build.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look there for their annotations
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def orderer() -> ModuleType:
    """firmware/order.py as a module."""
    sys.path.insert(0, str(ROOT / "firmware"))
    try:
        return importlib.import_module("order")
    finally:
        sys.path.pop(0)


@pytest.fixture(scope="session")
def built_image(builder: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """`built_image(board)`: its image built by avr-gcc, once a session; its elf beside it."""
    if shutil.which("avr-gcc") is None:
        pytest.skip("avr-gcc is not installed (Debian: gcc-avr, avr-libc): no image is built")
    out = tmp_path_factory.mktemp("images")
    return functools.cache(lambda board: builder.build_image(out, board))


@pytest.fixture(scope="session")
def uno_image(built_image: Callable[[str], Path]) -> Path:
    """The Uno's image built by avr-gcc, its elf beside it."""
    return built_image("uno")


@pytest.fixture(scope="session")
def emulated_firmware() -> EmulatedFirmware:
    """The released image of the Uno on the emulated chip."""
    if LIBRARY in os.environ:
        pytest.skip("a library is looked at, not the chip")
    return EmulatedFirmware(ROOT / "firmware" / "release" / "uno.hex")


@pytest.fixture(params=["native", "emulated"])
def firmware(request: pytest.FixtureRequest) -> Firmware:
    """Both boards, one after the other."""
    chosen: Firmware = request.getfixturevalue(f"{request.param}_firmware")
    return chosen
