"""Compiles the chip's kernels without reference counts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from planarm_wire import kernel_cache

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` as `planarm_wire.kernel_cache.kernel` does, for a kernel that makes no arrays.

    Numba counts references to every array that a function is given, with two atomic additions per array and
    call: more than most of these kernels take for their work. Without its run-time library it does not.
    """
    compiled: Any = kernel_cache.kernel(function)
    if hasattr(compiled, "targetoptions"):  # plain Python when the compiler is switched off
        compiled.targetoptions["_nrt"] = False
    return cast("F", compiled)


def inlined(function: F) -> F:
    """Compile `function` as `kernel` does, and into each of its callers: for the few on the way of every access.

    An array is seven words to Numba, all of which are handed over at each call that is not inlined.
    """
    compiled: Any = kernel(function)
    if hasattr(compiled, "targetoptions"):
        compiled.targetoptions["forceinline"] = True
    return cast("F", compiled)


def constant(value: int) -> int:
    """Return `value` as a number for which Numba compiles no version of its own of the functions it is passed to."""
    return cast("int", np.int64(value))
