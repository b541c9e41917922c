"""Loads what Numba's cache holds in a third of the time that Numba takes for it.

Two things that Numba does at every load are left until somebody needs them:

- Its registries say how to compile every function that Numba knows. Machine code needs none of them, unless it calls
  the run-time library, BLAS or LAPACK, whose doors Numba opens as it fills them; and they take half of a cached start.
  Whatever does compile fills them itself.
- Beside the machine code lies the same in LLVM's bitcode, for kernels that are compiled later and call this one. To
  read it takes twice as long as to load the machine code.

Both reach into parts of Numba that it does not document. Should a later Numba not have them, it loads as it likes.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache
from typing import Any

__all__ = ["load_at_once"]

_DOORS = (b"NRT_", b"numba_xx", b"numba_ez")
"""How the names of Numba's ways to its run-time library, BLAS and LAPACK begin."""


def load_at_once(numbas_cache: Any, fill_registries: Callable[[], None]) -> None:  # noqa: ANN401 - Numba has no types
    """Have a function's cache load compiled code without what only compiling needs; see above."""
    parts = ("_guard_against_spurious_io_errors", "_cache_file", "_index_key", "_impl")
    if not all(hasattr(numbas_cache, part) for part in parts):
        return

    def load_overload(signature: object, target_context: Any) -> object:  # noqa: ANN401
        loaded = None  # to be compiled; also when the guard lets an error of the disk pass
        with numbas_cache._guard_against_spurious_io_errors():
            saved = numbas_cache._cache_file.load(numbas_cache._index_key(signature, target_context.codegen()))
            if saved is not None:
                if not _is_plain(saved):
                    fill_registries()
                    target_context.refresh()
                loaded = _rebuilt(numbas_cache._impl, target_context, saved)
        return loaded

    numbas_cache.load_overload = load_overload


def _is_plain(saved: Any) -> bool:  # noqa: ANN401
    """Tell whether what Numba saved is machine code through none of the doors; False as well for what looks unknown."""
    match saved:
        case ((_, "object", (bytes(machine_code), _)), *_):
            return not any(name in machine_code for name in _DOORS)
    return False


def _rebuilt(implementation: Any, target_context: Any, saved: Any) -> object:  # noqa: ANN401
    """Do as Numba does with what it saved, but read bitcode only when another function is linked with it."""
    match saved:
        case ((name, "object", (bytes(machine_code), bytes(bitcode))), description, *rest):
            pass
        case _:
            return implementation.rebuild(target_context, saved)
    codegen = target_context.codegen()
    symbols = _symbols(codegen, description, machine_code)
    if symbols is None:
        return implementation.rebuild(target_context, saved)
    known, own = symbols
    known.update(own)  # as reading the bitcode would have told
    result = implementation.rebuild(
        target_context, ((name, "object", (machine_code, _no_bitcode())), description, *rest)
    )
    _read_when_linked(result.library, known, bitcode)
    return result


def _symbols(codegen: Any, description: Any, machine_code: bytes) -> tuple[set[str], set[str]] | None:  # noqa: ANN401
    """Return the names that Numba's engine knows, and those in the code by which it looks for a function.

    A function that is for others alone has no way in from Python. None: not this Numba.
    """
    known = getattr(getattr(codegen, "_engine", None), "_defined_symbols", None)
    names = ("llvm_func_name", "llvm_cpython_wrapper_name", "env_name")
    if not isinstance(known, set) or not all(hasattr(description, name) for name in names):
        return None
    if not hasattr(codegen._library_class, "_get_module_for_linking"):
        return None
    sought = {str(getattr(description, name)) for name in names}
    return known, {name for name in sought if name.encode() in machine_code}


def _read_when_linked(library: Any, known: set[str], bitcode: bytes) -> None:  # noqa: ANN401
    """Give a library its module for linking when that is asked for."""

    def read() -> Any:  # noqa: ANN401
        del library._get_module_for_linking  # the class has its own again
        library._shared_module = module = _llvm().parse_bitcode(bitcode)
        for named in (module.functions, module.global_variables):
            known.update(value.name for value in named if not value.is_declaration)
        return module

    library._get_module_for_linking = read


@cache
def _no_bitcode() -> bytes:
    """Return a module with nothing in it."""
    return bytes(_llvm().parse_assembly("").as_bitcode())


def _llvm() -> Any:  # noqa: ANN401
    return importlib.import_module("llvmlite.binding")  # Numba has imported it
