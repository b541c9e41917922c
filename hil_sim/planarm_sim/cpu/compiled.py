"""Compiles the emulator's kernels: without reference counts, and those that Python does not call only on demand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn, TypeVar, cast

import numpy as np

from planarm_wire import kernel_cache

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` as `planarm_wire.kernel_cache.bare_kernel` does: it must make no arrays."""
    return kernel_cache.bare_kernel(function)


def inner(function: F) -> F:
    """Compile `function` as `kernel` does, for other kernels alone: Python cannot call it.

    A cached start does not touch it: the code of the kernels that call it holds its own.
    """
    return cast("F", function if kernel_cache.is_switched_off() else InnerKernel(function, {}))


def inlined(function: F) -> F:
    """Compile `function` as `inner` does, and into each of its callers: for the few on the way of every access.

    An array is seven words to Numba, all of which are handed over at each call that is not inlined.
    """
    return cast("F", function if kernel_cache.is_switched_off() else InnerKernel(function, {"forceinline": True}))


class InnerKernel:
    """What Numba compiles when it meets the name in another kernel.

    Numba's wrapper that takes Python objects apart is left out: half of a small kernel's code.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, bool]) -> None:
        self._function = function
        self._options = {"no_cpython_wrapper": True, **options}
        self._compiled: Any = None

    @property
    def _numba_type_(self) -> object:
        """Numba's type of the compiled function, by which it finds it (numba.core.typing.typeof)."""
        if self._compiled is None:
            self._compiled = kernel(self._function)
            self._compiled.targetoptions.update(self._options)
        return self._compiled._numba_type_

    def __call__(self, *_arguments: object) -> NoReturn:
        """Refuse: there is no way in from Python."""
        raise TypeError(f"{self._function.__module__}.{self._function.__name__} is for kernels; make it a @kernel")


def constant(value: int) -> int:
    """Return `value` as a number for which Numba compiles no version of its own of the functions it is passed to."""
    return cast("int", np.int64(value))
