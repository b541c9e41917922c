// The step interrupt of joints whose pulses are ended by a second match; part of step_interrupts.cpp, whose
// registers and names it shares.
//
// The match of a step's tick raises the pin. Its interrupt counts the step and sets the compare register to
// the tick at which the second match takes the pin low: MIN_STEP_HIGH_TICKS later, exactly. That one's
// interrupt places the next step's tick, as on_match of core/on_match.h does it. Which of the
// two it is tells the pin.
//
// Cycles from the match, if nothing else runs, with entry (4) and the jump from the vector (3):
//                            all    look at the timer   next edge placed
//   risen                     38       23                  21
//   one step after another    90       49                  60
//   on in one direction       63       46                  57
//   on and back               69       51                  63
//   going idle                60
// tests/firmware/test_firmware_slow_drivers.py counts them. The high time covers what may run when the pin
// rises: what is left of a receive interrupt that has begun (39), a lock of the main program (freeze's: 47),
// the other joint's interrupt (90) and the way to the compare register (21): 197 of 240. The least interval
// of one joint is the high time, what may run when the pin falls, up to the look at the timer (39, a short
// lock 17, 90, 49), and what is asked for there (14): 449 of 450.
#pragma once

#include <avr/io.h>
#include <stddef.h>

#include "step_engine.h"

namespace {

constexpr uint16_t HIGH_TICKS = wire::MIN_STEP_HIGH_TICKS;

template <uint8_t JOINT>
HAL_INLINE void second_match_interrupt() {
    __asm__ __volatile__(
        R"(
        in   r2, %[sreg]
        movw r4, r30
        sbis %[step_pin], %[step_bit]
        rjmp 2f

        lds  r30, %[ocr]                ; it rose: the tick of the fall
        lds  r31, %[ocr] + 1
        subi r30, lo8(-(%[high]))
        sbci r31, hi8(-(%[high]))
        sts  %[ocr] + 1, r31
        sts  %[ocr], r30
        lds  r6, %[tccra] + 4           ; late?
        lds  r7, %[tccra] + 5
        in   r3, %[left]                ; count the step
        dec  r3
        out  %[left], r3
        sub  r30, r6
        sbc  r31, r7
        brpl 7f
        rjmp 5f
    7:  movw r30, r4
        out  %[sreg], r2
        reti

    2:  lds  r30, %[active]             ; it fell
        lds  r31, %[active] + 1
        in   r3, %[left]
        tst  r3
        breq 1f
        ldd  r8, Z + %[interval]
        ldd  r9, Z + %[interval] + 1
        ldd  r10, Z + %[interval] + 2
        ldd  r11, Z + %[interval] + 3
        ldd  r3, Z + %[fraction]        ; fraction += interval
        add  r3, r8
        std  Z + %[fraction], r3
        ldd  r3, Z + %[fraction] + 1
        adc  r3, r9
        std  Z + %[fraction] + 1, r3
        lds  r6, %[ocr]                 ; the next edge, and the high time
        lds  r7, %[ocr] + 1
        adc  r6, r10
        adc  r7, r11
        movw r30, r6
        subi r30, lo8(%[high])
        sbci r31, hi8(%[high])
        movw r6, r30
        lds  r30, %[tccra] + 4          ; late?
        lds  r31, %[tccra] + 5
        adiw r30, %[step_margin]
        cp   r6, r30
        cpc  r7, r31
        brmi 6f
        sts  %[ocr] + 1, r7
        sts  %[ocr], r6
        lds  r30, %[active]             ; interval += add
        lds  r31, %[active] + 1
        ldd  r3, Z + %[add]
        add  r8, r3
        std  Z + %[interval], r8
        ldd  r3, Z + %[add] + 1
        adc  r9, r3
        std  Z + %[interval] + 1, r9
        ldd  r3, Z + %[add] + 2
        adc  r10, r3
        std  Z + %[interval] + 2, r10
        ldd  r3, Z + %[add] + 3
        adc  r11, r3
        std  Z + %[interval] + 3, r11
        movw r30, r4
        out  %[sreg], r2
        reti
    6:  rjmp 5f

    1:  ldd  r6, Z + %[next]            ; the run is done
        ldd  r7, Z + %[next] + 1
        sts  %[active], r6
        sts  %[active] + 1, r7
        movw r30, r6
        ldd  r3, Z + %[steps]
        out  %[left], r3
        ldd  r6, Z + %[first]
        ldd  r7, Z + %[first] + 1
        ldd  r3, Z + %[chained]
        ldd  r8, Z + %[dir_high]
        tst  r3
        breq 4f
        sbrc r3, 1
        rjmp 3f
        lds  r30, %[tccra] + 4          ; late?
        lds  r31, %[tccra] + 5
        adiw r30, %[step_margin]
        cp   r6, r30
        cpc  r7, r31
        brmi 5f
    9:  sts  %[ocr] + 1, r7
        sts  %[ocr], r6
        movw r30, r4
        out  %[sreg], r2
        reti

    3:  in   r9, %[dir_port]            ; turn round
        bst  r8, 0
        bld  r9, %[dir_bit]
        out  %[dir_port], r9
        lds  r30, %[tccra] + 4          ; late?
        lds  r31, %[tccra] + 5
        subi r30, lo8(-(%[dir_margin]))
        sbci r31, hi8(-(%[dir_margin]))
        cp   r6, r30
        cpc  r7, r31
        brpl 9b

    5:  lds  r30, %[timsk]              ; a step is missed
        sts  %[missed], r30
        ldi  r30, %[all_disarmed]
        sts  %[tccra], r30
        ldi  r30, 1                     ; hal::ONLY_LAPS
        sts  %[timsk], r30
        movw r30, r4
        out  %[sreg], r2
        reti

    4:  lds  r30, %[tccra]              ; go idle
        andi r30, %[other]
        ori  r30, %[disarmed]
        sts  %[tccra], r30
        lds  r30, %[timsk]
        andi r30, %[silent]
        sts  %[timsk], r30
        movw r30, r4
        out  %[sreg], r2
        reti
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [left] "I"(_SFR_IO_ADDR(JOINT == 0 ? GPIOR0 : GPIOR1)), [active] "i"(&step_joints[JOINT].active),
        [steps] "I"(offsetof(Run, steps)), [fraction] "I"(offsetof(Run, fraction)),
        [interval] "I"(offsetof(Run, interval_q16)), [add] "I"(offsetof(Run, add_q16)),
        [next] "I"(offsetof(Run, next)), [chained] "I"(offsetof(Run, chained)),
        [first] "I"(offsetof(Run, first_ticks)), [dir_high] "I"(offsetof(Run, dir_high)),
        [ocr] "i"(JOINT == 0 ? &OCR1AL : &OCR1BL), [tccra] "i"(&TCCR1A), [timsk] "i"(&TIMSK1),
        [high] "n"(HIGH_TICKS),
        [other] "i"(JOINT == 0 ? _BV(COM1B1) | _BV(COM1B0) : _BV(COM1A1) | _BV(COM1A0)),
        [disarmed] "i"(JOINT == 0 ? _BV(COM1A1) : _BV(COM1B1)), [all_disarmed] "i"(hal::ALL_DISARMED),
        [silent] "i"(0xFF & ~(JOINT == 0 ? _BV(OCIE1A) : _BV(OCIE1B))),
        [step_margin] "i"(planarm::step_engine::STEP_MARGIN_TICKS),
        [dir_margin] "i"(planarm::step_engine::DIR_MARGIN_TICKS),
        [dir_port] "I"(port_of(wire::DIR_PINS[JOINT])), [dir_bit] "I"(hal::bit_of(wire::DIR_PINS[JOINT])),
        [missed] "i"(&step_missed), [step_pin] "I"(port_of(wire::STEP_PINS[JOINT]) - 2),
        [step_bit] "I"(hal::bit_of(wire::STEP_PINS[JOINT])));
}

}  // namespace
