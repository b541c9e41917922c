"""The first start on a machine: compile the parts of the flow side by side, each in a process of its own.

Numba compiles in one thread. The parts of `planarm.warm_up` share few kernels, so on several cores they take little
longer together than the longest alone. What they compile is in the cache when they are done; the command loads it.
"""

from __future__ import annotations

import os
import subprocess
import sys

PARTS = {"planarm": ("search", "motion"), "planarm_sim": ("emulator",)}


def compile_parts(packages: tuple[str, ...]) -> None:
    """Compile what warms up these packages, in parallel, and wait for it.

    A part that fails says nothing here: the command compiles what is still missing itself, and meets the same error
    where it can be told.
    """
    parts = [part for package in packages for part in PARTS[package]]
    if (os.cpu_count() or 1) == 1 or len(parts) == 1:
        return
    command = [sys.executable, "-m", "planarm.warm_up"]
    quiet = subprocess.DEVNULL
    running = [subprocess.Popen([*command, part], stdin=quiet, stdout=quiet, stderr=quiet) for part in parts]
    for process in running:
        process.wait()
