// Joints 2 and 3: Timer2's two interrupts step one each; they look at Timer1 for when.
//
// Timer2 counts at a 32nd of the clock and only wakes; Timer1 tells the time. A step takes two interrupts.
// The first, of the wake that was set for the step, raises the pin when the step is due, or nearly so, counts
// it, and sets a wake two counts later. The second, which finds the pin high, takes it low, computes the next
// edge as on_match of core/on_match.h does it, statement by statement, and sets the wake for that. So nothing
// else waits for longer than one of them takes, and between the two of a step others may come. The tick of
// the current step and its fraction are in the run itself.
//
// Whoever disarms the joints between the two takes the pins low: the interrupt that finds a step missed,
// timer 0's after an emergency (serial.cpp), and hal::wait_step_high. A freeze is not made then: it keeps a
// greater distance from a step than a pin rises early.
//
// Like the interrupts of joints 0 and 1 (step_interrupts.cpp) they need no stack and use registers that no
// compiled code uses: r2 to r11. Cycles with entry (4) and the jump from the vector (3), of joint 2 and of
// joint 3, counted by tests/firmware/test_firmware_scheduled.py:
//   rise                      61, 63, the pin rises after 40 and 41, 16 after the look at Timer1
//   a look too early          58, 59
//   one step after another   106, 105, the pin falls after 20
//   on in one direction       86, 84
//   on and back              107, 104
//   going idle                67, 64
//   a step missed             67, in a turn 103, 99
//
// The wake for a step is set so that the pin rises 93 to 161 ticks before its tick if nothing else runs. What
// may run when it comes: a step of another joint (joint 3's 105, joint 1's on the shield 90), a lock of the
// main program that begins right behind it (15, or 79 when a joint is started or a freeze finds joint 3
// too near), the instructions around it (4), and for joint 3 the interrupt of joint 2 (107, and 2). A freeze
// that finds joint 2 too near locks for 128, while joint 3's step is farther than 400 away. So joint
// 2 rises up to 122 ticks late, joint 3 up to 189. None rises more than 174 early: a look that comes for
// another reason and finds the step less than SCHEDULED_EARLY_TICKS away raises it at once.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>

#include "hal_step_timer.h"
#include "step_engine.h"

namespace hal {

volatile uint8_t scheduled_left[SCHEDULED_JOINTS];

volatile uint8_t& left_of_four(uint8_t joint) {
    return joint == 0 ? GPIOR0 : joint == 1 ? GPIOR1 : scheduled_left[joint - 2];
}

uint16_t edge_of_four(uint8_t joint) {
    if (joint == 0) return OCR1A;
    if (joint == 1) return OCR1B;
    const planarm::Run* const run =
        joint == 2 ? planarm::step_joints[2].active : planarm::step_joints[3].active;
    return static_cast<uint16_t>(run->first_ticks);
}

namespace {

// The nearest wake, in counts of Timer2: one that is set at the very end of a count comes after 64 ticks.
constexpr uint8_t WAKE_COUNTS = 2;

}  // namespace

void wake_scheduled(uint8_t mask) {
    volatile uint8_t& wake = mask == 4 * FIRST_MASK ? OCR2A : OCR2B;
    wake = static_cast<uint8_t>(TCNT2 + WAKE_COUNTS);
    TIMSK2 = static_cast<uint8_t>(TIMSK2 | mask >> 2);
}

}  // namespace hal

namespace {

using hal::SCHEDULED_EARLY_TICKS;
using planarm::Chain;
using planarm::Run;
using planarm::step_joints;
namespace engine = planarm::step_engine;
namespace wire = planarm::wire;

// A step that would rise later than 12 us after its tick is missed: the pin rises 16 after the look at
// Timer1.
constexpr uint16_t LATEST_TICKS = 192 - 16;

// What the nearest wake takes off the distance to an edge, beyond the early ticks.
constexpr uint8_t LEAST_TICKS = 63;

constexpr uint8_t port_of(uint8_t pin) { return static_cast<uint8_t>(hal::port_of(pin)); }

static_assert(static_cast<uint8_t>(Chain::NONE) == 0 && static_cast<uint8_t>(Chain::REVERSED) == 2,
              "tst, and bit 1 of r3");
static_assert(_SFR_MEM_ADDR(TCNT1) == _SFR_MEM_ADDR(TCCR1A) + 4, "%[tccra] + 4");
static_assert(_SFR_MEM_ADDR(TCNT2) == _SFR_MEM_ADDR(TCCR1A) + 0x32, "%[tccra] + 0x32");
static_assert(_SFR_MEM_ADDR(OCR2A) == _SFR_MEM_ADDR(TCCR1A) + 0x33, "%[tccra] + 0x33");
static_assert(_SFR_MEM_ADDR(OCR2B) == _SFR_MEM_ADDR(TCCR1A) + 0x34, "%[tccra] + 0x34");

}  // namespace

ISR(TIMER2_COMPA_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        in   r2, %[sreg]
        clt                             ; T tells joint 3 from joint 2
        movw r4, r30
        lds  r30, %[active]
        lds  r31, %[active] + 1
        lds  r3, %[left]
        sbis %[port2], %[bit2]
        rjmp 1f
        cbi  %[port2], %[bit2]
        rjmp 2f

        .global __vector_8              ; TIMER2_COMPB_vect
        .type __vector_8, @function
    __vector_8:
        in   r2, %[sreg]
        set
        movw r4, r30
        lds  r30, %[active] + %[stride]
        lds  r31, %[active] + %[stride] + 1
        lds  r3, %[left] + 1
        sbis %[port3], %[bit3]
        rjmp 1f
        cbi  %[port3], %[bit3]
    2:  tst  r3
        brne 20f
        rjmp 5f
    20: ldd  r6, Z + %[interval]
        ldd  r7, Z + %[interval] + 1
        ldd  r8, Z + %[interval] + 2
        ldd  r9, Z + %[interval] + 3
        ldd  r3, Z + %[fraction]        ; the next edge
        add  r3, r6
        std  Z + %[fraction], r3
        ldd  r3, Z + %[fraction] + 1
        adc  r3, r7
        std  Z + %[fraction] + 1, r3
        ldd  r10, Z + %[edge]
        adc  r10, r8
        std  Z + %[edge], r10
        ldd  r11, Z + %[edge] + 1
        adc  r11, r9
        std  Z + %[edge] + 1, r11
        ldd  r3, Z + %[add]             ; interval += add
        add  r6, r3
        std  Z + %[interval], r6
        ldd  r3, Z + %[add] + 1
        adc  r7, r3
        std  Z + %[interval] + 1, r7
        ldd  r3, Z + %[add] + 2
        adc  r8, r3
        std  Z + %[interval] + 2, r8
        ldd  r3, Z + %[add] + 3
        adc  r9, r3
        std  Z + %[interval] + 3, r9
    3:  lds  r30, %[tccra] + 4          ; how far is it?
        lds  r31, %[tccra] + 5
        sub  r10, r30
        sbc  r11, r31
        movw r30, r10
        subi r30, lo8(%[early])
        sbci r31, hi8(%[early])
    4:  sbiw r30, %[least]
        brpl 6f
    8:  ldi  r31, 0                     ; the nearest wake
        rjmp 7f
    6:  lsl  r30                        ; a 32nd of it in r31, modulo 256: an earlier wake looks again
        rol  r31
        lsl  r30
        rol  r31
        lsl  r30
        rol  r31
    7:  lds  r30, %[tccra] + 0x32
        subi r30, lo8(-(%[counts]))
        add  r30, r31
        brtc 9f
        sts  %[tccra] + 0x34, r30
        rjmp 10f
    9:  sts  %[tccra] + 0x33, r30
    10: movw r30, r4
        out  %[sreg], r2
        reti

    1:  ldd  r6, Z + %[edge]            ; is it due?
        ldd  r7, Z + %[edge] + 1
        lds  r30, %[tccra] + 4
        lds  r31, %[tccra] + 5
        sub  r6, r30
        sbc  r7, r31
        movw r30, r6
        subi r30, lo8(%[early])
        sbci r31, hi8(%[early])
        brpl 4b
        subi r30, lo8(-(%[early] + %[latest]))
        sbci r31, hi8(-(%[early] + %[latest]))
        brmi 11f
        dec  r3                         ; rise, and count it
        brts 12f
        sbi  %[port2], %[bit2]
        sts  %[left], r3
        rjmp 8b
    12: sbi  %[port3], %[bit3]
        sts  %[left] + 1, r3
        rjmp 8b

    5:  ldd  r6, Z + %[next]            ; the run is done
        ldd  r7, Z + %[next] + 1
        movw r30, r6
        ldd  r3, Z + %[steps]
        brts 13f
        sts  %[active], r6
        sts  %[active] + 1, r7
        sts  %[left], r3
        rjmp 14f
    13: sts  %[active] + %[stride], r6
        sts  %[active] + %[stride] + 1, r7
        sts  %[left] + 1, r3
    14: ldd  r10, Z + %[edge]
        ldd  r11, Z + %[edge] + 1
        ldd  r3, Z + %[chained]
        tst  r3
        breq 17f
        sbrs r3, 1
        rjmp 3b
        ldd  r3, Z + %[dir_high]        ; turn round
        brts 15f
        sbrc r3, 0
        sbi  %[dir_port2], %[dir_bit2]
        sbrs r3, 0
        cbi  %[dir_port2], %[dir_bit2]
        rjmp 16f
    15: sbrc r3, 0
        sbi  %[dir_port3], %[dir_bit3]
        sbrs r3, 0
        cbi  %[dir_port3], %[dir_bit3]
    16: movw r30, r10                   ; late?
        lds  r8, %[tccra] + 4
        lds  r9, %[tccra] + 5
        sub  r30, r8
        sbc  r31, r9
        subi r30, lo8(%[dir_margin])
        sbci r31, hi8(%[dir_margin])
        brmi 11f
        rjmp 3b
    11: jmp  missed_step

    17: lds  r30, %[timsk2]             ; go idle
        brts 18f
        andi r30, %[only3]
    18: brtc 19f
        andi r30, %[only2]
    19: sts  %[timsk2], r30
        rjmp 10b
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [active] "i"(&step_joints[2].active), [stride] "i"(sizeof(planarm::StepJoint)),
        [left] "i"(&hal::scheduled_left[0]), [early] "i"(SCHEDULED_EARLY_TICKS), [latest] "i"(LATEST_TICKS),
        [least] "I"(LEAST_TICKS), [counts] "i"(hal::WAKE_COUNTS), [interval] "I"(offsetof(Run, interval_q16)),
        [add] "I"(offsetof(Run, add_q16)), [fraction] "I"(offsetof(Run, fraction)),
        [edge] "I"(offsetof(Run, first_ticks)), [next] "I"(offsetof(Run, next)),
        [steps] "I"(offsetof(Run, steps)), [chained] "I"(offsetof(Run, chained)),
        [dir_high] "I"(offsetof(Run, dir_high)),
        [dir_margin] "i"(engine::DIR_MARGIN_TICKS + SCHEDULED_EARLY_TICKS), [tccra] "i"(&TCCR1A),
        [timsk2] "i"(&TIMSK2), [only2] "M"(_BV(OCIE2A)), [only3] "M"(_BV(OCIE2B)),
        [port2] "I"(port_of(wire::STEP_PINS[2])), [bit2] "I"(hal::bit_of(wire::STEP_PINS[2])),
        [port3] "I"(port_of(wire::STEP_PINS[3])), [bit3] "I"(hal::bit_of(wire::STEP_PINS[3])),
        [dir_port2] "I"(port_of(wire::DIR_PINS[2])), [dir_bit2] "I"(hal::bit_of(wire::DIR_PINS[2])),
        [dir_port3] "I"(port_of(wire::DIR_PINS[3])), [dir_bit3] "I"(hal::bit_of(wire::DIR_PINS[3])));
}
