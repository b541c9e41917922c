"""Operations of decoded instructions; numbered densely, so that the CPU loop becomes one jump table.

There are fewer than the manual has: an instruction with a constant is the one between registers with a
constant's word as its second register, indirect loads differ in their pointer alone, and so on. Relative jumps back
are told from those ahead, as they may close a loop that waits (see `idle`).
"""

from __future__ import annotations

# fmt: off
(
    UNDEFINED,
    ADD, ADC, SUB, SBC, CP, CPC, AND, OR, EOR, INC, DEC, LSR, ROR, SWAP, ADIW, SBIW,
    MOV, MOVW, LDD, STD, LD_INC, ST_INC, LDS, STS, LDS_PLAIN, STS_PLAIN, POP, PUSH,
    BRBS, BRBC, BRBS_BACK, BRBC_BACK, JUMP2, JUMP2_BACK, JUMP3, RCALL, CALL, RET, RETI, CPSE, SBRC, SBRS,
    IN, OUT, IN_SREG, OUT_SREG, SBI, CBI, BSET, BCLR, SBIC, SBIS,
    COM, NEG, ASR, MUL, MULX, LPM, LPM_INC, LD_DEC, ST_DEC, BLD, BST, IJMP, ICALL,
    NOP, WRAP, SLEEP, WDR,
    BREAK, SPM,
    PUSH2, POP2, PUSH4, POP4, MOV2, LDS2, ADD_ADC, SUB_SBC, COMPARE_BRANCH, ENTER, LEAVE,
) = range(83)
# fmt: on

D_SIGNED, R_SIGNED, FRACTIONAL = 1, 2, 4
"""What MULX does differently from MUL; in its field k."""
