"""Kernels for other kernels alone: compiled when one that calls them is, and linked from the cache."""

import os
import subprocess
import sys
from pathlib import Path

LOOK = """
from arm_kernels.caller import answer
from arm_kernels.callee import twice
print(answer(1), sum(answer.stats.cache_hits.values()), twice._compiled is not None, end=" ")
print(sum(twice._compiled.stats.cache_hits.values()) if twice._compiled else "-")
"""


def run(package: Path) -> list[str]:
    """Run a program in a fresh interpreter; returns the answer, its hits, whether the callee was touched, its hits."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "PLANARM_"))}
    cache = {"PLANARM_CACHE_DIR": str(package.parent / "cache"), "PYTHONPATH": str(package.parent)}
    done = subprocess.run(
        [sys.executable, "-c", LOOK], env={**kept, **cache}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_an_inner_kernel_is_touched_only_to_compile_its_caller_and_comes_from_the_disk_then(tmp_path):
    package = tmp_path / "arm_kernels"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "callee.py").write_text(
        "from planarm_sim.cpu.compiled import inner\n\n\n@inner\ndef twice(x):\n    return 2 * x\n"
    )
    caller = package / "caller.py"
    caller.write_text(
        "from planarm_sim.cpu.compiled import kernel\nfrom arm_kernels.callee import twice\n\n\n"
        "@kernel\ndef answer(x):\n    return twice(x) + 1\n"
    )
    assert run(package) == ["3", "0", "True", "0"]
    assert run(package) == ["3", "1", "False", "-"]
    caller.write_text(caller.read_text().replace("+ 1", "+ 2"))
    assert run(package) == ["4", "0", "True", "1"]
    assert run(package) == ["4", "1", "False", "-"]
