"""Program files: Intel HEX and ELF to the content of the flash."""

from __future__ import annotations

from pathlib import Path

from planarm_sim.errors import ImageError
from planarm_sim.loader.boot import BootImage, join_bootloader
from planarm_sim.loader.elf import ELF_MAGIC, parse_elf
from planarm_sim.loader.image import FLASH_BYTES, Image
from planarm_sim.loader.intel_hex import parse_hex
from planarm_sim.loader.symbols import Symbol

__all__ = ["FLASH_BYTES", "BootImage", "Image", "Symbol", "join_bootloader", "load_elf", "load_hex", "load_image"]


def load_hex(path: str | Path) -> Image:
    """Load an Intel HEX file.

    Raises:
        ImageError: unreadable or damaged; see `intel_hex.parse_hex`.
    """
    data = _read(path)
    try:
        return parse_hex(data.decode("ascii"), str(path))
    except UnicodeDecodeError as error:
        raise ImageError(
            f"{path}: byte {error.start} is 0x{data[error.start]:02X}; Intel HEX is plain ASCII"
        ) from error


def load_elf(path: str | Path) -> Image:
    """Load an ELF executable.

    Raises:
        ImageError: unreadable, damaged or for another chip; see `elf.parse_elf`.
    """
    return parse_elf(_read(path), str(path))


def load_image(path: str | Path) -> Image:
    """Load a program file of either kind; its first bytes tell which.

    Raises:
        ImageError: unreadable or damaged.
    """
    return load_elf(path) if _read(path).startswith(ELF_MAGIC) else load_hex(path)


def _read(path: str | Path) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise ImageError(f"{path}: cannot be read: {error.strerror}; give an Intel HEX or ELF file") from error
