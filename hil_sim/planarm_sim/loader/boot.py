"""A boot loader beside a sketch in one flash, as the board maker burns it and as its users upload to it."""

from __future__ import annotations

from dataclasses import dataclass

from planarm_sim.errors import ImageError
from planarm_sim.loader.image import ERASED, FLASH_BYTES, Image

__all__ = ["BOOT_SECTION_BYTES", "BootImage", "join_bootloader"]

BOOT_SECTION_BYTES = (512, 1024, 2048, 4096)
"""Sizes of the boot section at the end of the flash that fuses can choose (ATmega328P datasheet, table 27-13)."""


@dataclass(frozen=True, slots=True)
class BootImage:
    """A flash with a boot loader.

    Attributes:
        image: content of the whole flash.
        section_bytes: the smallest boot section that holds the boot loader.
    """

    image: Image
    section_bytes: int


def join_bootloader(sketch: Image | None, bootloader: Image) -> BootImage:
    """Put a boot loader behind a sketch, or alone into an empty flash.

    Raises:
        ImageError: no boot section holds the boot loader, or the sketch reaches into it.
    """
    start = FLASH_BYTES - len(bootloader.flash.lstrip(bytes([ERASED])))
    section = next((size for size in BOOT_SECTION_BYTES if start >= FLASH_BYTES - size), None)
    if section is None:
        raise ImageError(
            f"{bootloader.source}: starts at 0x{start:04X}, before the largest boot section of an ATmega328P, which is "
            f"0x{FLASH_BYTES - BOOT_SECTION_BYTES[-1]:04X} to 0x{FLASH_BYTES - 1:04X}: not a boot loader for this chip"
        )
    if sketch is None:
        return BootImage(bootloader, section)
    limit = FLASH_BYTES - section
    end = len(sketch.flash.rstrip(bytes([ERASED])))
    if end > limit:
        raise ImageError(
            f"{sketch.source}: ends at 0x{end - 1:04X}, in the boot section, which {bootloader.source} takes from "
            f"0x{limit:04X} on; leave out the boot loader, or make the program smaller"
        )
    flash = sketch.flash[:limit] + bootloader.flash[limit:]
    used = sketch.used_bytes + bootloader.used_bytes
    symbols = sketch.symbols + bootloader.symbols
    return BootImage(Image(flash, used, f"{sketch.source} with {bootloader.source}", symbols), section)
