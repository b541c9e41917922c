"""CRC-16/MCRF4XX: published check value, the plain bitwise form, and its use as a chain."""

from hypothesis import given
from hypothesis import strategies as st

from planarm_wire.crc import crc16


def crc_bit_by_bit(data: bytes, crc: int) -> int:
    """The definition: reflected polynomial 0x8408, one bit after another."""
    for byte in data:
        for bit in range(8):
            mix = (crc ^ (byte >> bit)) & 1
            crc = (crc >> 1) ^ (0x8408 if mix else 0)
    return crc


def test_check_value_of_the_catalogue() -> None:
    # Catalogue of parametrised CRC algorithms (G. Cook), CRC-16/MCRF4XX: check 0x6F91, residue 0x0000.
    assert crc16(b"123456789") == 0x6F91
    assert crc16(b"123456789" + (0x6F91).to_bytes(2, "little")) == 0


@given(st.binary(max_size=64), st.integers(0, 0xFFFF))
def test_table_form_equals_the_definition(data: bytes, initial: int) -> None:
    assert crc16(data, initial) == crc_bit_by_bit(data, initial)


@given(st.binary(max_size=32), st.binary(max_size=32))
def test_it_continues_from_what_came_before(first: bytes, second: bytes) -> None:
    assert crc16(second, crc16(first)) == crc16(first + second)
