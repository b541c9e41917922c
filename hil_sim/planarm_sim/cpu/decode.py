"""Decodes the whole flash into one int64 per word, so that the CPU loop never takes an opcode apart.

The table below has one line per encoding of the AVR Instruction Set Manual that the ATmega328P executes
(AVRe+ without EIJMP, EICALL, ELPM, XCH, LAS, LAC, LAT and DES). All other words are UNDEFINED. A decoded word
holds four fields::

    bits  0..7   operation                      bits  8..15  d: register, I/O address or mask in SREG
    bits 16..31  r: register or mask of a bit   bits 32..    k: target, address, displacement, words to skip
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planarm_sim.cpu import opcodes as op
from planarm_sim.cpu.layout import CONSTANTS
from planarm_sim.cpu.registers import IO_START, READS_PLAIN, SRAM_START, SREG
from planarm_sim.cpu.tables import WRITES_WORD

FLASH_BYTES = 32 * 1024
FLASH_WORDS = FLASH_BYTES // 2
PC_MASK = FLASH_WORDS - 1
X, Y, Z = 26, 28, 30
ERASED_WORD, ERASED_RUNS_AS = 0xFFFF, 0xFFF7  # SBRS r31, 7 with its unused bit 3 cleared

_Words = NDArray[np.int64]

# operation, encoding as the manual prints it, pointer register of indirect accesses (MULX: kind of product)
_ENCODINGS: tuple[tuple[int, str, int], ...] = (
    (op.NOP, "0000 0000 0000 0000", 0),
    (op.MOVW, "0000 0001 dddd rrrr", 0),
    (op.MULX, "0000 0010 dddd rrrr", op.D_SIGNED | op.R_SIGNED),
    (op.MULX, "0000 0011 0ddd 0rrr", op.D_SIGNED),
    (op.MULX, "0000 0011 0ddd 1rrr", op.FRACTIONAL),
    (op.MULX, "0000 0011 1ddd 0rrr", op.D_SIGNED | op.R_SIGNED | op.FRACTIONAL),
    (op.MULX, "0000 0011 1ddd 1rrr", op.D_SIGNED | op.FRACTIONAL),
    (op.CPC, "0000 01rd dddd rrrr", 0),
    (op.SBC, "0000 10rd dddd rrrr", 0),
    (op.ADD, "0000 11rd dddd rrrr", 0),
    (op.CPSE, "0001 00rd dddd rrrr", 0),
    (op.CP, "0001 01rd dddd rrrr", 0),
    (op.SUB, "0001 10rd dddd rrrr", 0),
    (op.ADC, "0001 11rd dddd rrrr", 0),
    (op.AND, "0010 00rd dddd rrrr", 0),
    (op.EOR, "0010 01rd dddd rrrr", 0),
    (op.OR, "0010 10rd dddd rrrr", 0),
    (op.MOV, "0010 11rd dddd rrrr", 0),
    (op.CP, "0011 KKKK dddd KKKK", 0),
    (op.SBC, "0100 KKKK dddd KKKK", 0),
    (op.SUB, "0101 KKKK dddd KKKK", 0),
    (op.OR, "0110 KKKK dddd KKKK", 0),
    (op.AND, "0111 KKKK dddd KKKK", 0),
    (op.MOV, "1110 KKKK dddd KKKK", 0),
    (op.LDD, "10q0 qq0d dddd 0qqq", Z),
    (op.LDD, "10q0 qq0d dddd 1qqq", Y),
    (op.STD, "10q0 qq1d dddd 0qqq", Z),
    (op.STD, "10q0 qq1d dddd 1qqq", Y),
    (op.LDS, "1001 000d dddd 0000", 0),
    (op.LD_INC, "1001 000d dddd 0001", Z),
    (op.LD_DEC, "1001 000d dddd 0010", Z),
    (op.LPM, "1001 000d dddd 0100", 0),
    (op.LPM_INC, "1001 000d dddd 0101", 0),
    (op.LD_INC, "1001 000d dddd 1001", Y),
    (op.LD_DEC, "1001 000d dddd 1010", Y),
    (op.LDD, "1001 000d dddd 1100", X),
    (op.LD_INC, "1001 000d dddd 1101", X),
    (op.LD_DEC, "1001 000d dddd 1110", X),
    (op.POP, "1001 000d dddd 1111", 0),
    (op.STS, "1001 001d dddd 0000", 0),
    (op.ST_INC, "1001 001d dddd 0001", Z),
    (op.ST_DEC, "1001 001d dddd 0010", Z),
    (op.ST_INC, "1001 001d dddd 1001", Y),
    (op.ST_DEC, "1001 001d dddd 1010", Y),
    (op.STD, "1001 001d dddd 1100", X),
    (op.ST_INC, "1001 001d dddd 1101", X),
    (op.ST_DEC, "1001 001d dddd 1110", X),
    (op.PUSH, "1001 001d dddd 1111", 0),
    (op.COM, "1001 010d dddd 0000", 0),
    (op.NEG, "1001 010d dddd 0001", 0),
    (op.SWAP, "1001 010d dddd 0010", 0),
    (op.INC, "1001 010d dddd 0011", 0),
    (op.ASR, "1001 010d dddd 0101", 0),
    (op.LSR, "1001 010d dddd 0110", 0),
    (op.ROR, "1001 010d dddd 0111", 0),
    (op.DEC, "1001 010d dddd 1010", 0),
    (op.BSET, "1001 0100 0sss 1000", 0),
    (op.BCLR, "1001 0100 1sss 1000", 0),
    (op.RET, "1001 0101 0000 1000", 0),
    (op.RETI, "1001 0101 0001 1000", 0),
    (op.SLEEP, "1001 0101 1000 1000", 0),
    (op.BREAK, "1001 0101 1001 1000", 0),
    (op.WDR, "1001 0101 1010 1000", 0),
    (op.LPM, "1001 0101 1100 1000", 0),
    (op.SPM, "1001 0101 1110 1000", 0),
    (op.IJMP, "1001 0100 0000 1001", 0),
    (op.ICALL, "1001 0101 0000 1001", 0),
    (op.JUMP3, "1001 010k kkkk 110k", 0),
    (op.CALL, "1001 010k kkkk 111k", 0),
    (op.ADIW, "1001 0110 KKdd KKKK", 0),
    (op.SBIW, "1001 0111 KKdd KKKK", 0),
    (op.CBI, "1001 1000 AAAA Abbb", 0),
    (op.SBIC, "1001 1001 AAAA Abbb", 0),
    (op.SBI, "1001 1010 AAAA Abbb", 0),
    (op.SBIS, "1001 1011 AAAA Abbb", 0),
    (op.MUL, "1001 11rd dddd rrrr", 0),
    (op.IN, "1011 0AAd dddd AAAA", 0),
    (op.OUT, "1011 1AAr rrrr AAAA", 0),
    (op.JUMP2, "1100 kkkk kkkk kkkk", 0),
    (op.RCALL, "1101 kkkk kkkk kkkk", 0),
    (op.BRBS, "1111 00kk kkkk ksss", 0),
    (op.BRBC, "1111 01kk kkkk ksss", 0),
    (op.BLD, "1111 100d dddd 0bbb", 0),
    (op.BST, "1111 101d dddd 0bbb", 0),
    (op.SBRC, "1111 110d dddd 0bbb", 0),
    (op.SBRS, "1111 111d dddd 0bbb", 0),
)
_TWO_WORDS = (op.LDS, op.STS, op.JUMP3, op.CALL)
_SKIPS = (op.CPSE, op.SBIC, op.SBIS, op.SBRC, op.SBRS)
_WIDE = (op.ADIW, op.SBIW)
_RELATIVE = {op.JUMP2: 12, op.RCALL: 12, op.BRBS: 7, op.BRBC: 7}
_GOING_BACK = {op.JUMP2: op.JUMP2_BACK, op.BRBS: op.BRBS_BACK, op.BRBC: op.BRBC_BACK}
_ON_PLAIN_READS = {op.IN: op.MOV, op.SBIC: op.SBRC, op.SBIS: op.SBRS, op.LDS: op.LDS_PLAIN}
"""What to do instead with an I/O register that always reads as last written: it is one more register."""
_ON_PLAIN_WRITES = {op.OUT: op.MOV, op.STS: op.STS_PLAIN}
_SREG_FORMS = {op.IN: op.IN_SREG, op.OUT: op.OUT_SREG}


@dataclass(frozen=True, slots=True)
class Encoding:
    """One line of the table: which words it covers, and where its operands stand."""

    operation: int
    mask: int
    value: int
    fields: dict[str, tuple[int, ...]]
    pointer: int

    @classmethod
    def parse(cls, operation: int, pattern: str, pointer: int) -> Encoding:
        """Read a pattern of 0, 1 and operand letters, most significant bit first."""
        bits = pattern.replace(" ", "")
        fields: dict[str, tuple[int, ...]] = {}
        for place, letter in enumerate(bits):
            if letter not in "01":
                fields[letter] = (*fields.get(letter, ()), 15 - place)
        mask = int("".join("1" if b in "01" else "0" for b in bits), 2)
        value = int("".join("1" if b == "1" else "0" for b in bits), 2)
        return cls(operation, mask, value, fields, pointer)

    def field(self, letter: str, words: _Words) -> _Words:
        """Gather an operand's bits from `words`; 0 when the encoding has no such operand."""
        result = np.zeros_like(words)
        for place in self.fields.get(letter, ()):
            result = (result << 1) | ((words >> place) & 1)
        return result


ENCODINGS: tuple[Encoding, ...] = tuple(Encoding.parse(*line) for line in _ENCODINGS)


def decode(flash: NDArray[np.uint8], *, erased_runs: bool = False) -> NDArray[np.int64]:
    """Decode FLASH_BYTES of program memory; `erased_runs` as in `Program`.

    Returns FLASH_WORDS decoded words and three WRAP words, on which a program lands that runs or skips over the
    end of the flash; the program counter starts again at 0 there.
    """
    code = np.full(FLASH_WORDS + 3, op.WRAP, dtype=np.int64)
    code[:FLASH_WORDS] = decode_part(flash, np.arange(FLASH_WORDS), erased_runs=erased_runs)
    return code


def decode_part(flash: NDArray[np.uint8], part: _Words, *, erased_runs: bool) -> NDArray[np.int64]:
    """Decode the words at the addresses `part`, which follow one another and may go on at 0 behind the last."""
    memory = flash.view("<u2").astype(np.int64)
    places = np.append(part, (part[-1] + 1) & PC_MASK)
    words = memory[places]
    if erased_runs:
        words[words == ERASED_WORD] = ERASED_RUNS_AS
    following = memory[(places + 1) & PC_MASK]
    code = np.full(len(places), op.UNDEFINED, dtype=np.int64)
    length = np.ones(len(places), dtype=np.int64)
    skips = np.zeros(len(places), dtype=np.bool_)
    for encoding in ENCODINGS:
        at = np.nonzero((words & encoding.mask) == encoding.value)[0]
        d, r, k = _operands(encoding, words[at], following[at], places[at])
        operation, d, k = _specialised(encoding.operation, d, r, k)
        if encoding.operation in _GOING_BACK:
            operation[k <= places[at]] = _GOING_BACK[encoding.operation]
        code[at] = operation | (d << 8) | (r << 16) | (k << 32)
        if encoding.operation in _TWO_WORDS:
            length[at] = 2
        elif encoding.operation in _SKIPS:
            skips[at] = True
    at = np.nonzero(skips[:-1])[0]
    code[at] |= length[at + 1] << 32
    return code[:-1]


def _operands(encoding: Encoding, word: _Words, following: _Words, address: _Words) -> tuple[_Words, _Words, _Words]:
    """Return the fields d, r and k of the words that one encoding covers."""
    operation = encoding.operation
    d, r = encoding.field("d", word), encoding.field("r", word)
    k = encoding.field("k", word) | encoding.field("q", word)
    if "K" in encoding.fields:
        constant = encoding.field("K", word)
        d, r = (24 + 2 * d, constant) if operation in _WIDE else (d + 16, CONSTANTS + constant)
    elif operation == op.MOVW:
        d, r = 2 * d, 2 * r
    elif operation == op.MULX:
        d, r, k = d + 16, r + 16, np.full_like(word, encoding.pointer)
    elif encoding.pointer:
        r = np.full_like(word, encoding.pointer)
    elif operation in (op.LDS, op.STS):
        k = following
    elif operation in (op.JUMP3, op.CALL):
        k = following & PC_MASK
    elif operation in _RELATIVE:
        sign = 1 << (_RELATIVE[operation] - 1)
        k = (address + 1 + ((k ^ sign) - sign)) & PC_MASK
    if "s" in encoding.fields:
        d = 1 << encoding.field("s", word)
    if "b" in encoding.fields:
        r = 1 << encoding.field("b", word)
    if "A" in encoding.fields:
        io_address = encoding.field("A", word) + IO_START
        d, r = (d, io_address) if operation == op.IN else (io_address, r)
    return d, r, k


def _specialised(operation: int, d: _Words, r: _Words, k: _Words) -> tuple[_Words, _Words, _Words]:
    """Return operation, d and k, replaced where the data address that they name allows a shorter way."""
    address = {op.IN: r, op.LDS: k, op.STS: k}.get(operation, d)
    result = np.full_like(d, operation)
    if operation in _ON_PLAIN_READS:
        plain = address < SRAM_START
        plain[plain] = READS_PLAIN[address[plain]]
        result[plain] = _ON_PLAIN_READS[operation]
    if operation in _ON_PLAIN_WRITES:
        word = np.where(address < SRAM_START, WRITES_WORD[address % SRAM_START], -1)
        plain = word >= 0
        result[plain] = _ON_PLAIN_WRITES[operation]
        d, k = (np.where(plain, word, d), k) if operation == op.OUT else (d, np.where(plain, word, k))
    if operation in _SREG_FORMS:
        result[address == SREG] = _SREG_FORMS[operation]
    return result, d, k
