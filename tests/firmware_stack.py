"""The deepest stack of a firmware image, from its listing: what any call path takes, and an interrupt on top."""

from __future__ import annotations

import re
import subprocess
from bisect import bisect_right
from collections.abc import Callable
from functools import cache
from pathlib import Path

PROLOGUE, EPILOGUE = "common_prologue", "common_epilogue"  # firmware/hal/uno/prologue.cpp
JUMPS = (PROLOGUE, EPILOGUE, "__tablejump2__")  # back into the function that they are used by
RETURN_BYTES = 2  # of a return address, with 32 KB of flash
PUSH_BYTES = 2  # of code

FUNCTION = re.compile(r"^(?P<at>[0-9a-f]+) <(?P<name>.+)>:\n(?P<body>(?:.+\n)*)", re.M)
CALL, JUMP = re.compile(r"r?call\t.*0x(?P<to>[0-9a-f]+) <"), re.compile(r"r?jmp\t.*0x(?P<to>[0-9a-f]+) <")
FRAME_LOW, FRAME_HIGH = re.compile(r"ldi\tr26, 0x(..)"), re.compile(r"ldi\tr27, 0x(..)")


def deepest_stack_bytes(elf: Path) -> tuple[int, list[str]]:
    """Most bytes that are ever on the stack, and the functions of that path, main first, an interrupt last."""
    listing = subprocess.run(
        ["avr-objdump", "-d", "--no-show-raw-insn", str(elf)], capture_output=True, text=True, check=True
    ).stdout
    functions = [(int(found["at"], 16), found["name"], found["body"]) for found in FUNCTION.finditer(listing + "\n")]
    starts = [at for at, *_ in functions]

    def place(address: int) -> tuple[str, int]:
        """The function that an address is in, and how far."""
        at, name, _ = functions[bisect_right(starts, address) - 1]
        return name, address - at

    saved = next(body.count("\tpush\t") for _, name, body in functions if name == PROLOGUE)
    calls = {name: _calls(name, body.splitlines(), saved, place) for _, name, body in functions}

    @cache
    def deepest(name: str) -> tuple[int, tuple[str, ...]]:
        own = max((depth for depth, _ in calls[name]), default=0)
        paths = [(depth + deepest(callee)[0], deepest(callee)[1]) for depth, callee in calls[name] if callee]
        most, path = max(paths, default=(0, ()))
        return (most, (name, *path)) if most > own else (own, (name,))

    program, path = deepest("main")
    interrupt, handler = max(deepest(name) for name in calls if re.fullmatch(r"__vector_\d+", name))
    return 2 * RETURN_BYTES + program + interrupt, [*path, *handler]


def _calls(
    function: str, body: list[str], saved: int, place: Callable[[int], tuple[str, int]]
) -> list[tuple[int, str]]:
    """What is on the stack above the return address when each function is called, and with no callee at most.

    `saved` are the registers that all of the common prologue saves.
    """
    depth = most = 0
    low = high = 0
    found: list[tuple[int, str]] = []
    for line in body:
        instruction = line.partition(":\t")[2]
        if instruction.startswith("push"):
            depth += 1
        elif instruction.startswith("pop"):
            depth -= 1
        elif re.match(r"rcall\t\.\+0\b", instruction):
            depth += RETURN_BYTES  # room for variables
        elif match := FRAME_LOW.match(instruction):
            low = int(match[1], 16)
        elif match := FRAME_HIGH.match(instruction):
            high = int(match[1], 16)
        elif match := re.match(r"sbiw\tr28, 0x(..)", instruction):
            depth += int(match[1], 16)
        elif match := re.match(r"ret\b|reti\b", instruction):
            depth = most  # what follows is reached from before
        elif match := CALL.match(instruction):
            found.append((depth + RETURN_BYTES, place(int(match["to"], 16))[0]))
        elif match := JUMP.match(instruction):
            name, offset = place(int(match["to"], 16))
            if name == PROLOGUE:
                depth += saved - offset // PUSH_BYTES + low + 256 * high
            elif name == EPILOGUE:
                depth = most
            elif name != function:
                found.append((depth, name))  # in place of a call before RET
        elif re.match(r"icall|ijmp", instruction) and function not in JUMPS:
            raise AssertionError(f"{function}: the stack below {instruction} cannot be told")
        most = max(most, depth)
    return [*found, (most, "")]
