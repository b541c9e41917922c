"""Operations of decoded instructions; numbered densely, so that the CPU loop becomes one jump table.

There are fewer than the manual has: an instruction with a constant is the one between registers with a
constant's word as its second register, indirect loads differ in their pointer alone, and so on.
"""

from __future__ import annotations

# fmt: off
(
    UNDEFINED, WRAP, NOP,
    ADD, ADC, SUB, SBC, CP, CPC, AND, OR, EOR, COM, NEG, INC, DEC, LSR, ROR, ASR, SWAP,
    ADIW, SBIW, MUL, MULX,
    MOV, MOVW, LDD, STD, LD_INC, LD_DEC, ST_INC, ST_DEC, LDS, STS, LDS_PLAIN, STS_PLAIN, LPM, LPM_INC, POP, PUSH,
    IN, OUT, IN_SREG, OUT_SREG, CBI, SBI, SBIC, SBIS,
    BSET, BCLR, BLD, BST,
    JUMP2, JUMP3, IJMP, RCALL, CALL, ICALL, RET, RETI, BRBS, BRBC, CPSE, SBRC, SBRS,
    SLEEP, WDR, BREAK, SPM,
) = range(69)
# fmt: on

D_SIGNED, R_SIGNED, FRACTIONAL = 1, 2, 4
"""What MULX does differently from MUL; in its field k."""
