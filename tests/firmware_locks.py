"""How long a firmware image keeps interrupts off: the longest way through its listing from each CLI on, calls included.

Constants are followed through registers and flags, so a loop over the joints goes round once a joint, and a function
that is called with a joint's number goes that joint's way; where the way depends on what is not known, both are gone.
Cycles are the ATmega328P's (AVR instruction set manual, AVRe+).
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

TITLE = re.compile(r"^(?P<at>[0-9a-f]+) <(?P<name>.+)>:$")
LINE = re.compile(r"^ *(?P<at>[0-9a-f]+):\t(?P<name>\S+)\s*(?P<operands>[^;]*)")
RELATIVE = re.compile(r"^\.(?P<bytes>[+-]\d+)")

SKIPS, CALLS, JUMPS = ("cpse", "sbrc", "sbrs", "sbic", "sbis"), ("rcall", "call"), ("rjmp", "jmp")
COMPARES, WRITES_NONE = ("cp", "cpi", "cpc"), ("out", "sts", "st", "std", "push", "sbi", "cbi", "nop", "cli", *SKIPS)
PAIRS = ("movw", "adiw", "sbiw")
CYCLES = {
    **dict.fromkeys(("lds", "sts", "ld", "ldd", "st", "std", "push", "pop"), 2),
    **dict.fromkeys(("sbi", "cbi", "sbiw", "adiw", "mul", "rjmp"), 2),
    **dict.fromkeys(("lpm", "jmp", "rcall"), 3),
    **dict.fromkeys(("call", "ret"), 4),
}
ZERO = "r1"  # as the compiler has it
SREG = "0x3f"
NO_WAY = -1_000_000  # cycles of what does not come where it should


@dataclass(frozen=True)
class Instruction:
    at: int  # addresses are of bytes
    next: int
    function: str
    name: str
    operands: tuple[str, ...]

    @property
    def cycles(self) -> int:
        """Without what a branch or a skip takes on top when it is taken."""
        return CYCLES.get(self.name, 1)

    @property
    def is_branch(self) -> bool:
        return self.name.startswith("br")

    @property
    def target(self) -> int:
        """Where a branch, a jump or a call goes."""
        match = RELATIVE.match(self.operands[0])
        return self.next + int(match["bytes"]) if match else int(self.operands[0], 16)

    @property
    def ends_lock(self) -> bool:
        return self.name == "out" and self.operands[0] == SREG


@dataclass(frozen=True)
class Known:
    """What is known on a way: registers with constants, the flags Z and C, and where RET goes to."""

    registers: tuple[tuple[str, int], ...] = ((ZERO, 0),)
    zero: bool | None = None
    carry: bool | None = None
    calls: tuple[int, ...] = ()

    def value(self, operand: str) -> int | None:
        return dict(self.registers).get(operand) if operand.startswith("r") else int(operand, 16)

    def behind(self, one: Instruction) -> Known:
        """Behind an instruction that goes to the next one."""
        if one.name in WRITES_NONE or one.is_branch:
            return self
        old, new = dict(self.registers), dict(self.registers)
        first, second = (*one.operands, "", "")[:2]
        a, b = old.get(first), self.value(second) if re.fullmatch(r"r\d+|0x[0-9A-F]+", second) else None
        zero = carry = result = None
        if one.name in ("ldi", "mov"):
            result, zero, carry = b, self.zero, self.carry
        elif one.name == "dec" and a is not None:
            result, carry = (a - 1) % 256, self.carry
        elif one.name in ("subi", "cp", "cpi") and a is not None and b is not None:
            result, carry = (a - b) % 256, a < b
        elif one.name == "and" and first == second:
            result, carry = a, self.carry
        elif one.name == "lsr" and a is not None:
            result = a // 2
        elif one.name == "eor" and first == second:
            result = 0
        if result is not None and one.name not in ("ldi", "mov"):
            zero = result == 0
        if one.name not in COMPARES:
            for name in self._written(one):
                new.pop(name, None)
            if result is not None:
                new[first] = result
        return replace(self, registers=tuple(sorted(new.items())), zero=zero, carry=carry)

    @staticmethod
    def _written(one: Instruction) -> tuple[str, ...]:
        first = one.operands[0]
        if one.name == "mul":
            return ("r0", ZERO)
        if one.name in PAIRS:
            return (first, f"r{int(first[1:]) + 1}")
        return (first,)


class Listing:
    """The instructions of an ELF file, by address."""

    def __init__(self, elf: Path) -> None:
        command = ["avr-objdump", "-d", "-C", "--no-show-raw-insn", str(elf)]
        self.text = subprocess.run(command, capture_output=True, text=True, check=True).stdout

    @cached_property
    def code(self) -> dict[int, Instruction]:
        found: list[tuple[int, str, str, tuple[str, ...]]] = []
        function = ""
        for line in self.text.splitlines():
            if title := TITLE.match(line):
                function = title["name"]
            elif match := LINE.match(line):
                operands = tuple(word.strip() for word in match["operands"].split(","))
                found.append((int(match["at"], 16), function, match["name"], operands))
        following = [at for at, *_ in found[1:]] + [-1]
        return {
            at: Instruction(at, behind, function, name, operands)
            for (at, function, name, operands), behind in zip(found, following, strict=True)
        }

    def locked_cycles(self) -> dict[str, int]:
        """The longest stretch from CLI to the second instruction behind the one that lets interrupts in, by function.

        One of those comes before the next interrupt, one after it. The end of the program is no lock.
        """
        found: dict[str, int] = {}
        for one in self.code.values():
            if one.name == "cli" and one.function != "_exit":
                cycles = self._longest(one, self._end_of_lock)
                found[one.function] = max(found.get(one.function, 0), cycles)
        return found

    def way_cycles(self, function: str, begin: tuple[str, str], end: tuple[str, str]) -> int:
        """The longest way from behind an instruction to behind another, in one lock; each by name and operand."""
        (one,) = (
            one
            for one in self.code.values()
            if f"::{function}(" in one.function and one.name == begin[0] and begin[1] in one.operands
        )

        def last(at: Instruction) -> int | None:
            if at.ends_lock:
                return NO_WAY
            return at.cycles if (at.name, at.operands[0]) == end else None

        return self._longest(self.code[one.next], last)

    def _end_of_lock(self, one: Instruction) -> int | None:
        return one.cycles + self._two_behind(one) if one.ends_lock else None

    def _longest(
        self,
        one: Instruction,
        end: Callable[[Instruction], int | None],
        known: Known = Known(),
        passed: frozenset[tuple[int, Known]] = frozenset(),
    ) -> int:
        """Cycles from an instruction on, with what the one that is the end counts."""
        last = end(one)
        if last is not None:
            return last
        assert (one.at, known) not in passed, f"{one.function}: locked in a loop without an end, at {one.at:x}"
        passed |= {(one.at, known)}
        ways = self._onward(one, known)
        return one.cycles + max(extra + self._longest(self.code[to], end, then, passed) for to, then, extra in ways)

    def _onward(self, one: Instruction, known: Known) -> Iterator[tuple[int, Known, int]]:
        """Where it may go from an instruction, with what is known there and the cycles on top."""
        if one.name in CALLS:
            yield one.target, replace(known, calls=(*known.calls, one.next)), 0
        elif one.name == "ret":
            assert known.calls, f"{one.function}: locked behind its end"
            yield known.calls[-1], replace(known, calls=known.calls[:-1]), 0
        elif one.name in JUMPS:
            yield one.target, known, 0
        elif one.is_branch or one.name in SKIPS:
            taken = self._is_taken(one, known)
            if taken is not True:
                yield one.next, known, 0
            if taken is not False:
                skipped = self.code[one.next]
                extra = 1 if one.is_branch else (skipped.next - skipped.at) // 2
                yield one.target if one.is_branch else skipped.next, known, extra
        else:
            assert one.name not in ("ijmp", "icall", "reti", "sleep"), f"{one.function}: {one.name} in a lock"
            yield one.next, known.behind(one), 0

    @staticmethod
    def _is_taken(one: Instruction, known: Known) -> bool | None:
        """Whether a branch or a skip is; None where that cannot be told."""
        flag = {"breq": known.zero, "brne": known.zero, "brcs": known.carry, "brcc": known.carry}.get(one.name)
        if flag is not None:
            return flag == (one.name in ("breq", "brcs"))
        if one.name == "cpse":
            a, b = (known.value(operand) for operand in one.operands)
            return None if a is None or b is None else a == b
        return None

    def _two_behind(self, one: Instruction) -> int:
        """The most cycles of the two instructions that come behind one."""
        return max(
            first.cycles + max(second.cycles for second in self._following(first)) for first in self._following(one)
        )

    def _following(self, one: Instruction) -> list[Instruction]:
        """Those that may come next; behind a RET all those that the function is called from."""
        if one.name in JUMPS:
            return [self.code[one.target]]
        if one.name != "ret":
            return [self.code[one.next]] + ([self.code[one.target]] if one.is_branch else [])
        begin = next(at for at, other in self.code.items() if other.function == one.function)
        calls = [other for other in self.code.values() if other.name in (*CALLS, *JUMPS) and other.target == begin]
        return [self.code[other.next] for other in calls if other.name in CALLS] or [self.code[one.next]]
