"""What instructions do to the SRAM, and to the loop that is watched; in the CPU loop itself, as they are the most used.

What lies outside the SRAM is left to `access`, once the instruction has ended.
"""

from __future__ import annotations

from planarm_sim.cpu import access as io
from planarm_sim.cpu.access import note_access, note_turn
from planarm_sim.cpu.compiled import inlined, inner  # kernel_cache: see there
from planarm_sim.cpu.idle import LEAST_ROOM
from planarm_sim.cpu.layout import LAST_BACK, LOOK_AT, PASSED_OVER, SP, STORES, WATCHED, Bytes, State
from planarm_sim.cpu.registers import SRAM_END, SRAM_START

SRAM_BYTES = SRAM_END - SRAM_START
LOWEST_PUSH, LOWEST_POP = SRAM_START + 1, SRAM_START - 1
"""SP from which on a return address lies in the SRAM entirely, when it is pushed and when it is popped."""
PC_BITS = 14
Z_LOW, Z_HIGH = 30, 31
"""The register pair Z."""


@inlined
def load(st: State, memory: Bytes, address: int, d: int, pc: int) -> None:
    """Load register `d` for the instruction at `pc`."""
    offset = address - SRAM_START
    if 0 <= offset < SRAM_BYTES:
        st[d] = memory[offset]
    else:
        note_access(st, io.READ, address, d, pc)


@inlined
def store(st: State, memory: Bytes, address: int, value: int, pc: int) -> None:
    """Store a byte for the instruction at `pc`."""
    offset = address - SRAM_START
    if 0 <= offset < SRAM_BYTES:
        memory[offset] = value
        st[STORES] += 1
    else:
        note_access(st, io.WRITE, address, value, pc)


@inlined
def push(st: State, memory: Bytes, value: int, pc: int) -> None:
    """Push a byte for the instruction at `pc`."""
    address = st[SP]
    st[SP] = (address - 1) & 0xFFFF
    store(st, memory, address, value, pc)


@inlined
def pop(st: State, memory: Bytes, d: int, pc: int) -> None:
    """Pop register `d` for the instruction at `pc`."""
    address = (st[SP] + 1) & 0xFFFF
    st[SP] = address
    load(st, memory, address, d, pc)


@inlined
def call(st: State, memory: Bytes, back_to: int, pc: int) -> None:
    """Push a return address for the instruction before `pc`."""
    place = st[SP] - LOWEST_PUSH
    if 0 <= place < SRAM_BYTES - 1:
        memory[place + 1] = back_to & 0xFF
        memory[place] = back_to >> 8
        st[SP] -= 2
        st[STORES] += 1
    else:
        note_access(st, io.CALL, pc, back_to, pc - 1)


@inlined
def go_back(st: State, pc: int) -> None:
    """Note that the program jumped back to `pc`."""
    st[LAST_BACK] = pc
    if pc == st[WATCHED]:
        note_turn(st)


@inlined
def moment(pc: int, cycle: int) -> int:
    """Where the program is and when, as one number."""
    return (cycle << PC_BITS) | pc


@inner
def pass_turns(st: State, cycle: int, turn: int) -> int:
    """Return the cycle after all the whole turns of `turn` cycles that fit before something is due (see `waiting`)."""
    room = st[LOOK_AT] - cycle
    if room < LEAST_ROOM:
        return cycle
    passed = room // turn * turn
    st[PASSED_OVER] += passed
    return int(cycle + passed)
