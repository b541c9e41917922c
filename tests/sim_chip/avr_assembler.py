"""A tiny assembler for the tests, written from the encodings of the AVR Instruction Set Manual.

One instruction a line, `label:` before it, `;` begins a comment. Operands are numbers in Python's notation
(I/O addresses as IN and OUT count them), registers r0 to r31, pointers such as `X+` or `Y+3`, and labels.
"""

import re
import struct

ONE_REGISTER = {"com": 0, "neg": 1, "swap": 2, "inc": 3, "asr": 5, "lsr": 6, "ror": 7, "dec": 10}
TWO_REGISTERS = {"cpc": 0x0400, "sbc": 0x0800, "add": 0x0C00, "cpse": 0x1000, "cp": 0x1400, "sub": 0x1800}
TWO_REGISTERS |= {"adc": 0x1C00, "and": 0x2000, "eor": 0x2400, "or": 0x2800, "mov": 0x2C00, "mul": 0x9C00}
CONSTANT = {"cpi": 0x3000, "sbci": 0x4000, "subi": 0x5000, "ori": 0x6000, "andi": 0x7000, "ldi": 0xE000}
PLAIN = {"nop": 0, "ret": 0x9508, "reti": 0x9518, "sleep": 0x9588, "break": 0x9598, "wdr": 0x95A8, "spm": 0x95E8}
PLAIN |= {"ijmp": 0x9409, "icall": 0x9509}
PLAIN |= {f"se{f}": 0x9408 | n << 4 for n, f in enumerate("cznvshti")}
PLAIN |= {f"cl{f}": 0x9488 | n << 4 for n, f in enumerate("cznvshti")}
BIT_IO = {"cbi": 0x9800, "sbic": 0x9900, "sbi": 0x9A00, "sbis": 0x9B00}
BIT_REGISTER = {"bld": 0xF800, "bst": 0xFA00, "sbrc": 0xFC00, "sbrs": 0xFE00}
BRANCHES = {"brcs": 0xF000, "breq": 0xF001, "brmi": 0xF002, "brlt": 0xF004, "brcc": 0xF400, "brne": 0xF401}
BRANCHES |= {"brpl": 0xF402, "brge": 0xF404}
POINTERS = {"X": 0x900C, "X+": 0x900D, "-X": 0x900E, "Y+": 0x9009, "-Y": 0x900A, "Z+": 0x9001, "-Z": 0x9002}
HIGH_PRODUCTS = {"mulsu": 0x0300, "fmul": 0x0308, "fmuls": 0x0380, "fmulsu": 0x0388}
LONG = {"lds", "sts", "jmp", "call"}


def assemble(source: str) -> bytes:
    """Return the program's bytes; `.org N` places what follows at word address N."""
    lines = []
    labels: dict[str, int] = {}
    place = 0
    for raw in source.splitlines():
        line = raw.split(";")[0].strip()
        while match := re.match(r"(\w+):\s*", line):
            labels[match[1]] = place
            line = line[match.end() :]
        if line.startswith(".org"):
            place = int(line.split()[1], 0)
        elif line:
            mnemonic, _, rest = line.partition(" ")
            lines.append((place, mnemonic.lower(), [o.strip() for o in rest.split(",")] if rest.strip() else []))
            place += len(lines[-1][2]) if mnemonic == ".word" else 2 if mnemonic in LONG else 1
    image = [0] * place
    for place, mnemonic, operands in lines:
        words = encode(mnemonic, operands, place, labels)
        image[place : place + len(words)] = words
    return struct.pack(f"<{len(image)}H", *image)


def encode(mnemonic: str, operands: list[str], place: int, labels: dict[str, int]) -> list[int]:
    def value(text: str) -> int:
        return labels[text] if text in labels else int(text, 0)

    def register(text: str) -> int:
        return int(text.removeprefix("r"))

    def relative(text: str, bits: int) -> int:
        return (value(text) - place - 1) & ((1 << bits) - 1)

    if mnemonic == ".word":
        return [value(o) for o in operands]
    if mnemonic in PLAIN or (mnemonic == "lpm" and not operands):
        return [PLAIN.get(mnemonic, 0x95C8)]
    first = operands[0]
    if mnemonic in ONE_REGISTER:
        return [0x9400 | register(first) << 4 | ONE_REGISTER[mnemonic]]
    if mnemonic in TWO_REGISTERS:
        d, r = register(first), register(operands[1])
        return [TWO_REGISTERS[mnemonic] | (r & 16) << 5 | d << 4 | (r & 15)]
    if mnemonic in CONSTANT:
        k = value(operands[1])
        return [CONSTANT[mnemonic] | (k & 0xF0) << 4 | (register(first) - 16) << 4 | (k & 15)]
    if mnemonic in HIGH_PRODUCTS:
        return [HIGH_PRODUCTS[mnemonic] | (register(first) - 16) << 4 | (register(operands[1]) - 16)]
    if mnemonic in ("muls", "movw"):
        d, r = register(first), register(operands[1])
        return [0x0200 | (d - 16) << 4 | (r - 16)] if mnemonic == "muls" else [0x0100 | d // 2 << 4 | r // 2]
    if mnemonic in ("adiw", "sbiw"):
        k = value(operands[1])
        return [
            (0x9600 if mnemonic == "adiw" else 0x9700) | (k & 0x30) << 2 | (register(first) - 24) // 2 << 4 | (k & 15)
        ]
    if mnemonic in ("bset", "bclr"):
        return [(0x9408 if mnemonic == "bset" else 0x9488) | value(first) << 4]
    if mnemonic in BIT_IO:
        return [BIT_IO[mnemonic] | value(first) << 3 | value(operands[1])]
    if mnemonic in BIT_REGISTER:
        return [BIT_REGISTER[mnemonic] | register(first) << 4 | value(operands[1])]
    if mnemonic in BRANCHES:
        return [BRANCHES[mnemonic] | relative(first, 7) << 3]
    if mnemonic in ("rjmp", "rcall"):
        return [(0xC000 if mnemonic == "rjmp" else 0xD000) | relative(first, 12)]
    if mnemonic in ("jmp", "call"):
        return [0x940C if mnemonic == "jmp" else 0x940E, value(first)]
    if mnemonic in ("in", "out"):
        d, a = (register(first), value(operands[1])) if mnemonic == "in" else (register(operands[1]), value(first))
        return [(0xB000 if mnemonic == "in" else 0xB800) | (a & 0x30) << 5 | d << 4 | (a & 15)]
    if mnemonic in ("push", "pop"):
        return [(0x920F if mnemonic == "push" else 0x900F) | register(first) << 4]
    if mnemonic == "lpm":
        return [(0x9005 if operands[1] == "Z+" else 0x9004) | register(first) << 4]
    if mnemonic in ("lds", "sts"):
        d, a = (register(first), value(operands[1])) if mnemonic == "lds" else (register(operands[1]), value(first))
        return [(0x9000 if mnemonic == "lds" else 0x9200) | d << 4, a]
    if mnemonic in ("ld", "st", "ldd", "std"):
        d, pointer = (register(first), operands[1]) if mnemonic in ("ld", "ldd") else (register(operands[1]), first)
        store = 0x0200 if mnemonic in ("st", "std") else 0
        if pointer in POINTERS:
            return [POINTERS[pointer] | store | d << 4]
        q = int(pointer[1:] or "0", 0)
        return [(0x8008 if pointer[0] == "Y" else 0x8000) | store | (q & 32) << 8 | (q & 24) << 7 | d << 4 | (q & 7)]
    raise ValueError(f"unknown instruction {mnemonic}")
