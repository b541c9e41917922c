"""Functions of an ELF executable by name, for profiles and debuggers.

Symbol table: "Tool Interface Standard: Executable and Linking Format", version 1.2, 1995, book I. Functions written in
assembler often carry no type; of untyped symbols the global ones in program sections count, without the marks
that the linker script of avr-gcc sets between sections.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

__all__ = ["Symbol", "function_symbols"]

SYMBOL = struct.Struct("<IIIBBH")
NO_TYPE, OBJECT_FUNCTION = 0, 2
LOCAL = 0
EXECUTABLE_SECTION = 4
MARK = re.compile(r"__(ctors|dtors|trampolines)_(start|end)|_?_?(etext|init|fini)\w*|__data_load_\w+|__.*_region_\w*")


@dataclass(frozen=True, slots=True)
class Symbol:
    """A function.

    Attributes:
        name: as the ELF file has it.
        address: byte address of its first instruction in flash.
        size: bytes; 0 where the file does not tell.
    """

    name: str
    address: int
    size: int


def function_symbols(table: bytes, names: bytes, section_flags: list[int]) -> tuple[Symbol, ...]:
    """Read a symbol table; one symbol for each address, in order of addresses.

    Args:
        table: content of the section of type SHT_SYMTAB.
        names: content of its string table.
        section_flags: sh_flags of every section.
    """
    found: dict[int, tuple[int, Symbol]] = {}
    for at in range(0, len(table) - SYMBOL.size + 1, SYMBOL.size):
        name_at, value, size, info, _, section = SYMBOL.unpack_from(table, at)
        kind, binding = info & 15, info >> 4
        if section >= len(section_flags) or not section_flags[section] & EXECUTABLE_SECTION:
            continue
        name = names[name_at:].split(b"\0", 1)[0].decode("ascii", "replace")
        if kind != OBJECT_FUNCTION and (kind != NO_TYPE or binding == LOCAL or MARK.fullmatch(name)):
            continue
        rank = 2 * (kind == OBJECT_FUNCTION) + (binding != LOCAL)  # of several names the most definite
        if value not in found or rank > found[value][0]:
            found[value] = (rank, Symbol(name, value, size))
    return tuple(symbol for _, (_, symbol) in sorted(found.items()))
