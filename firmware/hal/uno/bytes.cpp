// Naked functions, as in math.cpp: they change r0, r18 to r27, r30 and r31.

#include "hal_bytes.h"

namespace hal {

// The next byte of the Bytes at Z, into r18. Its name is for the assembler.
extern "C" __attribute__((naked, noinline, used)) void planarm_next() {
    __asm__ __volatile__(
        R"(
        ldd  r18, Z + 2
        subi r18, 1
        brcs 2f
        std  Z + 2, r18
        ld   r26, Z
        ldd  r27, Z + 1
        ld   r18, X+
        ldd  r0, Z + 6
        cp   r26, r0
        ldd  r0, Z + 7
        cpc  r27, r0
        brne 1f
        ldd  r26, Z + 4
        ldd  r27, Z + 5
    1:  st   Z, r26
        std  Z + 1, r27
        ret
    2:  clr  r18
        std  Z + 2, r18
        std  Z + 3, r18
        ret
        )");
}

__attribute__((naked, noinline)) uint8_t next_byte(Bytes&) {
    __asm__ __volatile__(
        R"(
        movw r30, r24
        call planarm_next
        mov  r24, r18
        ret
        )");
}

// The number comes up in r22 to r25: seven bits of each byte go into r21, and what r21 has no room for into
// the next place, by a product with r20, which says where they belong. Then all moves down by a place, four
// times in all: what is left in r21 at last is more than 32 bits.
__attribute__((naked, noinline)) uint32_t varuint(Bytes&) {
    __asm__ __volatile__(
        R"(
        movw r30, r24
        call planarm_next
        ldi  r22, 0
        ldi  r23, 0
        movw r24, r22
        ldi  r20, 0x80
        mov  r21, r18
        andi r21, 0x7F
    1:  sbrs r18, 7
        rjmp 2f
        call planarm_next
        cpi  r18, 1                     ; cut short, or needless
        brcs 4f
        cpi  r20, 0x10                  ; a sixth
        brcs 4f
        mov  r19, r18
        andi r19, 0x7F
        mul  r19, r20
        or   r21, r0
        mov  r22, r23
        mov  r23, r24
        mov  r24, r25
        mov  r25, r21
        lsr  r20
        mov  r21, r1
        clr  r1
        rjmp 1b
    2:  cpi  r20, 0x08
        breq 3f
        mov  r22, r23
        mov  r23, r24
        mov  r24, r25
        mov  r25, r21
        clr  r21
        lsr  r20
        rjmp 2b
    3:  tst  r21
        breq 5f
    4:  std  Z + 2, r1
        std  Z + 3, r1
        ldi  r22, 0
        ldi  r23, 0
        movw r24, r22
        ret
    5:  ret
        )");
}

}  // namespace hal
