"""What is written in assembler of products, quotients and numbers of the wire, on the emulated chip.

Results, kept registers, cycles.
"""

from __future__ import annotations

import random
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from planarm_sim import Uno
from planarm_wire.messages import BAUD

EDGES = (0, 1, 2, 0xFF, 0x100, 0xFFFF, 1 << 16, 0xFFFFFF, 1 << 24, 2**31 - 1, 2**31, 2**32 - 1, 0xFFFF0000, 0xFF00FF00)
DIVISORS = (1, 2, 3, 127, 128, 253, 254, 255)
KEPT = (1, *range(2, 18), 28, 29)  # by a call, avr-gcc's ABI; r1 is 0
STACK, SUM, BYTES, RING = 0x8FF - 16, 0x600, 0x620, 0x640
BACK = 0x3F00  # in words: erased flash, never executed
CALL_CYCLES = 4
ROUNDS = 60
# With call and return, as hal_math.h and hal_bytes.h of firmware/hal/uno tell them.
CYCLES = {
    "multiply": (51, 51),
    "multiply_low": (59, 59),
    "multiply_high": (60, 60),
    "multiply_saturated": (61, 64),
    "multiply_q16": (159, 162),
    "next_byte": (27, 44),
    "varuint": (75, 298),
    "add_to": (39, 39),
    "divide_q16": (91, 700),
}


class Chip:
    """A chip with the image, on which one function at a time is called."""

    def __init__(self, image: Path) -> None:
        listing = subprocess.run(
            ["avr-nm", "-C", str(image.with_suffix(".elf"))], capture_output=True, text=True, check=True
        ).stdout
        words = (line.split(" ", 2) for line in listing.splitlines())
        self._at = {name.partition("(")[0].removeprefix("hal::"): int(at, 16) // 2 for at, _, name in words}
        self._chip = Uno.from_hex(image, baud=BAUD)._chip
        self.chance = random.Random(1)
        self.cycles: set[int] = set()

    def call(self, name: str, **arguments: tuple[int, int]) -> None:
        """Call a function; each argument is (value, bytes), by its first register: r22=(value, 4)."""
        chip, state = self._chip, self._chip._state
        state[:32] = [self.chance.randrange(256) for _ in range(32)]
        state[1] = 0
        for register, (value, size) in arguments.items():
            first = int(register.removeprefix("r"))
            state[first : first + size] = list(value.to_bytes(size, "little"))
        kept = [int(state[number]) for number in KEPT]
        chip.sreg = 0
        chip.sp = STACK - 2
        self.write(STACK - 1, BACK.to_bytes(2, "big"))
        chip.pc = self._at[name]
        begin = chip.cycle
        while chip.pc != BACK:
            chip.run_to(chip.cycle + 1)
            assert chip.cycle < begin + 2000, f"{name} does not return"
        self.cycles.add(chip.cycle - begin + CALL_CYCLES)
        assert chip.sp == STACK
        assert [int(state[number]) for number in KEPT] == kept, f"{name} changes a register that calls keep"

    def register(self, first: int, size: int) -> int:
        return int.from_bytes(bytes(int(byte) for byte in self._chip._state[first : first + size]), "little")

    def write(self, address: int, data: bytes) -> None:
        self._chip._sram[address - 0x100 : address - 0x100 + len(data)] = list(data)

    def read(self, address: int, size: int) -> bytes:
        return bytes(self._chip._sram[address - 0x100 : address - 0x100 + size])

    def values(self) -> Iterator[tuple[int, int]]:
        """Pairs of 32 bits: the edges with each other, and random ones of every length."""
        yield from ((a, b) for a in EDGES for b in EDGES)
        for _ in range(ROUNDS):
            yield self.chance.getrandbits(self.chance.randint(1, 32)), self.chance.getrandbits(32)


@pytest.fixture
def chip(uno_image: Path) -> Chip:
    return Chip(uno_image)


def test_a_product_of_48_bits(chip: Chip) -> None:
    for a, b in chip.values():
        chip.call("multiply", r22=(a, 4), r20=(b & 0xFFFF, 2))
        assert chip.register(18, 4) << 16 | chip.register(22, 2) == a * (b & 0xFFFF)
    assert (min(chip.cycles), max(chip.cycles)) == CYCLES["multiply"]


@pytest.mark.parametrize(
    ("name", "b_bytes", "expected"),
    [
        ("multiply_low", 2, lambda a, b: a * b % 2**32),
        ("multiply_high", 2, lambda a, b: a * b >> 16),
        ("multiply_saturated", 2, lambda a, b: min(a * b, 2**32 - 1)),
        ("multiply_q16", 4, lambda a, b: min(a * b >> 16, 2**32 - 1)),
    ],
)
def test_products_of_32_bits(chip: Chip, name: str, b_bytes: int, expected: Callable[[int, int], int]) -> None:
    for a, whole in chip.values():
        b = whole % (1 << 8 * b_bytes)
        chip.call(name, r22=(a, 4), **{f"r{22 - b_bytes}": (b, b_bytes)})
        assert chip.register(22, 4) == expected(a, b), (a, b)
    low, high = CYCLES[name]
    assert low <= min(chip.cycles) <= max(chip.cycles) <= high


def test_sums_of_48_bits(chip: Chip) -> None:
    def stored(high: int, low: int) -> bytes:
        return high.to_bytes(4, "little") + low.to_bytes(2, "little")

    for high, term_high in chip.values():
        low, term_low = chip.chance.choice(EDGES) & 0xFFFF, chip.chance.getrandbits(16)
        chip.write(SUM, stored(high, low))
        chip.call("add_to", r24=(SUM, 2), r18=(term_high, 4), r22=(term_low, 2))
        total = ((high << 16 | low) + (term_high << 16 | term_low)) % 2**48
        assert chip.read(SUM, 6) == stored(total >> 16, total & 0xFFFF)
    assert (min(chip.cycles), max(chip.cycles)) == CYCLES["add_to"]


def test_a_quotient(chip: Chip) -> None:
    divisors = [*DIVISORS, *(chip.chance.randint(1, 255) for _ in range(10))]
    for b in divisors:
        for a in (*(edge for edge in EDGES if edge >> 16 < b), (b << 16) - 1, chip.chance.randrange(b << 16)):
            chip.call("divide_q16", r22=(a, 4), r20=(b, 1))
            assert chip.register(22, 4) == (a << 16) // b, (a, b)
    low, high = CYCLES["divide_q16"]
    assert low <= min(chip.cycles) <= max(chip.cycles) <= high


class Ring:
    """Bytes in a ring of 16, and the reader's state: where, how many are left, whether all went well."""

    SIZE = 16

    def __init__(self, chip: Chip, data: bytes, at: int) -> None:
        self._chip = chip
        ring = bytearray(chip.chance.randbytes(self.SIZE))
        for i, byte in enumerate(data):
            ring[(at + i) % self.SIZE] = byte
        chip.write(RING, bytes(ring))
        self.write(at, len(data), ok=True)

    def write(self, at: int, left: int, ok: bool) -> None:
        ends = RING.to_bytes(2, "little") + (RING + self.SIZE).to_bytes(2, "little")
        self._chip.write(BYTES, (RING + at).to_bytes(2, "little") + bytes([left, ok]) + ends)

    def state(self) -> tuple[int, int, bool]:
        told = self._chip.read(BYTES, 4)
        return int.from_bytes(told[:2], "little") - RING, told[2], bool(told[3])


def number_of(data: bytes) -> tuple[int, int] | None:
    """A varuint by docs/protocol.md: its value and its bytes; None when it is none."""
    value = 0
    for i, byte in enumerate(data[:5]):
        value |= (byte & 0x7F) << 7 * i
        if byte < 0x80:
            return (value, i + 1) if value < 2**32 and (byte or i == 0) else None
    return None


def test_bytes_of_a_ring_come_one_by_one_until_none_is_left(chip: Chip) -> None:
    for at in range(Ring.SIZE):
        data = chip.chance.randbytes(chip.chance.randint(0, 5))
        ring = Ring(chip, data, at)
        for i, byte in enumerate(data):
            chip.call("next_byte", r24=(BYTES, 2))
            assert chip.register(24, 1) == byte
            assert ring.state() == ((at + i + 1) % Ring.SIZE, len(data) - i - 1, True)
        for _ in range(2):
            chip.call("next_byte", r24=(BYTES, 2))
            assert (chip.register(24, 1), ring.state()[1:]) == (0, (0, False))
    low, high = CYCLES["next_byte"]
    assert low <= min(chip.cycles) <= max(chip.cycles) <= high


def encoded(value: int) -> bytes:
    data = bytearray()
    while value >= 0x80:
        data.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*data, value])


def test_numbers_of_the_wire(chip: Chip) -> None:
    chance = chip.chance
    cases = [encoded(a) + chance.randbytes(2) for a, _ in chip.values()]
    cases += [encoded(a)[:-1] for a in EDGES]  # cut short
    cases += [encoded(a)[:-1] + bytes([encoded(a)[-1] | 0x80, 0]) for a in EDGES]  # a needless byte
    cases += [bytes([0xFF] * n + [last]) for n in (4, 5, 6) for last in (0x0F, 0x10, 0x1F, 0x7F, 1, 0)]  # too large
    cases += [bytes(chance.choice((0x80, 0xFF, 1, 0)) for _ in range(7)) for _ in range(ROUNDS)]
    for data in cases:
        at = chance.randrange(Ring.SIZE)
        ring = Ring(chip, data, at)
        chip.call("varuint", r24=(BYTES, 2))
        told = number_of(data)
        if told is None:
            assert (chip.register(22, 4), ring.state()[1:]) == (0, (0, False)), data
        else:
            value, count = told
            assert chip.register(22, 4) == value, data
            assert ring.state() == ((at + count) % Ring.SIZE, len(data) - count, True), data
    low, high = CYCLES["varuint"]
    assert low <= min(chip.cycles) <= max(chip.cycles) <= high, (min(chip.cycles), max(chip.cycles))
