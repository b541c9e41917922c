"""A program image: what a programmer would write into the flash of an ATmega328P."""

from __future__ import annotations

from dataclasses import dataclass

from planarm_sim.errors import ImageError
from planarm_sim.loader.symbols import Symbol

__all__ = ["ERASED", "FLASH_BYTES", "FlashBuilder", "Image"]

FLASH_BYTES = 32 * 1024
"""Flash of the ATmega328P (datasheet, 8.2)."""

ERASED = 0xFF
"""What an erased flash byte reads as."""


@dataclass(frozen=True, slots=True)
class Image:
    """Content of the whole flash.

    Attributes:
        flash: exactly FLASH_BYTES bytes; bytes that the file does not name are erased.
        used_bytes: number of bytes that the file names.
        source: where the image came from, for messages.
        symbols: its functions by address; only ELF files tell them.
    """

    flash: bytes
    used_bytes: int
    source: str
    symbols: tuple[Symbol, ...] = ()


class FlashBuilder:
    """Collects the pieces of an image and refuses what does not fit or lies on another piece."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._flash = bytearray([ERASED]) * FLASH_BYTES
        self._owner: list[str | None] = [None] * FLASH_BYTES

    def place(self, address: int, data: bytes, place: str) -> None:
        """Put `data` at byte `address`.

        Args:
            address: first byte address in flash.
            data: the bytes.
            place: where in the file they stand ("line 7", "section .text"), for messages.

        Raises:
            ImageError: outside the flash, or over bytes placed before.
        """
        end = address + len(data)
        if address < 0 or end > FLASH_BYTES:
            raise ImageError(
                f"{self._source}, {place}: bytes 0x{address:04X} to 0x{end - 1:04X} do not fit the flash of an "
                f"ATmega328P, which has {FLASH_BYTES} bytes and ends at 0x{FLASH_BYTES - 1:04X}"
            )
        for at in range(address, end):
            if (owner := self._owner[at]) is not None:
                raise ImageError(f"{self._source}, {place}: byte 0x{at:04X} was already given by {owner}")
        self._flash[address:end] = data
        self._owner[address:end] = [place] * len(data)

    def build(self, symbols: tuple[Symbol, ...] = ()) -> Image:
        """The finished image.

        Raises:
            ImageError: nothing was placed.
        """
        used = sum(owner is not None for owner in self._owner)
        if used == 0:
            raise ImageError(f"{self._source}: holds no program bytes")
        return Image(bytes(self._flash), used, self._source, symbols)
