"""ELF32 executables for the AVR, as avr-gcc links them.

Layout: "Tool Interface Standard: Executable and Linking Format", version 1.2, 1995, book I. Machine number and
architecture flags are those of GNU binutils (EM_AVR = 83; the low seven bits of e_flags hold the AVR family,
5 for the ATmega328P and its relatives). Only what is loaded into flash is read: program headers of type PT_LOAD
by their load (physical) address. avr-gcc puts EEPROM, fuses, lock bits and signature at load addresses of
0x810000 and above; they are not program memory and are left to a programmer.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from planarm_sim.errors import ImageError
from planarm_sim.loader.image import FlashBuilder, Image
from planarm_sim.loader.symbols import Symbol, function_symbols

__all__ = ["ELF_MAGIC", "parse_elf"]

ELF_MAGIC = b"\x7fELF"
HEADER = struct.Struct("<4sBBBB8xHHIIIIIHHHHHH")
PROGRAM_HEADER = struct.Struct("<IIIIIIII")
SECTION_HEADER = struct.Struct("<IIIIIIIIII")

CLASS_32, LITTLE_ENDIAN, EXECUTABLE = 1, 1, 2
EM_AVR = 83
AVR_FAMILY_MASK, AVR5 = 0x7F, 5
PT_LOAD, SHT_SYMTAB, SHT_NOBITS = 1, 2, 8
NOT_FLASH = 0x810000
"""Load addresses from here on are EEPROM, fuses, lock bits and signature."""

DEVICE_SECTION = ".note.gnu.avr.deviceinfo"
DEVICES = (b"atmega328p", b"atmega328")
"""Parts with the same flash, registers and vectors; they differ in power consumption and signature."""


@dataclass(frozen=True, slots=True)
class _Section:
    name: str
    kind: int
    flags: int
    offset: int
    size: int
    link: int


def parse_elf(data: bytes, source: str) -> Image:
    """Read an ELF executable.

    Args:
        data: the file's content.
        source: the file's name, for messages.

    Raises:
        ImageError: not an AVR executable for this chip, cut off, empty, or larger than the flash; the message
            names the file and, where one is concerned, the section.
    """
    try:
        return _parse(data, source)
    except (struct.error, IndexError) as error:
        raise ImageError(f"{source}: the ELF file is cut off or damaged ({error})") from error


def _parse(data: bytes, source: str) -> Image:
    (magic, elf_class, byte_order, _, _, kind, machine, _, _, program_at, section_at, flags, _, program_size,
     program_count, section_size, section_count, names_index) = HEADER.unpack_from(data)  # fmt: skip
    if magic != ELF_MAGIC:
        raise ImageError(f"{source}: starts with {magic!r}, an ELF file starts with {ELF_MAGIC!r}")
    if (elf_class, byte_order, machine) != (CLASS_32, LITTLE_ENDIAN, EM_AVR):
        raise ImageError(
            f"{source}: ELF class {elf_class}, byte order {byte_order}, machine {machine}; an AVR program has "
            f"{CLASS_32}, {LITTLE_ENDIAN}, {EM_AVR}: build it with avr-gcc -mmcu=atmega328p"
        )
    if (family := flags & AVR_FAMILY_MASK) != AVR5:
        raise ImageError(f"{source}: built for AVR family {family}; the ATmega328P is of family {AVR5}")
    if kind != EXECUTABLE:
        raise ImageError(f"{source}: ELF type {kind}, not an executable ({EXECUTABLE}): link it first")
    sections = _sections(data, section_at, section_size, section_count, names_index)
    _check_device(data, sections, source)
    builder = FlashBuilder(source)
    for index in range(program_count):
        _load_segment(data, program_at + index * program_size, sections, builder, source)
    return builder.build(_symbols(data, sections))


def _symbols(data: bytes, sections: list[_Section]) -> tuple[Symbol, ...]:
    for section in sections:
        if section.kind == SHT_SYMTAB:
            names = sections[section.link]
            table = data[section.offset : section.offset + section.size]
            return function_symbols(
                table, data[names.offset : names.offset + names.size], [other.flags for other in sections]
            )
    return ()  # stripped


def _sections(data: bytes, at: int, size: int, count: int, names_index: int) -> list[_Section]:
    headers = [SECTION_HEADER.unpack_from(data, at + index * size) for index in range(count)]
    if not headers:
        return []
    names_at = headers[names_index][4]
    return [
        _Section(_string(data, names_at + name), kind, flags, offset, size if kind != SHT_NOBITS else 0, link)
        for name, kind, flags, _, offset, size, link, *_ in headers
    ]


def _string(data: bytes, at: int) -> str:
    return data[at:].split(b"\0", 1)[0].decode("ascii", "replace")


def _check_device(data: bytes, sections: list[_Section], source: str) -> None:
    """Refuse a relative with other registers or vectors, where the linker noted the part's name."""
    for section in sections:
        if section.name == DEVICE_SECTION:
            note = data[section.offset : section.offset + section.size]
            if not any(b"\0" + device + b"\0" in note for device in DEVICES):
                words = [word for word in note.split(b"\0") if len(word) > 4 and word.isalnum()]
                part = words[-1].decode("ascii", "replace") if words else "another part"
                raise ImageError(f"{source}, section {section.name}: built for {part}, not for an atmega328p")


def _load_segment(data: bytes, at: int, sections: list[_Section], builder: FlashBuilder, source: str) -> None:
    kind, offset, _, load_address, file_size, *_ = PROGRAM_HEADER.unpack_from(data, at)
    if kind != PT_LOAD or file_size == 0 or load_address >= NOT_FLASH:
        return
    content = data[offset : offset + file_size]
    names = [s.name for s in sections if s.size and offset <= s.offset and s.offset + s.size <= offset + file_size]
    place = "section " + ", ".join(names) if names else f"segment at 0x{load_address:04X}"
    if len(content) != file_size:
        raise ImageError(f"{source}, {place}: {file_size} bytes announced, {len(content)} in the file; it is cut off")
    builder.place(load_address, content, place)
