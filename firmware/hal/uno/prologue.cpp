// What functions that save many registers begin and end with (-mcall-prologues): they jump here instead of to
// the compiler's library, whose code saves the interrupts' registers first.
//
// A jump into the middle saves what is from there on. The compiler counts from r2, two bytes each, so
// image.ld defines the symbols that it names as many bytes before the code below as the registers that the
// interrupts have would take: prologue_skips.

#include "hal_step_timer.h"

namespace {
constexpr int FIRST_SAVED = hal::FRACTIONS_IN_REGISTERS ? 16 : 12;
}

extern "C" __attribute__((naked, used, section(".text.common_prologue"))) void common_prologue() {
    __asm__ __volatile__(
        R"(
        .global prologue_skips
        .set prologue_skips, 2 * (%[first] - 2)
        ; r27, r26: bytes of the frame; r31, r30: where to go on. r29, r28 become the frame's address.
        .if %[first] == 12
        push r12
        push r13
        push r14
        push r15
        .endif
        push r16
        push r17
        push r28
        push r29
        in   r28, 0x3D
        in   r29, 0x3E
        sub  r28, r26
        sbc  r29, r27
        in   r0, 0x3F
        cli
        out  0x3E, r29
        out  0x3F, r0
        out  0x3D, r28
        ijmp
        )" ::[first] "n"(FIRST_SAVED));
}

extern "C" __attribute__((naked, used, section(".text.common_epilogue"))) void common_epilogue() {
    __asm__ __volatile__(
        R"(
        ; r29, r28: the frame's end; r30: bytes saved.
        .if %[first] == 12
        ldd  r12, Y + 8
        ldd  r13, Y + 7
        ldd  r14, Y + 6
        ldd  r15, Y + 5
        .endif
        ldd  r16, Y + 4
        ldd  r17, Y + 3
        ldd  r26, Y + 2
        ldd  r27, Y + 1
        add  r28, r30
        adc  r29, r1
        in   r0, 0x3F
        cli
        out  0x3E, r29
        out  0x3F, r0
        out  0x3D, r28
        movw r28, r26
        ret
        )" ::[first] "n"(FIRST_SAVED));
}
