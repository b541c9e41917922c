"""A flash image that sends back every byte at 250,000 baud, assembled by hand: a board with another program on it."""

from pathlib import Path

UCSR0A, UCSR0B, UBRR0L, UDR0 = 0xC0, 0xC1, 0xC4, 0xC6  # ATmega328P datasheet, register summary


def ldi_r16(value: int) -> list[int]:
    return [0xE000 | (value & 0xF0) << 4 | (value & 0x0F)]


def sts_r16(address: int) -> list[int]:
    return [0x9300, address]


def lds_r16(address: int) -> list[int]:
    return [0x9100, address]


PROGRAM = [
    *ldi_r16(0x02), *sts_r16(UCSR0A),  # double speed
    *ldi_r16(7), *sts_r16(UBRR0L),  # 16 MHz / (8 (7 + 1)) = 250,000 baud
    *ldi_r16(0x18), *sts_r16(UCSR0B),  # receiver and transmitter on
    *lds_r16(UCSR0A), 0xFF07, 0xCFFC,  # wait: sbrs r16, RXC0; rjmp back to the lds
    *lds_r16(UDR0), *sts_r16(UDR0),  # every byte takes as long out as in, so the transmitter is free
    0xCFF7,  # rjmp back to wait
]  # fmt: skip


def write_echo_image(folder: Path) -> Path:
    """Write the program as Intel HEX and return its path."""
    data = b"".join(word.to_bytes(2, "little") for word in PROGRAM)
    lines = []
    for at in range(0, len(data), 16):
        record = bytes([len(data[at : at + 16]), at >> 8, at & 0xFF, 0]) + data[at : at + 16]
        lines.append(f":{record.hex().upper()}{-sum(record) & 0xFF:02X}")
    path = folder / "echo.hex"
    path.write_text("\n".join([*lines, ":00000001FF", ""]))
    return path
