"""Which words of a program are landmarks; see `kernels.py`."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.decode import FLASH_WORDS
from planarm_sim.cpu.layout import VECTORS
from planarm_sim.cpu.registers import SPL
from planarm_sim.insight.kernels import BREAKPOINT, FUNCTION, RETURN, SLEEPING, STACK, VECTOR

__all__ = ["landmarks", "roles_for_insight", "with_breakpoints"]

BOOT_STARTS = (0x3F00, 0x3E00, 0x3C00, 0x3800)
"""Word addresses of the boot sections, where a vector table may be, too (ATmega328P datasheet, table 27-13)."""


def roles_for_insight(code: NDArray[np.int64], functions: Iterable[int]) -> NDArray[np.int64]:
    """Give each word its role: bits of `kernels`, and above them the number of the function that begins there.

    Args:
        code: the decoded flash.
        functions: word addresses of the functions, in the order of their numbers.
    """
    operation = code & 0xFF
    roles = np.zeros(len(code), dtype=np.int64)
    roles[np.isin(operation, (op.RET, op.RETI))] |= RETURN
    roles[operation == op.SLEEP] |= SLEEPING
    roles[_moves_stack(code, operation)] |= STACK
    for start in (0, *BOOT_STARTS):
        roles[start + 2 : start + 2 * VECTORS : 2] |= VECTOR
    for number, address in enumerate(functions):
        roles[address] |= FUNCTION | number << 8
    roles[operation == op.UNDEFINED] = 0  # stops by itself
    return roles


def _moves_stack(code: NDArray[np.int64], operation: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The last of PUSHes in a row; writes to SPL, which avr-gcc writes after SPH; RCALL to the next word."""
    pushes = operation == op.PUSH
    last_push = pushes & ~np.append(pushes[1:], False)
    out = (operation == op.OUT) & ((code >> 8) & 0xFF == SPL)
    store = (operation == op.STS) & (code >> 32 == SPL)
    reserve = (operation == op.RCALL) & (code >> 32 == np.arange(len(code)) + 1)
    return np.asarray(last_push | out | store | reserve)


def with_breakpoints(roles: NDArray[np.int64], words: Iterable[int]) -> NDArray[np.int64]:
    """The same with breakpoints at some words."""
    result = roles.copy()
    result[[word for word in words if word < FLASH_WORDS]] |= BREAKPOINT
    return result


def landmarks(code: NDArray[np.int64], roles: NDArray[np.int64]) -> NDArray[np.int64]:
    """The decoded flash that stops at every word with a role."""
    return np.where(roles != 0, (code & ~0xFF) | op.UNDEFINED, code)
