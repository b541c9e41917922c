// The step interrupts in assembler: on_match of core/on_match.h, statement by statement.
//
// No compiled or library code uses r2 to r11: platformio.ini keeps the compiler off them, build.py checks the
// linked program. The interrupts, which never nest, need no stack. Here they hold
//   r2         the status register         r6, r7     the next edge
//   r4, r5     the interrupted code's Z    r8 to r11  interval; at a turn DIR's port
//   r3         a byte on its way
// and, where every cycle counts (hal::FRACTIONS_IN_REGISTERS), the fractions in r12 to r15, which are kept
// from the compiler there, too; other boards have them in the runs.
//
// Cycles from the match, if nothing else runs, with entry (4) and the jump from the vector (3):
//                            all    pin falls   look at the timer   next edge placed
//   one step after another    75       56              58                69
//   on in one direction       75       56              58                69
//   on and back               77       56              59                71
//   going idle                73       56
//   a step missed             82, of joint 2 84
// With the fraction in the run one step after another takes 83, and the pin falls after 64. With four joints
// a step missed takes 94 and 96, on the shield 103 and 105, in a turn 107 and 109: joints 3 and 4 end there,
// too. tests/firmware/test_firmware_cycles.py counts them. The least interval of one joint covers what may
// run when its step rises: what is left of a receive interrupt without room (39), a lock of the main program
// (11), the other joint's interrupt (in a turn 77), the one instruction that comes between two interrupts
// (2), its own way to the look at the timer (58), and what that asks for (38): 225, all of it. So a lock and
// the two instructions behind it may take 13 cycles: tests/firmware/test_release.py looks at each.
// From a step to one back the look comes after 59 and asks for the DIR setup time (320).

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>

#include "step_engine.h"

namespace {

using planarm::Chain;
using planarm::Run;
using planarm::step_joints;
using planarm::step_missed;

namespace wire = planarm::wire;

constexpr uint8_t port_of(uint8_t pin) { return static_cast<uint8_t>(hal::port_of(pin)); }

static_assert(static_cast<uint8_t>(Chain::NONE) == 0, "tst finds a joint that goes idle");
static_assert(static_cast<uint8_t>(Chain::REVERSED) == 2, "bit 1 finds a reversal");
// An asm takes thirty operands; these are told by their neighbours.
static_assert(_SFR_MEM_ADDR(TCCR1C) == _SFR_MEM_ADDR(TCCR1A) + 2, "%[tccra] + 2");
static_assert(_SFR_MEM_ADDR(TCNT1) == _SFR_MEM_ADDR(TCCR1A) + 4, "%[tccra] + 4");
static_assert(_SFR_MEM_ADDR(TIMSK2) == _SFR_MEM_ADDR(TIMSK1) + 1, "%[timsk] + 1");
static_assert(_BV(FOC1B) == 0x40, "%[foc] tells joint 2");
static_assert(hal::ONLY_LAPS == 1, "what a missed step leaves on");
static_assert(sizeof(Run*) == 2 && sizeof(bool) == 1, "widths of loads");
// At a turn DIR's port is read before the pulse falls and written after it.
static_assert(hal::output<0>() != hal::Output::COMPARE ||
                  (port_of(wire::DIR_PINS[0]) != port_of(wire::STEP_PINS[0]) &&
                   port_of(wire::DIR_PINS[1]) != port_of(wire::STEP_PINS[1])),
              "no step pin that changes in between");

// Ports and bits of joints 3 and 4, a byte each; 0 without them.
constexpr uint32_t pin_bytes(uint8_t pin) {
    return static_cast<uint32_t>(port_of(pin)) << 8 | hal::bit_of(pin);
}
constexpr uint32_t SCHEDULED_PINS = wire::JOINTS > 2 ? pin_bytes(wire::STEP_PINS[2 % wire::JOINTS]) << 16 |
                                                           pin_bytes(wire::STEP_PINS[3 % wire::JOINTS])
                                                     : 0;

// The first of the joint's two registers for the fraction, 0 where that is in the run; the assembler takes
// registers by number.
constexpr uint8_t fraction_register(uint8_t joint) {
    return static_cast<uint8_t>(!hal::FRACTIONS_IN_REGISTERS ? 0 : joint == 0 ? 12 : 14);
}

}  // namespace

#include "second_match.h"

namespace {

template <uint8_t JOINT>
HAL_INLINE void step_interrupt() {
    __asm__ __volatile__(
        R"(
        .if %[by_match]
        sbi  %[step_port], %[step_bit]  ; rise
        .endif
        in   r2, %[sreg]
        movw r4, r30
        lds  r30, %[active]
        lds  r31, %[active] + 1
        in   r3, %[left]                ; count the step
        dec  r3
        out  %[left], r3
        breq 1f

        ldd  r8, Z + %[interval]
        ldd  r9, Z + %[interval] + 1
        ldd  r10, Z + %[interval] + 2
        ldd  r11, Z + %[interval] + 3
        .if %[part] == 0
        ldd  r3, Z + %[fraction]        ; fraction += interval
        add  r3, r8
        std  Z + %[fraction], r3
        ldd  r3, Z + %[fraction] + 1
        adc  r3, r9
        std  Z + %[fraction] + 1, r3
        .endif
        lds  r6, %[ocr]                 ; the next edge
        lds  r7, %[ocr] + 1
        .if %[part]
        add  %[part], r8
        adc  %[part] + 1, r9
        .endif
        adc  r6, r10
        adc  r7, r11
        ldd  r3, Z + %[add]             ; interval += add
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
    8:
        .if %[by_match]
        .if %[part]
        rjmp .+0                        ; the pulse rose 9 cycles after the match
        rjmp .+0
        rjmp .+0
        rjmp .+0
        .endif
        cbi  %[step_port], %[step_bit]  ; fall
        .else
        ldi  r30, %[foc]                ; fall
        sts  %[tccra] + 2, r30
        .endif
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

    1:  ldd  r6, Z + %[next]            ; the run is done
        ldd  r7, Z + %[next] + 1
        sts  %[active], r6
        sts  %[active] + 1, r7
        movw r30, r6
        ldd  r3, Z + %[steps]
        out  %[left], r3
        .if %[part]
        ldd  %[part], Z + %[fraction]
        ldd  %[part] + 1, Z + %[fraction] + 1
        .endif
        ldd  r6, Z + %[first]
        ldd  r7, Z + %[first] + 1
        ldd  r3, Z + %[chained]
        ldd  r8, Z + %[dir_high]        ; what DIR's port will be
        in   r9, %[dir_port]
        bst  r8, 0
        bld  r9, %[dir_bit]
        .if %[part]
        rjmp .+0                        ; the pulse is as long as any other
        nop
        .elseif %[by_match]
        ldi  r30, 5                     ; the pulse is as long as it must be
    7:  dec  r30
        brne 7b
        .else
        nop
        ldi  r30, 2
    7:  dec  r30
        brne 7b
        .endif
        tst  r3
        breq 4f
        sbrs r3, 1
        rjmp 8b

        nop                             ; turn round
        .if %[by_match]
        .if %[part]
        rjmp .+0
        rjmp .+0
        rjmp .+0
        rjmp .+0
        .endif
        cbi  %[step_port], %[step_bit]
        sbrc r8, 0
        sbi  %[dir_port], %[dir_bit]
        sbrs r8, 0
        cbi  %[dir_port], %[dir_bit]
        .else
        ldi  r30, %[foc]
        sts  %[tccra] + 2, r30
        out  %[dir_port], r9
        .endif
        lds  r30, %[tccra] + 4          ; late?
        lds  r31, %[tccra] + 5
        subi r30, lo8(-(%[dir_margin]))
        sbci r31, hi8(-(%[dir_margin]))
        cp   r6, r30
        cpc  r7, r31
        brpl 9b

    5:
        .if %[foc] == 0x40               ; a step is missed: joint 1 has it
        rjmp missed_step
        .else
        .global missed_step             ; with Z in r4, SREG in r2; scheduled.cpp comes here, too
    missed_step:
        lds  r30, %[timsk]
        .if %[scheduled]
        lds  r31, %[timsk] + 1
        lsl  r31
        lsl  r31
        or   r30, r31
        .endif
        sts  %[missed], r30
        ldi  r30, %[all_disarmed]
        sts  %[tccra], r30
        ldi  r30, 1                     ; hal::ONLY_LAPS
        sts  %[timsk], r30
        .if %[scheduled]
        ldi  r30, 0
        sts  %[timsk] + 1, r30
        cbi  %[scheduled] >> 24, (%[scheduled] >> 16) & 7  ; a pulse that rose more than 56 cycles ago
        cbi  (%[scheduled] >> 8) & 31, %[scheduled] & 7    ; and is counted
        .endif
        movw r30, r4
        out  %[sreg], r2
        reti
        .endif

    4:  rjmp .+0                        ; go idle
        .if %[by_match]
        .if %[part]
        rjmp .+0
        rjmp .+0
        rjmp .+0
        rjmp .+0
        .endif
        cbi  %[step_port], %[step_bit]
        .else
        ldi  r30, %[foc]
        sts  %[tccra] + 2, r30
        lds  r30, %[tccra]
        andi r30, %[other]
        ori  r30, %[disarmed]
        sts  %[tccra], r30
        .endif
        lds  r30, %[timsk]
        andi r30, %[silent]
        sts  %[timsk], r30
        movw r30, r4
        out  %[sreg], r2
        reti
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [left] "I"(_SFR_IO_ADDR(JOINT == 0 ? GPIOR0 : GPIOR1)), [active] "i"(&step_joints[JOINT].active),
        [part] "I"(fraction_register(JOINT)), [steps] "I"(offsetof(Run, steps)),
        [fraction] "I"(offsetof(Run, fraction)), [interval] "I"(offsetof(Run, interval_q16)),
        [add] "I"(offsetof(Run, add_q16)), [next] "I"(offsetof(Run, next)),
        [chained] "I"(offsetof(Run, chained)), [first] "I"(offsetof(Run, first_ticks)),
        [dir_high] "I"(offsetof(Run, dir_high)), [ocr] "i"(JOINT == 0 ? &OCR1AL : &OCR1BL),
        [tccra] "i"(&TCCR1A), [timsk] "i"(&TIMSK1), [foc] "i"(JOINT == 0 ? _BV(FOC1A) : _BV(FOC1B)),
        [other] "i"(JOINT == 0 ? _BV(COM1B1) | _BV(COM1B0) : _BV(COM1A1) | _BV(COM1A0)),
        [disarmed] "i"(JOINT == 0 ? _BV(COM1A1) : _BV(COM1B1)), [all_disarmed] "i"(hal::ALL_DISARMED),
        [silent] "i"(0xFF & ~(JOINT == 0 ? _BV(OCIE1A) : _BV(OCIE1B))),
        [step_margin] "i"(planarm::step_engine::STEP_MARGIN_TICKS),
        [dir_margin] "i"(planarm::step_engine::DIR_MARGIN_TICKS),
        [dir_port] "I"(port_of(wire::DIR_PINS[JOINT])), [dir_bit] "I"(hal::bit_of(wire::DIR_PINS[JOINT])),
        [missed] "i"(&step_missed), [by_match] "n"(hal::output<JOINT>() == hal::Output::MATCH ? 1 : 0),
        [step_port] "I"(port_of(wire::STEP_PINS[JOINT])), [step_bit] "I"(hal::bit_of(wire::STEP_PINS[JOINT])),
        [scheduled] "n"(SCHEDULED_PINS));
}

}  // namespace

namespace hal {

uint16_t step_fraction(uint8_t joint) {
    uint16_t fraction;
    if (joint == 0) {
        __asm__ __volatile__("movw %0, r12" : "=r"(fraction));
    } else {
        __asm__ __volatile__("movw %0, r14" : "=r"(fraction));
    }
    return fraction;
}

void set_step_fraction(uint8_t joint, uint16_t fraction) {
    if (joint == 0) {
        __asm__ __volatile__("movw r12, %0" ::"r"(fraction));
    } else {
        __asm__ __volatile__("movw r14, %0" ::"r"(fraction));
    }
}

volatile uint8_t timer_laps;

}  // namespace hal

ISR(TIMER1_OVF_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        in   r2, %[sreg]
        lds  r3, %[laps]
        inc  r3
        sts  %[laps], r3
        out  %[sreg], r2
        reti
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [laps] "i"(&hal::timer_laps));
}

ISR(TIMER1_COMPA_vect, ISR_NAKED) {
    if (hal::SECOND_MATCH) {
        second_match_interrupt<0>();
    } else {
        step_interrupt<0>();
    }
}

ISR(TIMER1_COMPB_vect, ISR_NAKED) {
    if (hal::SECOND_MATCH) {
        second_match_interrupt<1>();
    } else {
        step_interrupt<1>();
    }
}
