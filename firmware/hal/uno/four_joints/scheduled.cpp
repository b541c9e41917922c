// Joints 2 and 3: both are stepped by Timer2's interrupt, which looks at Timer1 for when.
//
// Timer2 counts at a 32nd of the clock and only wakes; Timer1 tells the time. A joint whose step is due, or
// nearly so, is raised at once, both joints in the same few cycles; only then each step is counted, its pulse
// taken low and its next edge computed, as on_match of core/on_match.h does it, statement by
// statement. So neither waits for the other's computation: a step rises at most SCHEDULED_EARLY_TICKS early,
// or as late as Timer2's grain and another interrupt hold this one up.
//
// Like the interrupts of joints 0 and 1 (step_interrupts.cpp) it needs no stack and uses the registers that
// no compiled code uses. Cycles with entry and jump, counted by
// tests/firmware/test_firmware_boards.py: a look 62 to 76, one joint's step 127 to 210 with the looks before
// and after it, both joints' 278 to 288.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>

#include "hal_step_timer.h"
#include "step_engine.h"

namespace hal {

ScheduledJoint scheduled[SCHEDULED_JOINTS];
volatile uint8_t scheduled_on;

volatile uint8_t& left_of_four(uint8_t joint) {
    return joint == 0 ? GPIOR0 : joint == 1 ? GPIOR1 : scheduled[joint - 2].left;
}

void wake_scheduled() {
    // A wake-up of the other joint that is nearer stays, and one that is due is not forgotten: each look sets
    // the next.
    const bool is_nearer = (TIMSK2 & _BV(OCIE2A)) != 0 && static_cast<uint8_t>(OCR2A - TCNT2) <= 2;
    if (!is_nearer) OCR2A = static_cast<uint8_t>(TCNT2 + 2);
    TIMSK2 = _BV(OCIE2A);
}

}  // namespace hal

namespace {

using hal::SCHEDULED_EARLY_TICKS;
using hal::ScheduledJoint;
using planarm::Chain;
using planarm::Run;
using planarm::step_joints;
using planarm::step_missed;
namespace engine = planarm::step_engine;
namespace wire = planarm::wire;

// From the look at Timer1 to the setting of Timer2.
constexpr uint16_t LOOK_TICKS = 40;
// A step that would rise later than 12 us after its tick is missed: joint 2's pin rises 20 after the look at
// Timer1, joint 3's 40 when joint 2 is on.
constexpr uint16_t LATEST_TICKS = 192 - 20;
// As far as Timer2 wakes, less the early ticks: 240 of its counts.
constexpr uint16_t FARTHEST_TICKS = 240 * 32 - SCHEDULED_EARLY_TICKS;

constexpr uint8_t port_of(uint8_t pin) { return static_cast<uint8_t>(hal::port_of(pin)); }

static_assert(offsetof(ScheduledJoint, edge) == 0 && offsetof(ScheduledJoint, left) == 2 &&
                  sizeof(ScheduledJoint) == 3 && sizeof(planarm::StepJoint) == 95,
              "the macros' offsets");
static_assert(static_cast<uint8_t>(Chain::NONE) == 0 && static_cast<uint8_t>(Chain::REVERSED) == 2,
              "likewise");
static_assert(hal::FIRST_MASK << 2 == 0x08, "bits of r3");
static_assert(hal::ONLY_LAPS == 1, "what a missed step leaves on");
static_assert(_SFR_MEM_ADDR(TIMSK2) == _SFR_MEM_ADDR(TIMSK1) + 1, "%[timsk] + 1");
static_assert(_SFR_MEM_ADDR(TCNT2) == _SFR_MEM_ADDR(TCCR1A) + 0x32, "%[tccra] + 0x32");
static_assert(_SFR_MEM_ADDR(OCR2A) == _SFR_MEM_ADDR(TCCR1A) + 0x33, "%[tccra] + 0x33");
static_assert(_SFR_MEM_ADDR(TCNT1) == _SFR_MEM_ADDR(TCCR1A) + 4, "%[tccra] + 4");

}  // namespace

ISR(TIMER2_COMPA_vect, ISR_NAKED) {
    __asm__ __volatile__(
        R"(
        ; look JOINT, PORT, BIT: raises the pin and notes it in r10 when the step is due, else finds the nearest
        .macro look joint port bit
        sbrs r3, 3 + \joint
        rjmp 1f
        lds  r24, %[joints] + 3 * \joint
        lds  r25, %[joints] + 3 * \joint + 1
        sub  r24, r8
        sbc  r25, r9
        subi r24, lo8(%[early])
        sbci r25, hi8(%[early])
        brmi 2f
        cp   r24, r30
        cpc  r25, r31
        brsh 1f
        movw r30, r24
        rjmp 1f
    2:  subi r24, lo8(-(%[early] + %[latest] - 20 * \joint))  ; a step that is too late is not made
        sbci r25, hi8(-(%[early] + %[latest] - 20 * \joint))
        brpl 3f
        rjmp 75f
    3:  sbi  \port, \bit
        ldi  r24, 1 + \joint
        or   r10, r24
    1:
        .endm

        ; step JOINT, ...: counts the step that has risen, lets it fall, and places the next one
        .macro finish joint port bit            ; a pulse that has risen and is not counted yet
        sbis \port - 2, \bit
        rjmp 1f
        lds  r24, %[joints] + 3 * \joint + 2
        dec  r24
        sts  %[joints] + 3 * \joint + 2, r24
        cbi  \port, \bit
    1:
        .endm

        .macro step joint port bit dir_port dir_bit
        lds  r30, %[active] + 95 * \joint
        lds  r31, %[active] + 95 * \joint + 1
        lds  r24, %[joints] + 3 * \joint + 2
        dec  r24
        sts  %[joints] + 3 * \joint + 2, r24
        breq 1f
        ldd  r8, Z + %[interval]
        ldd  r9, Z + %[interval] + 1
        ldd  r10, Z + %[interval] + 2
        ldd  r11, Z + %[interval] + 3
        lds  r24, %[joints] + 3 * \joint       ; the next edge
        lds  r25, %[joints] + 3 * \joint + 1
        ldd  r3, Z + %[fraction]
        add  r3, r8
        std  Z + %[fraction], r3
        ldd  r3, Z + %[fraction] + 1
        adc  r3, r9
        std  Z + %[fraction] + 1, r3
        adc  r24, r10
        adc  r25, r11
        ldd  r3, Z + %[add]                    ; interval += add
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
        cbi  \port, \bit                       ; fall
        ldi  r30, lo8(%[step_margin])
        ldi  r31, hi8(%[step_margin])
        rjmp 3f

    1:  ldd  r24, Z + %[next]                  ; the run is done
        ldd  r25, Z + %[next] + 1
        sts  %[active] + 95 * \joint, r24
        sts  %[active] + 95 * \joint + 1, r25
        movw r30, r24
        ldd  r24, Z + %[steps]
        sts  %[joints] + 3 * \joint + 2, r24
        rjmp .+0
        rjmp .+0
        rjmp .+0
        rjmp .+0
        ldd  r24, Z + %[first]
        ldd  r25, Z + %[first] + 1
        ldd  r3, Z + %[chained]
        rjmp .+0                               ; the pulse is long enough
        rjmp .+0
        rjmp .+0
        cbi  \port, \bit                       ; fall
        tst  r3
        brne 2f
        lds  r24, %[on]                        ; go idle
        andi r24, 0xFF - (0x08 << \joint)
        sts  %[on], r24
        rjmp 4f
    2:  ldd  r9, Z + %[dir_high]
        ldi  r30, lo8(%[step_margin])
        ldi  r31, hi8(%[step_margin])
        sbrs r3, 1
        rjmp 3f
        sbrc r9, 0                             ; turn round
        sbi  \dir_port, \dir_bit
        sbrs r9, 0
        cbi  \dir_port, \dir_bit
        ldi  r30, lo8(%[dir_margin])
        ldi  r31, hi8(%[dir_margin])
    3:  sts  %[joints] + 3 * \joint, r24
        sts  %[joints] + 3 * \joint + 1, r25
        lds  r8, %[tccra] + 4                  ; late?
        lds  r9, %[tccra] + 5
        sub  r24, r8
        sbc  r25, r9
        sub  r24, r30
        sbc  r25, r31
        brpl 4f
        rjmp 75f
    4:
        .endm

        in   r2, %[sreg]
        movw r4, r30
        movw r6, r24
    70: lds  r3, %[on]
        tst  r3
        brne 77f
        rjmp 74f
    77: clr  r10
        ldi  r30, lo8(%[farthest])
        ldi  r31, hi8(%[farthest])
        lds  r8, %[tccra] + 4
        lds  r9, %[tccra] + 5
        look 0 %[port2] %[bit2]
        look 1 %[port3] %[bit3]
        tst  r10
        brne 71f
        subi r30, lo8(-(%[early] - %[look_ticks]))
        sbci r31, hi8(-(%[early] - %[look_ticks]))
        lsl  r30                               ; a 32nd of it in r31
        rol  r31
        lsl  r30
        rol  r31
        lsl  r30
        rol  r31
        lds  r24, %[tccra] + 0x32
        add  r31, r24
        sts  %[tccra] + 0x33, r31
    76: movw r24, r6
        movw r30, r4
        out  %[sreg], r2
        reti

    71: bst  r10, 1
        sbrs r10, 0
        rjmp 72f
        step 0 %[port2] %[bit2] %[dir_port2] %[dir_bit2]
    72: brts 73f
        rjmp 70b
    73: step 1 %[port3] %[bit3] %[dir_port3] %[dir_bit3]
        rjmp 70b

    75: ldi  r24, 16                           ; a step is missed
    78: dec  r24
        brne 78b
        finish 0 %[port2] %[bit2]
        finish 1 %[port3] %[bit3]
        lds  r24, %[timsk]
        lds  r25, %[on]
        or   r24, r25
        sts  %[missed], r24
        ldi  r24, %[all_disarmed]
        sts  %[tccra], r24
        ldi  r24, 1                            ; hal::ONLY_LAPS
        sts  %[timsk], r24
        ldi  r24, 0
        sts  %[on], r24
    74: ldi  r24, 0
        sts  %[timsk] + 1, r24
        rjmp 76b
        .purgem look
        .purgem step
        .purgem finish
        )" ::[sreg] "I"(_SFR_IO_ADDR(SREG)),
        [on] "i"(&hal::scheduled_on), [joints] "i"(&hal::scheduled[0]), [active] "i"(&step_joints[2].active),
        [early] "i"(SCHEDULED_EARLY_TICKS), [look_ticks] "i"(LOOK_TICKS), [farthest] "i"(FARTHEST_TICKS),
        [latest] "i"(LATEST_TICKS), [interval] "I"(offsetof(Run, interval_q16)),
        [add] "I"(offsetof(Run, add_q16)), [next] "I"(offsetof(Run, next)), [steps] "I"(offsetof(Run, steps)),
        [fraction] "I"(offsetof(Run, fraction)), [first] "I"(offsetof(Run, first_ticks)),
        [chained] "I"(offsetof(Run, chained)), [dir_high] "I"(offsetof(Run, dir_high)),
        [step_margin] "i"(engine::STEP_MARGIN_TICKS + SCHEDULED_EARLY_TICKS),
        [dir_margin] "i"(engine::DIR_MARGIN_TICKS + SCHEDULED_EARLY_TICKS), [tccra] "i"(&TCCR1A),
        [timsk] "i"(&TIMSK1), [missed] "i"(&step_missed), [all_disarmed] "i"(hal::ALL_DISARMED),
        [port2] "I"(port_of(wire::STEP_PINS[2])), [bit2] "I"(hal::bit_of(wire::STEP_PINS[2])),
        [port3] "I"(port_of(wire::STEP_PINS[3])), [bit3] "I"(hal::bit_of(wire::STEP_PINS[3])),
        [dir_port2] "I"(port_of(wire::DIR_PINS[2])), [dir_bit2] "I"(hal::bit_of(wire::DIR_PINS[2])),
        [dir_port3] "I"(port_of(wire::DIR_PINS[3])), [dir_bit3] "I"(hal::bit_of(wire::DIR_PINS[3])));
}
