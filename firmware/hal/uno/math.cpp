// Naked functions that change r0, r18 to r27, r30 and r31, as any call may, and tell the compiler nothing of
// it: platformio.ini keeps it from looking into their bodies for what they leave alone (-fno-ipa-ra).

#include "hal_math.h"

namespace hal {

// a in r25 to r22, b in r21 and r20; high in r21 to r18, low in r23 and r22. The bytes of the product come up
// in r30, r31, r18 to r21.
__attribute__((naked, noinline)) Fixed48 multiply(uint32_t, uint16_t) {
    __asm__ __volatile__(
        R"(
        movw r26, r20
        mul  r22, r26
        movw r30, r0
        mul  r22, r27
        clr  r22                        ; 0 from here on
        add  r31, r0
        mov  r18, r1
        adc  r18, r22
        mul  r24, r26
        add  r18, r0
        mov  r19, r1
        adc  r19, r22
        mul  r25, r27
        movw r20, r0
        mul  r23, r26
        add  r31, r0
        adc  r18, r1
        adc  r19, r22
        adc  r20, r22
        adc  r21, r22
        mul  r23, r27
        add  r18, r0
        adc  r19, r1
        adc  r20, r22
        adc  r21, r22
        mul  r24, r27
        add  r19, r0
        adc  r20, r1
        adc  r21, r22
        mul  r25, r26
        add  r19, r0
        adc  r20, r1
        adc  r21, r22
        clr  r1
        movw r22, r30
        ret
        )");
}

__attribute__((naked, noinline)) uint32_t multiply_low(uint32_t, uint16_t) {
    __asm__ __volatile__(
        R"(
        call %x[multiply]
        movw r24, r18
        ret
        )" ::[multiply] "i"(multiply));
}

__attribute__((naked, noinline)) uint32_t multiply_high(uint32_t, uint16_t) {
    __asm__ __volatile__(
        R"(
        call %x[multiply]
        movw r22, r18
        movw r24, r20
        ret
        )" ::[multiply] "i"(multiply));
}

__attribute__((naked, noinline)) uint32_t multiply_saturated(uint32_t, uint16_t) {
    __asm__ __volatile__(
        R"(
        call %x[multiply]
        or   r20, r21
        brne 1f
        movw r24, r18
        ret
    1:  ldi  r22, 0xFF
        ldi  r23, 0xFF
        movw r24, r22
        ret
        )" ::[multiply] "i"(multiply));
}

// a in r25 to r22, b in r21 to r18. The products with b's halves are added.
__attribute__((naked, noinline)) uint32_t multiply_q16(uint32_t, uint32_t) {
    __asm__ __volatile__(
        R"(
        push r20
        push r21
        push r22
        push r23
        push r24
        push r25
        movw r20, r18
        call %x[multiply]
        pop  r25
        pop  r24
        pop  r23
        pop  r22
        pop  r27
        pop  r26
        push r18
        push r19
        push r20
        push r21
        movw r20, r26
        call %x[multiply]
        pop  r27
        pop  r26
        pop  r25
        pop  r24
        add  r22, r24
        adc  r23, r25
        adc  r18, r26
        adc  r19, r27
        adc  r20, r1
        adc  r21, r1
        or   r20, r21
        brne 1f
        movw r24, r18
        ret
    1:  ldi  r22, 0xFF
        ldi  r23, 0xFF
        movw r24, r22
        ret
        )" ::[multiply] "i"(multiply));
}

// The sum's address in r25 and r24; the term as `multiply` returns it.
__attribute__((naked, noinline)) void add_to(Fixed48&, Fixed48) {
    __asm__ __volatile__(
        R"(
        movw r30, r24
        ldd  r24, Z + 4
        add  r24, r22
        std  Z + 4, r24
        ldd  r24, Z + 5
        adc  r24, r23
        std  Z + 5, r24
        ldd  r24, Z + 0
        adc  r24, r18
        std  Z + 0, r24
        ldd  r24, Z + 1
        adc  r24, r19
        std  Z + 1, r24
        ldd  r24, Z + 2
        adc  r24, r20
        std  Z + 2, r24
        ldd  r24, Z + 3
        adc  r24, r21
        std  Z + 3, r24
        ret
        )");
}

// Long division, digit by digit of eight bits: a, and sixteen bits of 0 behind it, go out to the left from
// r25 to r22, r27 and r26, and the quotient's digits come in on the right. b is in r20, what is left over in
// r21, the digit in r18. Digits of 0 before the first other one take no time.
__attribute__((naked, noinline)) uint32_t divide_q16(uint32_t, uint8_t) {
    __asm__ __volatile__(
        R"(
        clr  r26
        clr  r27
        clr  r21
        ldi  r31, 6
    1:  mov  r18, r25
        mov  r25, r24
        mov  r24, r23
        mov  r23, r22
        mov  r22, r27
        mov  r27, r26
        mov  r26, r18
        or   r26, r21
        breq 5f
        ldi  r30, 8
    2:  lsl  r18
        rol  r21
        brcs 3f
        cp   r21, r20
        brcs 4f
    3:  sub  r21, r20
        inc  r18
    4:  dec  r30
        brne 2b
        mov  r26, r18
    5:  dec  r31
        brne 1b
        movw r24, r22
        movw r22, r26
        ret
        )");
}

}  // namespace hal
