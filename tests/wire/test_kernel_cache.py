"""The kernel cache never serves stale code, works from a read-only install, and says when it is cold."""

import os
import stat
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import pytest

from planarm_wire import kernel_cache

WIRE_FOLDER = Path(kernel_cache.__file__).parents[1]

# What a fresh interpreter does with the package below: is it cold, the kernel's answer, and how many times the
# kernel came from the disk cache.
PROGRAM = """
import sys
import time
from planarm_wire.kernel_cache import is_cold
cold = is_cold("arm_kernels")
numba_loaded = "numba" in sys.modules
from arm_kernels.caller import answer
value = answer(1)
hits = sum(getattr(answer, "stats").cache_hits.values()) if hasattr(answer, "stats") else -1
print(cold, numba_loaded, value, hits, is_cold("arm_kernels"))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package whose kernel calls another file's kernel, which freezes a constant from a third file."""
    folder = tmp_path / "install" / "arm_kernels"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "caller.py").write_text(
        "from planarm_wire.kernel_cache import kernel\n"
        "from arm_kernels.callee import twice\n\n\n"
        "@kernel\ndef answer(x):\n    return twice(x) + 1\n"
    )
    (folder / "callee.py").write_text(
        "from planarm_wire.kernel_cache import kernel\nfrom . import (\n    constants,\n)\n\n"
        "FACTOR = constants.FACTOR\n\n\n@kernel\ndef twice(x):\n    return FACTOR * x\n"
    )
    (folder / "constants.py").write_text("FACTOR = 2\n")
    (folder / "bystander.py").write_text("TEXT = 'no kernel here'\n")
    return folder


def run(package: Path, cache: Path, program: str = PROGRAM, **settings: str) -> list[str]:
    """Run a program in a fresh interpreter and return its words."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "PLANARM_", "XDG_"))}
    settings.setdefault("PLANARM_CACHE_DIR", str(cache))
    path = os.pathsep.join((str(package.parent), str(WIRE_FOLDER)))
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**kept, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", **settings},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_an_edit_in_a_callee_or_its_constant_is_not_served_stale(package: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert run(package, cache) == ["True", "False", "3", "0", "False"]
    (package / "bystander.py").write_text("TEXT = 'edited, and no kernel is the wiser'\n")
    assert run(package, cache) == ["False", "False", "3", "1", "False"], "the second start comes from the disk"
    callee = package / "callee.py"
    callee.write_text(callee.read_text().replace("FACTOR * x", "FACTOR * x + 10"))
    assert run(package, cache) == ["True", "False", "13", "0", "False"]
    (package / "constants.py").write_text("FACTOR = 5\n")
    assert run(package, cache) == ["True", "False", "16", "0", "False"]


def test_an_edit_in_a_caller_leaves_its_callee_compiled(package: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    run(package, cache)
    caller = package / "caller.py"
    caller.write_text(caller.read_text().replace("+ 1", "+ 2"))
    assert run(package, cache) == ["False", "False", "4", "0", "False"]
    builds = {path.name: len(list(path.iterdir())) for path in (cache / "kernels").iterdir()}
    assert builds == {"arm_kernels.caller": 2, "arm_kernels.callee": 1}


def test_a_file_edited_while_the_process_runs_is_not_cached(package: Path, tmp_path: Path) -> None:
    later = time.time() + 3600
    os.utime(package / "constants.py", (later, later))
    assert run(package, tmp_path / "cache")[2] == "3"
    assert not list((tmp_path / "cache").rglob("*.nb*"))


def test_kernels_of_a_packages_own_file_follow_its_relative_imports(package: Path, tmp_path: Path) -> None:
    caller = package / "caller.py"
    (package / "__init__.py").write_text(caller.read_text().replace("arm_kernels.callee", ".callee"))
    caller.write_text("from arm_kernels import answer\n")
    assert run(package, tmp_path / "cache")[2] == "3"
    (package / "constants.py").write_text("FACTOR = 5\n")
    assert run(package, tmp_path / "cache")[2:4] == ["6", "0"]


def test_a_read_only_install_is_cached_for_the_user(package: Path, tmp_path: Path) -> None:
    before = sorted(p.relative_to(package) for p in package.rglob("*"))
    for path in (*package.iterdir(), package):
        path.chmod(path.stat().st_mode & ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH))
    try:
        run(package, tmp_path / "cache")
        assert run(package, tmp_path / "cache")[3] == "1"
        assert sorted(p.relative_to(package) for p in package.rglob("*")) == before, "nothing beside the sources"
    finally:
        package.chmod(0o755)


def test_kernels_do_not_import_scipys_algebra_until_one_needs_it(package: Path, tmp_path: Path) -> None:
    look = """
import sys
import arm_kernels.caller as caller
assert caller.answer(1) == 3
before = "scipy.linalg" in sys.modules or "scipy.linalg.cython_blas" in sys.modules
import numpy as np
from arm_kernels.callee import product
print(before, product(np.array([1.0, 2.0]), np.array([3.0, 4.0])), "scipy.linalg" in sys.modules)
"""
    pytest.importorskip("scipy")
    callee = package / "callee.py"
    callee.write_text(callee.read_text() + "\n\n@kernel\ndef product(a, b):\n    return a @ b\n")
    assert run(package, tmp_path / "cache", program=look) == ["False", "11.0", "True"]


def test_cached_bare_kernels_load_no_registries_until_one_needs_algebra(package: Path, tmp_path: Path) -> None:
    look = """
import sys
import numpy as np
from arm_kernels.bare import product, twice
assert twice(1) == 2
before = {"scipy.linalg", "scipy.linalg.cython_blas", "numba.np.arraymath"} & set(sys.modules) != set()
print(before, product(np.array([1.0, 2.0]), np.array([3.0, 4.0])), "numba.np.arraymath" in sys.modules)
"""
    pytest.importorskip("scipy")
    kernels = "@kernel\ndef twice(x):\n    return 2 * x\n\n\n@kernel\ndef product(a, b):\n    return a @ b\n"
    (package / "bare.py").write_text(f"from planarm_wire.kernel_cache import bare_kernel as kernel\n\n\n{kernels}")
    run(package, tmp_path / "cache", program=look)  # to compile, Numba fills its registries
    assert run(package, tmp_path / "cache", program=look) == ["False", "11.0", "True"]


def test_a_kernel_compiled_later_links_a_cached_one(package: Path, tmp_path: Path) -> None:
    """What lies beside the machine code for linking is read then, and not before."""
    look = """
import llvmlite.binding as llvm
from planarm_wire import kernel_cache
from arm_kernels.callee import twice
read, parse, empty = [], llvm.parse_bitcode, len(llvm.parse_assembly("").as_bitcode())
llvm.parse_bitcode = lambda code, context=None: read.append(len(code)) or parse(code, context)
assert twice(1) == 2
before = sum(length > empty for length in read)
from arm_kernels.caller import answer
print(answer(1), sum(twice.stats.cache_hits.values()), before, sum(length > empty for length in read) > before)
print(sum(answer.stats.cache_hits.values()))
"""
    for name in ("callee", "caller"):
        path = package / f"{name}.py"
        path.write_text(path.read_text().replace("import kernel", "import bare_kernel as kernel"))
    cache = tmp_path / "cache"
    run(package, cache, program=look)
    assert run(package, cache, program=look) == ["3", "1", "0", "False", "1"], "both are there: nothing is linked"
    caller = package / "caller.py"
    caller.write_text(caller.read_text().replace("+ 1", "+ 2"))
    assert run(package, cache, program=look) == ["4", "1", "0", "True", "0"]
    assert run(package, cache, program=look) == ["4", "1", "0", "False", "1"]


def test_numbas_version_is_the_same_asked_both_ways() -> None:
    numba = pytest.importorskip("numba")
    assert numba.__version__ == metadata.version("numba"), "else a warm cache is told to be cold"


def test_without_jit_the_plain_function_runs_and_nothing_is_written(package: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert run(package, cache, NUMBA_DISABLE_JIT="1") == ["False", "False", "3", "-1", "False"]
    assert not cache.exists()


def test_an_unwritable_cache_folder_falls_back_to_the_users_own_temporary_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "a_file"
    blocked.write_text("")  # a folder cannot be made below a file, not even by root
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    monkeypatch.setattr(kernel_cache, "_usual_folder", lambda: blocked / "planarm")
    monkeypatch.delenv("PLANARM_CACHE_DIR", raising=False)
    root = kernel_cache._user_root.__wrapped__
    folder = root()
    assert folder.parent == temporary
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    folder.chmod(0o777)  # anybody could have put a pickle there
    assert root() != folder


def test_a_named_folder_that_cannot_be_written_is_an_error_that_names_the_setting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a_file").write_text("")
    monkeypatch.setenv("PLANARM_CACHE_DIR", str(tmp_path / "a_file" / "cache"))
    with pytest.raises(OSError, match="PLANARM_CACHE_DIR names a folder that cannot be written"):
        kernel_cache._user_root.__wrapped__()


def test_the_platforms_cache_folder_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    expected = {
        "linux": tmp_path / "xdg" / "planarm",
        "darwin": tmp_path / "Library" / "Caches" / "planarm",
        "win32": tmp_path / "local" / "planarm" / "Cache",
    }
    for platform, folder in expected.items():
        monkeypatch.setattr("sys.platform", platform)
        assert kernel_cache._usual_folder() == folder


def test_only_the_latest_builds_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_cache, "_user_root", lambda: tmp_path)
    source = tmp_path / "small.py"
    source.write_text("")
    builds = tmp_path / "kernels" / "small"
    for age in range(kernel_cache.KEPT_BUILDS + 3):
        old = builds / f"{age:016x}"
        old.mkdir(parents=True)
        os.utime(old, (1000 - age, 1000 - age))
    (builds / "not_a_build").mkdir()
    folder = kernel_cache._prepared_folder.__wrapped__("small", source)
    left = {b.name for b in builds.iterdir()}
    assert folder.name in left
    assert left == {folder.name, "not_a_build", *(f"{age:016x}" for age in range(kernel_cache.KEPT_BUILDS - 1))}


def test_a_package_that_is_not_there_is_named() -> None:
    with pytest.raises(ModuleNotFoundError, match="no_such_package"):
        kernel_cache.is_cold("no_such_package")


def test_a_kernel_lets_other_threads_run_meanwhile(package: Path, tmp_path: Path) -> None:
    """It waits for what another thread writes; one that holds the interpreter would count to the end."""
    look = """
import threading
import numpy as np
from arm_kernels.waits import wait
MOST = 1_000_000_000
told = np.zeros(3, np.int64)
wait(told, 2, 1)
def tell():
    while not told[1]:
        pass
    told[0] = 1
thread = threading.Thread(target=tell)
thread.start()
print(wait(told, 2, MOST) < MOST)
"""
    kernel = "@kernel\ndef wait(told, others, most):\n    k = 0\n    while not told[0] and k < most:\n"
    body = "        k += 1\n        told[1 + k % others] = k\n    return k\n"
    for name in ("kernel", "bare_kernel"):
        head = f"from planarm_wire.kernel_cache import {name} as kernel\n\n\n"
        (package / "waits.py").write_text(head + kernel + body)
        assert run(package, tmp_path / "cache", program=look) == ["True"], name
