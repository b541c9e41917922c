"""Results and SREG of arithmetic and logic, over all operands, against the Instruction Set Manual's formulas.

Every formula below is the manual's Boolean formula for the instruction, on NumPy arrays of all operand pairs.
"""

import numpy as np
import pytest

from planarm_sim.cpu.chip import Chip, StopCause
from sim_chip.avr_assembler import assemble

D, R = (a.ravel() for a in np.meshgrid(np.arange(256), np.arange(256), indexing="ij"))
STARTS = (0x00, 0xFF, 0x01, 0x02, 0xFE)  # SREG before: both values of every flag, C and Z apart


def bit(value: np.ndarray, number: int) -> np.ndarray:
    return (value >> number) & 1


def sreg(start: int, h=None, v=None, n=None, z=None, c=None, result=None) -> np.ndarray:
    """SREG after: what a formula gives, with S = N xor V; what is None stays as it was."""
    n = bit(result, 7) if n is None else n
    z = result == 0 if z is None else z
    v = np.zeros_like(D[: len(n)]) if v is None else v
    after = np.full(len(n), start & 0xC0)
    for place, flag in ((5, h), (4, n ^ v), (3, v), (2, n), (1, z), (0, c)):
        after |= ((start >> place) & 1 if flag is None else flag.astype(int)) << place
    return after


def addition(start: int, carry: int) -> tuple[np.ndarray, np.ndarray]:
    x = (D + R + carry) & 0xFF
    carries = (D & R) | (R & ~x) | (~x & D)
    v = (bit(D, 7) & bit(R, 7) & (1 - bit(x, 7))) | ((1 - bit(D, 7)) & (1 - bit(R, 7)) & bit(x, 7))
    return x, sreg(start, h=bit(carries, 3), v=v, c=bit(carries, 7), result=x)


def subtraction(start: int, carry: int, sticky_zero: bool) -> tuple[np.ndarray, np.ndarray]:
    x = (D - R - carry) & 0xFF
    borrows = (~D & R) | (R & x) | (x & ~D)
    v = (bit(D, 7) & (1 - bit(R, 7)) & (1 - bit(x, 7))) | ((1 - bit(D, 7)) & bit(R, 7) & bit(x, 7))
    z = (x == 0) & ((start >> 1) & 1 == 1) if sticky_zero else x == 0
    return x, sreg(start, h=bit(borrows, 3), v=v, z=z, c=bit(borrows, 7), result=x)


def logic(start: int, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return x, sreg(start, result=x)


EXPECTED = {
    "add": lambda s: addition(s, 0),
    "adc": lambda s: addition(s, s & 1),
    "sub": lambda s: subtraction(s, 0, False),
    "sbc": lambda s: subtraction(s, s & 1, True),
    "cp": lambda s: (D, subtraction(s, 0, False)[1]),
    "cpc": lambda s: (D, subtraction(s, s & 1, True)[1]),
    "and": lambda s: logic(s, D & R),
    "or": lambda s: logic(s, D | R),
    "eor": lambda s: logic(s, D ^ R),
}
SWEEP = """
        ldi r26, 0          ; X = 0x100
        ldi r27, 1
loop:   mov r18, r16
        out 0x3F, r20
        {} r18, r17
        in r19, 0x3F
        st X+, r18
        st X+, r19
        inc r17
        brne loop
        break
"""


def stored_for_all_pairs(chip: Chip, start: int, columns: int) -> np.ndarray:
    """What the program's loop stores, a row for each column, for all pairs: r16 (D) slow and r17 (R) fast."""
    rows = []
    for d in range(256):
        chip.pc = 0
        chip.registers[16] = d
        chip.registers[17] = 0
        chip.registers[20] = start
        assert chip.run_to(chip.cycle + 10_000) is StopCause.BREAK
        rows.append(chip.sram[: 256 * columns].copy())
    return np.concatenate(rows).reshape(-1, columns).astype(int).T


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("instruction", EXPECTED)
def test_two_operands_over_all_pairs(instruction, start):
    result, flags = stored_for_all_pairs(Chip(assemble(SWEEP.format(instruction))), start, 2)
    expected_result, expected_flags = EXPECTED[instruction](start)
    np.testing.assert_array_equal(result, expected_result)
    np.testing.assert_array_equal(flags, expected_flags)


IMMEDIATE = {"cpi": "cp", "sbci": "sbc", "subi": "sub", "ori": "or", "andi": "and"}


@pytest.mark.parametrize("instruction", IMMEDIATE)
def test_constants_act_as_registers_do(instruction):
    source = "".join(
        f"out 0x3F, r20\nmov r18, r16\n{instruction} r18, {k}\nin r19, 0x3F\nst X+, r18\nst X+, r19\n"
        for k in range(256)
    )
    chip = Chip(assemble("ldi r26, 0\nldi r27, 1\n" + source + "break"))
    for start in (0x00, 0x03):
        expected = EXPECTED[IMMEDIATE[instruction]](start)
        for d in (0, 1, 0x0F, 0x7F, 0x80, 0xFF):
            chip.pc = 0
            chip.registers[16] = d
            chip.registers[20] = start
            assert chip.run_to(chip.cycle + 10_000) is StopCause.BREAK
            pairs = chip.sram[:512].reshape(-1, 2).astype(int)
            np.testing.assert_array_equal(pairs[:, 0], expected[0].reshape(256, 256)[d])
            np.testing.assert_array_equal(pairs[:, 1], expected[1].reshape(256, 256)[d])


A = np.arange(256)


def one_operand(instruction: str, start: int) -> tuple[np.ndarray, np.ndarray]:
    carry = start & 1
    if instruction == "com":
        x = 0xFF - A
        return x, sreg(start, c=np.ones_like(A), result=x)
    if instruction == "neg":
        x = -A & 0xFF
        return x, sreg(start, h=bit(x, 3) | bit(A, 3), v=(x == 0x80).astype(int), c=x != 0, result=x)
    if instruction == "inc":
        x = (A + 1) & 0xFF
        return x, sreg(start, v=(x == 0x80).astype(int), result=x)
    if instruction == "dec":
        x = (A - 1) & 0xFF
        return x, sreg(start, v=(x == 0x7F).astype(int), result=x)
    if instruction == "swap":
        return (A << 4 | A >> 4) & 0xFF, np.full(256, start)
    x = {"lsr": A >> 1, "ror": A >> 1 | carry << 7, "asr": A >> 1 | A & 0x80}[instruction]
    return x, sreg(start, v=bit(x, 7) ^ bit(A, 0), c=bit(A, 0), result=x)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("instruction", ["com", "neg", "inc", "dec", "swap", "lsr", "ror", "asr"])
def test_one_operand_over_all_values(instruction, start):
    chip = Chip(assemble(SWEEP.replace("{} r18, r17", f"{instruction} r18").replace("mov r18, r16", "mov r18, r17")))
    chip.registers[20] = start
    assert chip.run_to(10_000) is StopCause.BREAK
    pairs = chip.sram[:512].reshape(-1, 2).astype(int)
    expected_result, expected_flags = one_operand(instruction, start)
    np.testing.assert_array_equal(pairs[:, 0], expected_result)
    np.testing.assert_array_equal(pairs[:, 1], expected_flags)


PRODUCT = (
    SWEEP.replace("st X+, r18", "st X+, r0")
    .replace("mov r18, r16", "mov r18, r16")
    .replace("st X+, r19", "st X+, r1\n        st X+, r19")
)


@pytest.mark.parametrize("start", (0x00, 0xFF))
@pytest.mark.parametrize("instruction", ["mul", "muls", "mulsu", "fmul", "fmuls", "fmulsu"])
def test_products_over_all_pairs(instruction, start):
    # FMUL* shift the 16-bit product left by one; C is the product's bit 15 before the shift, Z of the result.
    chip = Chip(assemble(PRODUCT.format(instruction)))
    low, high, flags = stored_for_all_pairs(chip, start, 3)
    signed_d = np.where(D > 127, D - 256, D) if instruction not in ("mul", "fmul") else D
    signed_r = np.where(R > 127, R - 256, R) if instruction in ("muls", "fmuls") else R
    product = (signed_d * signed_r) & 0xFFFF
    result = product << 1 & 0xFFFF if instruction.startswith("f") else product
    np.testing.assert_array_equal(low | high << 8, result)
    np.testing.assert_array_equal(flags, (start & ~3) | (result == 0) << 1 | product >> 15)


@pytest.mark.parametrize("instruction", ["adiw", "sbiw"])
@pytest.mark.parametrize("constant", [0, 1, 2, 31, 63])
def test_word_arithmetic_over_all_values(instruction, constant):
    # For each high byte r25 = r16, all low bytes; V and C by the manual's formulas for ADIW and SBIW.
    body = f"mov r24, r17\nmov r25, r16\nout 0x3F, r20\n{instruction} r24, {constant}\nin r19, 0x3F\n"
    body += "st X+, r24\nst X+, r25\nst X+, r19\n"
    chip = Chip(assemble("ldi r26, 0\nldi r27, 1\nloop:\n" + body + "inc r17\nbrne loop\nbreak"))
    low, high_after, flags = stored_for_all_pairs(chip, 0xE0, 3)
    before = D << 8 | R
    after = (before + constant if instruction == "adiw" else before - constant) & 0xFFFF
    was, now = bit(before, 15), bit(after, 15)
    v, c = ((1 - was) & now, was & (1 - now)) if instruction == "adiw" else (was & (1 - now), (1 - was) & now)
    np.testing.assert_array_equal(low | high_after << 8, after)
    np.testing.assert_array_equal(flags, 0xE0 | (now ^ v) << 4 | v << 3 | now << 2 | (after == 0) << 1 | c)
