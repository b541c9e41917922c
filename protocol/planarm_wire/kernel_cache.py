"""Kernels compiled by Numba, cached on disk so that an edit never serves stale code.

Numba's own cache looks only at the file that holds a function. It misses an edit in a function called
from another file, an edit of a constant imported from another file (globals are frozen into the compiled
code), and it wants to write beside the sources, which a read-only install does not allow. Here the cache
of each module lives in a folder per user whose name is a hash of everything that can end up in the
module's compiled code:

- the module's source, and all files of its package or of `planarm_wire` that it imports, directly or not;
- the versions of Python and Numba, and the NUMBA_ settings of the environment (bounds checks, for one,
  change the code).

A file that is edited while a process runs is compiled for that process alone and not kept: its modules may have
been imported before the edit. A kernel may call and freeze what its module imports at the left margin; one that is
handed another as an argument would escape the hash, and the house has none.

A kernel lets go of Python's interpreter while it runs, so that a thread which streams is not held up by one that
plans. What a kernel writes to is its thread's own: arrays that its caller made, or `planarm.search.scratch`.

Folder: `PLANARM_CACHE_DIR` when set, else the user's cache folder (`XDG_CACHE_HOME` or `~/.cache`, on
macOS `~/Library/Caches`, on Windows `%LOCALAPPDATA%`), else, when that cannot be written, a folder of the
user's own below the system's temporary folder. The latest 16 builds of a module are kept.

Why it lives in `planarm_wire`: host and emulator both compile kernels, neither may import the other, and
the wire is the one package below both. Numba is imported here only, when the first kernel is decorated.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import os
import re
import shutil
import stat
import sys
import tempfile
import threading
import time
import types
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar, cast

from planarm_wire.kernel_cache_loading import load_at_once

F = TypeVar("F", bound=Callable[..., Any])

CACHE_DIR_VARIABLE = "PLANARM_CACHE_DIR"
KEPT_BUILDS = 16
_BLAS = "scipy.linalg.cython_blas"

_DECORATED = re.compile(rb"^@kernel$", re.M)
_KEY_NAME = re.compile(r"[0-9a-f]{16}")
# An import at the left margin: the module, then what it takes from it (one line, or a bracket over several).
_IMPORT = re.compile(rb"^(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]*))", re.M)
_NAME = re.compile(rb"[\w.]+")
_STARTED_NS = time.time_ns()
_config_lock = threading.Lock()


def kernel(function: F) -> F:
    """Compile `function` with `numba.njit` on its first call, cached on disk as this module describes.

    With NUMBA_DISABLE_JIT=1 the plain Python function is returned. Raises OSError when `PLANARM_CACHE_DIR`
    is set to a folder that cannot be written.
    """
    compiled: Any = _with_cache(function)
    if compiled is not function:
        _import_array_functions()
    return cast("F", compiled)


def _with_cache(function: F) -> F:
    numba: Any = _numba()
    config = numba.config
    if config.DISABLE_JIT:
        return function
    source = Path(function.__code__.co_filename)
    inside = "" if source.stem != "__init__" else ".__init__"  # a package's own file, see _module_name
    module = function.__module__ + inside
    if _edited_since_start(module, source):
        return cast("F", numba.njit(nogil=True)(function))
    folder = _prepared_folder(module, source)
    with _config_lock:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(folder)  # read by njit when it makes the function's cache, that is here
        try:
            # A wrapper for calls from C, which nothing here makes, would take a tenth of the time to compile.
            compiled = numba.njit(cache=True, no_cfunc_wrapper=True, nogil=True)(function)
        finally:
            config.CACHE_DIR = before
    return cast("F", compiled)


def bare_kernel(function: F) -> F:
    """As `kernel`, for a function that makes no arrays: without Numba's run-time library, and loaded at once.

    Numba counts references to every array that a function is given, with two atomic additions per array and call: more
    than most small kernels take for their work. Without its run-time library it does not.
    """
    compiled: Any = _with_cache(function)
    if compiled is not function:  # plain Python when the compiler is switched off
        compiled.targetoptions["_nrt"] = False
        load_at_once(compiled._cache, _import_array_functions)
    return cast("F", compiled)


def is_switched_off() -> bool:
    """Tell whether NUMBA_DISABLE_JIT is set: kernels are then plain Python."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


@functools.cache
def _edited_since_start(module: str, source: Path) -> bool:
    """Tell whether a file was written after this process began: what is compiled may then not be what it holds."""
    return any(path.stat().st_mtime_ns > _STARTED_NS for path in _closure(module, source).values())


@functools.cache
def _numba() -> types.ModuleType:
    """Import Numba, here, so that only users of kernels wait for it."""
    return importlib.import_module("numba")


@functools.cache
def _import_array_functions() -> None:
    """Import Numba's functions of arrays, which ask at once whether SciPy has a BLAS.

    To ask, they import scipy.linalg: a third of a second, for kernels of which none needs a BLAS. Where SciPy is
    installed an empty module stands for it meanwhile; a kernel that calls np.dot imports the real one when it is
    compiled.
    """
    needless = _BLAS not in sys.modules and importlib.util.find_spec(_BLAS.partition(".")[0]) is not None
    if needless:
        sys.modules[_BLAS] = types.ModuleType(_BLAS)
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        if needless:
            del sys.modules[_BLAS]


def is_cold(package: str) -> bool:
    """Tell whether most of the top-level `package`'s kernels, as they are now, were not compiled for this user yet.

    Imports neither Numba nor the package, so that a command can say that its first run takes longer.
    """
    if is_switched_off():
        return False
    folders = kernel_folders(package)
    compiled = sum(next(folder.rglob("*.nbi"), None) is not None for folder in folders.values())
    return 2 * compiled < len(folders)


def kernel_folders(package: str) -> dict[str, Path]:
    """Return, for each module of `package` that holds kernels, the folder for its compiled code; it may not exist.

    Raises:
        ModuleNotFoundError: there is no such package here.
    """
    found = {}
    for top in _package_folders(package):
        for path in sorted(top.rglob("*.py")):
            if _DECORATED.search(_text(path)):
                module = _module_name(package, top, path)
                found[module] = _folder(module, path)
    if not found:
        raise ModuleNotFoundError(f"there is no package {package!r} with kernels here", name=package)
    return found


@functools.cache
def _prepared_folder(module: str, source: Path) -> Path:
    """Make the module's folder, mark it as used now, and drop the oldest builds beyond KEPT_BUILDS."""
    folder = _folder(module, source)
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    builds = sorted((b for b in folder.parent.iterdir() if _KEY_NAME.fullmatch(b.name)), key=_mtime, reverse=True)
    for old in builds[KEPT_BUILDS:]:
        shutil.rmtree(old, ignore_errors=True)
    return folder


def _folder(module: str, source: Path) -> Path:
    return _user_root() / "kernels" / module / _key(module, source)


def _mtime(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except FileNotFoundError:  # another process removed it meanwhile
        return 0.0


def _key(module: str, source: Path) -> str:
    """Hash what can end up in the compiled code of `module`, whose file is `source`."""
    digest = hashlib.sha256()
    settings = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_"))
    digest.update(repr((sys.version, _numba_version(), settings)).encode())
    for name, path in sorted(_closure(module, source).items()):
        text = _text(path)
        digest.update(f"\n{name}\n{len(text)}\n".encode())
        digest.update(text)
    return digest.hexdigest()[:16]


@functools.cache
def _numba_version() -> str:
    """Return Numba's version; from itself when it is there, as to ask the install for it takes a dozen milliseconds."""
    loaded = sys.modules.get("numba")
    return str(loaded.__version__) if loaded is not None else metadata.version("numba")


@functools.cache
def _text(path: Path) -> bytes:
    return path.read_bytes()


@functools.cache
def _package_folders(package: str) -> list[Path]:
    """Return where the package's files are; nothing for a single module, a script or an unknown name."""
    if package in sys.modules:
        return [Path(folder) for folder in getattr(sys.modules[package], "__path__", ())]
    spec = importlib.util.find_spec(package)
    return [Path(folder) for folder in (spec.submodule_search_locations or ())] if spec else []


@functools.cache
def _closure(module: str, source: Path) -> dict[str, Path]:
    """Return the file, by dotted module name, of everything that can take part in the module's compiled code."""
    found = {module: source} if source.is_file() else {}
    waiting = list(found.items())
    while waiting:
        for imported in _imported_modules(*waiting.pop(), module.partition(".")[0]):
            if imported[0] not in found:
                found[imported[0]] = imported[1]
                waiting.append(imported)
    return found


def _module_name(package: str, folder: Path, path: Path) -> str:
    """Return a module's dotted name; a package's own file keeps `__init__`, so relative imports are plain."""
    return ".".join((package, *path.relative_to(folder).with_suffix("").parts))


@functools.cache
def _imported_modules(name: str, path: Path, package: str) -> tuple[tuple[str, Path], ...]:
    """Return the modules of `package` and of `planarm_wire`, with their files, that imports at the left margin name."""
    files: dict[str, Path] = {}
    for top in dict.fromkeys((package, "planarm_wire")):
        files |= _modules(top)
    named = dict.fromkeys(_read_imports(name, _text(path)))
    return tuple((imported, files[imported]) for imported in named if imported in files)


@functools.cache
def _modules(package: str) -> dict[str, Path]:
    """Return the files of a package by dotted module name, found once: to ask the disk for each name takes longer."""
    folders = [Path(__file__).parent] if package == "planarm_wire" else _package_folders(package)
    found: dict[str, Path] = {}
    for folder in folders:
        for path in folder.rglob("*.py"):
            found.setdefault(_module_name(package, folder, path), path)
    return found


def _read_imports(name: str, text: bytes) -> Iterator[str]:
    """Yield the dotted names that a module's imports may mean; some are no modules."""
    for base, names, plain in _IMPORT.findall(text):
        if plain:
            targets = [n.decode() for n in _NAME.findall(plain)]
        else:
            dots = len(base) - len(base.lstrip(b"."))
            parts = name.split(".")[:-dots] if dots else []
            module = ".".join((*parts, *filter(None, base.decode().split("."))))
            targets = [module, *(f"{module}.{n.decode()}" for n in _NAME.findall(names))]
        for target in targets:
            yield target
            yield f"{target}.__init__"


@functools.cache
def _user_root() -> Path:
    """Return planarm's writable cache folder for this user (see the module's text for the order)."""
    named = os.environ.get(CACHE_DIR_VARIABLE)
    if named:
        folder = Path(named).absolute()
        problem = _write_problem(folder)
        if problem is not None:
            raise OSError(
                problem.errno,
                f"{CACHE_DIR_VARIABLE} names a folder that cannot be written ({problem.strerror}); "
                f"set it to a writable folder, or unset it",
                str(folder),
            )
        return folder
    usual = _usual_folder()
    if usual is not None and _write_problem(usual) is None:
        return usual
    return _temporary_folder()


def _usual_folder() -> Path | None:
    """Return the platform's cache folder for planarm, or None when the user's home is not known."""
    try:
        home = Path.home()
    except RuntimeError:
        return None
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "planarm" / "Cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "planarm"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "planarm"


def _temporary_folder() -> Path:
    """Return a folder below the temporary folder that belongs to this user and to nobody else.

    The cache is unpickled by Numba, so a folder that another user prepared must not be read.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"planarm-cache-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    private = stat.S_ISDIR(status.st_mode) and status.st_uid == user and not status.st_mode & 0o022
    if (private or not hasattr(os, "getuid")) and _write_problem(folder) is None:
        return folder
    return Path(tempfile.mkdtemp(prefix="planarm-cache-"))


def _write_problem(folder: Path) -> OSError | None:
    """Try to make `folder` and to write in it; return what stands in the way, or None."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return None
    except OSError as problem:
        return problem
