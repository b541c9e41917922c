// The step interrupts in assembler: step_engine::on_match of core/step_engine.h, statement by statement.
//
// No compiled or library code uses r2 to r12: platformio.ini keeps the compiler off them, build.py checks the
// linked program. The interrupts, which never nest, need no stack. Here they hold
//   r2         the status register         r4, r5  the interrupted code's r30, r31
//   r3, r8     fraction, then edge         r6, r7  the interrupted code's r24, r25
//   r9 to r12  interval; r9 also how a run follows
//
// Cycles from the match, if nothing else runs, with entry (4) and the jump from the vector (3):
//                            all    pin falls   look at the timer   next edge armed
//   one step after another   104       61              63                77
//   on in one direction       86       57              63                77
//   on and back               96       57              73                87
//   going idle                64       50
//   a step missed             91, after a change of DIR 101
// tests/firmware/test_firmware_cycles.py counts them. The least interval of one joint covers what may run
// when its step rises (the longest lock of the main program, 50, or the receive interrupt, 44), the other
// joint's interrupt (104), one instruction of the main program after each (4), its own way to the look at the
// timer (63), and the least low time (32): 257. From a step to one back the look comes after 73 and asks for
// the DIR setup time (320): 555.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>

#include "step_engine.h"

namespace {

using planarm::Chain;
using planarm::Run;
using planarm::step_joints;
using planarm::step_missed;

static_assert(static_cast<uint8_t>(Chain::NONE) == 0, "tst finds a joint that goes idle");
static_assert(static_cast<uint8_t>(Chain::REVERSED) == 2, "bit 1 finds a reversal");
static_assert(sizeof(Run*) == 2 && sizeof(bool) == 1, "widths of loads");

template <uint8_t JOINT>
HAL_INLINE void step_interrupt() {
    __asm__ __volatile__(
        R"(
        in   r2, %[sreg]
        movw r4, r30
        movw r6, r24
        lds  r30, %[active]
        lds  r31, %[active] + 1
        ldd  r24, Z + %[left]           ; count the step
        ldd  r25, Z + %[left] + 1
        sbiw r24, 1
        std  Z + %[left], r24
        std  Z + %[left] + 1, r25
        breq 1f

        ldd  r3, Z + %[fraction]        ; interval + fraction
        ldd  r8, Z + %[fraction] + 1
        ldd  r9, Z + %[interval]
        ldd  r10, Z + %[interval] + 1
        ldd  r11, Z + %[interval] + 2
        ldd  r12, Z + %[interval] + 3
        add  r3, r9
        adc  r8, r10
        std  Z + %[fraction], r3
        std  Z + %[fraction] + 1, r8
        lds  r3, %[ocr]                 ; the next edge
        lds  r8, %[ocr] + 1
        adc  r3, r11
        adc  r8, r12
        sts  %[ocr] + 1, r8
        sts  %[ocr], r3
        lds  r24, %[tccra]              ; fall
        andi r24, %[disarmed]
        sts  %[tccra], r24
        ldi  r25, %[foc]
        sts  %[tccrc], r25
        lds  r25, %[tcnt]               ; late?
        sub  r3, r25
        lds  r25, %[tcnt] + 1
        sbc  r8, r25
        ldi  r25, %[step_margin]
        sub  r3, r25
        ldi  r25, 0
        sbc  r8, r25
        cp   r3, r11
        cpc  r8, r12
        brcc 5f
        ori  r24, %[armed]
        sts  %[tccra], r24
        ldd  r24, Z + %[add]            ; interval += add
        add  r9, r24
        std  Z + %[interval], r9
        ldd  r24, Z + %[add] + 1
        adc  r10, r24
        std  Z + %[interval] + 1, r10
        ldd  r24, Z + %[add] + 2
        adc  r11, r24
        std  Z + %[interval] + 2, r11
        ldd  r24, Z + %[add] + 3
        adc  r12, r24
        std  Z + %[interval] + 3, r12
        movw r24, r6
        movw r30, r4
        out  %[sreg], r2
        reti

    1:  rjmp 2f                         ; as far as a branch reaches

    5:  ldi  r24, %[both_disarmed]      ; a step is missed
        sts  %[tccra], r24
        ldi  r24, 0
        sts  %[timsk], r24
        ldi  r24, 1
        sts  %[missed], r24
    6:  movw r24, r6
        movw r30, r4
        out  %[sreg], r2
        reti

    2:  ldd  r24, Z + %[next]           ; the run is done
        ldd  r25, Z + %[next] + 1
        sts  %[active], r24
        sts  %[active] + 1, r25
        movw r30, r24
        lds  r24, %[tccra]
        andi r24, %[disarmed]
        ldi  r25, %[foc]
        ldd  r9, Z + %[chained]
        tst  r9
        breq 4f
        ldd  r3, Z + %[first]
        ldd  r8, Z + %[first] + 1
        sts  %[ocr] + 1, r8
        sts  %[ocr], r3
        sts  %[tccra], r24              ; fall
        sts  %[tccrc], r25
        sbrc r9, 1
        rjmp 3f
        ldi  r30, %[step_margin]
        ldi  r31, 0
    7:  lds  r25, %[tcnt]               ; late?
        sub  r3, r25
        lds  r25, %[tcnt] + 1
        sbc  r8, r25
        sub  r3, r30
        sbc  r8, r31
        ldi  r30, lo8(%[most_ahead] + 1)
        ldi  r31, hi8(%[most_ahead] + 1)
        cp   r3, r30
        cpc  r8, r31
        brcc 5b
        ori  r24, %[armed]
        sts  %[tccra], r24
        rjmp 6b

    3:  ldd  r25, Z + %[positive]       ; turn round
        sbrc r25, 0
        sbi  %[dir_port], %[dir_bit]
        sbrs r25, 0
        cbi  %[dir_port], %[dir_bit]
        ldi  r30, lo8(%[dir_margin])
        ldi  r31, hi8(%[dir_margin])
        rjmp 7b

    4:  sts  %[tccra], r24              ; fall and go idle
        sts  %[tccrc], r25
        lds  r24, %[timsk]
        andi r24, %[silent]
        sts  %[timsk], r24
        rjmp 6b
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [active] "i"(&step_joints[JOINT].active), [left] "i"(offsetof(Run, steps_left)),
        [fraction] "i"(offsetof(Run, fraction)), [interval] "i"(offsetof(Run, interval_q16)),
        [add] "i"(offsetof(Run, add_q16)), [next] "i"(offsetof(Run, next)),
        [chained] "i"(offsetof(Run, chained)), [first] "i"(offsetof(Run, first_ticks)),
        [positive] "i"(offsetof(Run, positive)), [ocr] "i"(JOINT == 0 ? &OCR1AL : &OCR1BL),
        [tccra] "i"(&TCCR1A), [tccrc] "i"(&TCCR1C), [tcnt] "i"(&TCNT1L), [timsk] "i"(&TIMSK1),
        [foc] "i"(JOINT == 0 ? _BV(FOC1A) : _BV(FOC1B)), [armed] "i"(JOINT == 0 ? _BV(COM1A0) : _BV(COM1B0)),
        [disarmed] "i"(0xFF & ~(JOINT == 0 ? _BV(COM1A0) : _BV(COM1B0))),
        [both_disarmed] "i"(_BV(COM1A1) | _BV(COM1B1)),
        [silent] "i"(0xFF & ~(JOINT == 0 ? _BV(OCIE1A) : _BV(OCIE1B))),
        [step_margin] "i"(planarm::step_engine::STEP_MARGIN_TICKS),
        [dir_margin] "i"(planarm::step_engine::DIR_MARGIN_TICKS), [most_ahead] "i"(planarm::MAX_AHEAD_TICKS),
        [dir_port] "I"(_SFR_IO_ADDR(PORTD)), [dir_bit] "I"(JOINT == 0 ? PORTD4 : PORTD5),
        [missed] "i"(&step_missed));
}

static_assert(planarm::step_engine::STEP_MARGIN_TICKS < 0x100, "the step margin is one byte here");

}  // namespace

ISR(TIMER1_COMPA_vect, ISR_NAKED) { step_interrupt<0>(); }

ISR(TIMER1_COMPB_vect, ISR_NAKED) { step_interrupt<1>(); }
