"""Writes a flash image to a board with avrdude, and asks the board that runs it who it is."""

import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from planarm.errors import LinkError

BOOTLOADER_BAUD = 115_200
LIMIT_S = 120.0
LAST_LINES = 3

Runner = Callable[[Sequence[str]], "subprocess.CompletedProcess[str]"]


def run_tool(words: Sequence[str]) -> "subprocess.CompletedProcess[str]":
    """Run a program to its end, and keep what it says."""
    return subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S, check=False)


def flash(
    port: str,
    image: Path,
    tool: str = "avrdude",
    run: Runner = run_tool,
    prepare: Callable[[str], None] = lambda _port: None,
) -> None:
    """Write `image` (Intel HEX) through the boot loader at `port`; avrdude reads it back and compares.

    Args:
        port: the board's device.
        image: the flash image.
        tool: avrdude.
        run: runs a program.
        prepare: has the board reset when the port is opened next.

    Raises:
        LinkError: there is no avrdude, or it failed; the message has its last words.
    """
    if "://" in port:
        raise LinkError(f"port {port}: flashing needs a board's own device, such as /dev/ttyACM0; give that")
    if not image.is_file():
        raise LinkError(f"{image}: no such flash image; leave --image out for the released one")
    found = shutil.which(tool)
    if found is None:
        raise LinkError(f"{tool} is not installed; install it (Debian: avrdude, macOS: brew install avrdude)")
    prepare(port)
    words = [found, "-q", "-p", "atmega328p", "-c", "arduino", "-P", port, "-b", str(BOOTLOADER_BAUD), "-D"]
    try:
        ended = run([*words, "-U", f"flash:w:{image}:i"])
    except subprocess.TimeoutExpired as error:
        raise LinkError(f"port {port}: avrdude did not end within {LIMIT_S:g} s; reset the board, try again") from error
    if ended.returncode != 0:
        said = "; ".join(line.strip() for line in ended.stderr.splitlines() if line.strip())
        raise LinkError(
            f"port {port}: avrdude could not write the image ({said[-300:]}); check that it is an Uno with its boot"
            " loader, and that no other program has the port"
        )
