// Timer1 of the ATmega328P, free-running at the CPU clock, and the pins that are stepped by it; ATmega328P
// datasheet, section 15. Which pins those are tells the board's wiring.h. A joint's step is made in one of
// three ways:
//
// COMPARE    joints 0 and 1 on OC1A and OC1B (D9, D10). A channel's compare output is in one of two modes.
//            Armed: the pin toggles at the match, so it rises, and a forced compare takes it low again.
//            Disarmed: the pin falls at the match, so a match means nothing to a low pin.
//            Where drivers need long pulses (SECOND_MATCH) an armed pin falls at a second match, and the
//            interrupt of the first only sets its tick: second_match.h.
// MATCH      joints 0 and 1 on any pins: the interrupt of the same match makes the pulse, whole.
// SCHEDULED  joints 2 and 3: Timer2's interrupt makes the pulse, whole, when Timer1 says so: scheduled.cpp.
//
// What the step interrupts of joints 0 and 1 need at every step is where IN and OUT reach it: the steps left
// of each joint's run in GPIOR0 and GPIOR1, its fraction in registers that no compiled code uses.
#pragma once

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdint.h>

#include "ports.h"
#include "wiring.h"

// The step interrupts must hold no calls.
#define HAL_INLINE inline __attribute__((always_inline))

namespace hal {

enum class Output : uint8_t { COMPARE, MATCH, SCHEDULED };

template <uint8_t JOINT>
constexpr Output output() {
    return JOINT >= 2                                                 ? Output::SCHEDULED
           : planarm::wire::STEP_PINS[JOINT] == (JOINT == 0 ? 9 : 10) ? Output::COMPARE
                                                                      : Output::MATCH;
}

// Whether pulses are so long that a second match ends them.
constexpr bool SECOND_MATCH = planarm::wire::MIN_STEP_HIGH_TICKS > 56;
static_assert(!SECOND_MATCH || (output<0>() == Output::COMPARE && planarm::wire::JOINTS == 2),
              "only compare outputs end pulses by themselves");

// Distance that an edge must still have when the interrupt that places it looks at the timer: the low time,
// less 2 between the fall and the look. With a second match the low time is what the intervals leave: no more
// than the way to the compare register.
constexpr uint16_t STEP_MARGIN_TICKS = SECOND_MATCH ? 14 : planarm::wire::MIN_STEP_LOW_TICKS - 2;
// The same for the main program, which starts a joint: its way to the output's mode and the interrupt is 32.
constexpr uint16_t START_MARGIN_TICKS = SECOND_MATCH ? 38 : STEP_MARGIN_TICKS;
static_assert(START_MARGIN_TICKS >= 38, "the way to TCCR1A");
static_assert(!SECOND_MATCH || planarm::wire::MIN_INTERVAL_TICKS - planarm::wire::MIN_STEP_HIGH_TICKS >=
                                   planarm::wire::MIN_STEP_LOW_TICKS,
              "the low time");

// COM bits with both channels disarmed; on other pins the compare outputs are left alone.
constexpr uint8_t ALL_DISARMED = output<0>() == Output::COMPARE ? _BV(COM1A1) | _BV(COM1B1) : 0;

// Timer1's interrupts while nothing steps.
constexpr uint8_t ONLY_LAPS = _BV(TOIE1);

// A joint that Timer2's interrupt steps.
struct ScheduledJoint {
    uint16_t edge;
    uint16_t fraction;
    uint8_t left;
};

constexpr uint8_t SCHEDULED_JOINTS = planarm::wire::JOINTS > 2 ? planarm::wire::JOINTS - 2 : 1;
extern ScheduledJoint scheduled[SCHEDULED_JOINTS];
// step_interrupt_mask of those that are on.
extern volatile uint8_t scheduled_on;
// A scheduled step may rise so much before its tick: two that are nearer to each other rise together.
constexpr uint16_t SCHEDULED_EARLY_TICKS = 180;

// Lets Timer2's interrupt come and look.
void wake_scheduled();

template <uint8_t JOINT>
HAL_INLINE ScheduledJoint& scheduled_joint() {
    return scheduled[JOINT < 2 ? 0 : JOINT - 2];
}

// Holds interrupts off while it lives.
class InterruptLock {
  public:
    HAL_INLINE InterruptLock() : saved_(SREG) { cli(); }
    HAL_INLINE ~InterruptLock() {
        compiler_fence();
        SREG = saved_;
    }
    InterruptLock(const InterruptLock&) = delete;
    InterruptLock& operator=(const InterruptLock&) = delete;

  private:
    static void compiler_fence() { __asm__ __volatile__("" ::: "memory"); }

    uint8_t saved_;
};

HAL_INLINE void compiler_barrier() { __asm__ __volatile__("" ::: "memory"); }

// Starts the timers with all channels disarmed. The counter starts at 0.
inline void step_timer_init() {
    TCCR1A = ALL_DISARMED;
    TCNT1 = 0;
    TIMSK1 = ONLY_LAPS;
    TCCR1B = _BV(CS10);
    if (planarm::wire::JOINTS > 2) TCCR2B = _BV(CS21) | _BV(CS20);  // a 32nd of the clock
}

// The timer's 16 bits. Interrupts must be off: they share the timer's TEMP register.
HAL_INLINE uint16_t counter() { return TCNT1; }

// How often the timer has gone round, modulo 256, as far as its interrupt has counted; and whether that is
// about to come. The interrupt takes 18 cycles, once in 65,536.
extern volatile uint8_t timer_laps;
HAL_INLINE uint8_t laps() { return timer_laps; }
HAL_INLINE bool lap_is_due() { return (TIFR1 & _BV(TOV1)) != 0; }

// How much before its tick a step may rise.
template <uint8_t JOINT>
constexpr uint16_t step_early_ticks() {
    return output<JOINT>() == Output::SCHEDULED ? SCHEDULED_EARLY_TICKS : 0;
}

template <uint8_t JOINT>
HAL_INLINE uint16_t step_edge() {
    return output<JOINT>() == Output::SCHEDULED ? scheduled_joint<JOINT>().edge : JOINT == 0 ? OCR1A : OCR1B;
}

// Sets the tick of the next match. Interrupts must be off.
template <uint8_t JOINT>
HAL_INLINE void step_set_edge(uint16_t tick) {
    if (output<JOINT>() == Output::SCHEDULED) {
        scheduled_joint<JOINT>().edge = tick;
    } else if (JOINT == 0) {
        OCR1A = tick;
    } else {
        OCR1B = tick;
    }
}

// The pin must be low.
template <uint8_t JOINT>
HAL_INLINE void step_arm() {
    if (output<JOINT>() != Output::COMPARE) return;
    constexpr uint8_t other = JOINT == 0 ? _BV(COM1B1) | _BV(COM1B0) : _BV(COM1A1) | _BV(COM1A0);
    TCCR1A = static_cast<uint8_t>((TCCR1A & other) | (JOINT == 0 ? _BV(COM1A0) : _BV(COM1B0)));
}

template <uint8_t JOINT>
HAL_INLINE void step_disarm() {
    if (output<JOINT>() != Output::COMPARE) return;
    constexpr uint8_t other = JOINT == 0 ? _BV(COM1B1) | _BV(COM1B0) : _BV(COM1A1) | _BV(COM1A0);
    TCCR1A = static_cast<uint8_t>((TCCR1A & other) | (JOINT == 0 ? _BV(COM1A1) : _BV(COM1B1)));
}

// Takes the pin low: on a compare output a high one when armed, any when disarmed.
template <uint8_t JOINT>
HAL_INLINE void step_fall() {
    if (output<JOINT>() == Output::COMPARE) {
        TCCR1C = JOINT == 0 ? _BV(FOC1A) : _BV(FOC1B);
    } else {
        write_pin(planarm::wire::STEP_PINS[JOINT], false);
    }
}

// Steps left of the active run, the current one included.
template <uint8_t JOINT>
HAL_INLINE uint8_t steps_left() {
    return output<JOINT>() == Output::SCHEDULED ? scheduled_joint<JOINT>().left
           : JOINT == 0                         ? GPIOR0
                                                : GPIOR1;
}

template <uint8_t JOINT>
HAL_INLINE void set_steps_left(uint8_t steps) {
    if (output<JOINT>() == Output::SCHEDULED) {
        scheduled_joint<JOINT>().left = steps;
    } else if (JOINT == 0) {
        GPIOR0 = steps;
    } else {
        GPIOR1 = steps;
    }
}

// Fraction of the current step's tick, in 2^-16. While the joint's interrupt is on, only it may ask. In
// step_interrupts.cpp and scheduled.cpp.
template <uint8_t JOINT>
uint16_t step_fraction();
template <uint8_t JOINT>
void set_step_fraction(uint16_t fraction);

// Main never sees a pulse that an interrupt makes whole.
template <uint8_t JOINT>
HAL_INLINE bool step_is_high() {
    return output<JOINT>() == Output::COMPARE && read_pin(planarm::wire::STEP_PINS[JOINT]);
}

// All step pins that the compare outputs drive, in one instruction; step_level tells a joint's. With a second
// match only those whose rise is not counted yet: OC1A and OC1B are the bits of PINB that OCF1A and OCF1B are
// of TIFR1. The flags are read first: a pulse that falls in between is counted.
HAL_INLINE uint8_t step_levels() {
    if (SECOND_MATCH) {
        const uint8_t matched = TIFR1;
        __asm__ __volatile__("nop");  // the pin is read a cycle later than it changes
        return matched & PINB;
    }
    return ALL_DISARMED != 0 ? PINB : 0;
}

// Whether a pulse that main sees high is counted already.
template <uint8_t JOINT>
HAL_INLINE bool step_is_counted() {
    return SECOND_MATCH && (TIFR1 & (JOINT == 0 ? _BV(OCF1A) : _BV(OCF1B))) == 0;
}

template <uint8_t JOINT>
HAL_INLINE bool step_level(uint8_t levels) {
    static_assert(output<JOINT>() != Output::COMPARE || port_of(planarm::wire::STEP_PINS[JOINT]) == Port::B,
                  "OC1A and OC1B are on port B");
    return output<JOINT>() == Output::COMPARE && (levels & mask_of(planarm::wire::STEP_PINS[JOINT])) != 0;
}

// Forgets a match that nobody waited for.
template <uint8_t JOINT>
HAL_INLINE void step_forget_match() {
    if (output<JOINT>() != Output::SCHEDULED) TIFR1 = JOINT == 0 ? _BV(OCF1A) : _BV(OCF1B);
}

template <uint8_t JOINT>
constexpr uint8_t step_interrupt_mask() {
    return JOINT == 0 ? _BV(OCIE1A) : JOINT == 1 ? _BV(OCIE1B) : static_cast<uint8_t>(0x04 << JOINT);
}

template <uint8_t JOINT>
HAL_INLINE void step_interrupt_on() {
    if (output<JOINT>() == Output::SCHEDULED) {
        scheduled_on = static_cast<uint8_t>(scheduled_on | step_interrupt_mask<JOINT>());
        wake_scheduled();
    } else {
        TIMSK1 = static_cast<uint8_t>(TIMSK1 | step_interrupt_mask<JOINT>());
    }
}

template <uint8_t JOINT>
HAL_INLINE void step_interrupt_off() {
    if (output<JOINT>() == Output::SCHEDULED) {
        scheduled_on = static_cast<uint8_t>(scheduled_on & ~step_interrupt_mask<JOINT>());
    } else {
        TIMSK1 = static_cast<uint8_t>(TIMSK1 & ~step_interrupt_mask<JOINT>());
    }
}

// The masks of the interrupts that are on.
HAL_INLINE uint8_t step_interrupts_on() {
    return planarm::wire::JOINTS > 2 ? static_cast<uint8_t>(TIMSK1 | scheduled_on) : TIMSK1;
}

template <uint8_t JOINT>
HAL_INLINE bool step_interrupt_is_on() {
    const uint8_t on = output<JOINT>() == Output::SCHEDULED ? scheduled_on : TIMSK1;
    return (on & step_interrupt_mask<JOINT>()) != 0;
}

HAL_INLINE void step_interrupts_off() {
    TIMSK1 = ONLY_LAPS;
    if (planarm::wire::JOINTS > 2) scheduled_on = TIMSK2 = 0;
}

// A step that is made at all may rise so much later than its tick, where an interrupt makes it.
constexpr uint16_t LATE_TICKS = output<0>() == Output::COMPARE && planarm::wire::JOINTS == 2 ? 0 : 512;

// From the reading of the timer in end_steps to the last match that its writing of TCCR1A lets act.
constexpr uint16_t END_TICKS = 4;

// Disarms all channels and stops their interrupts; a pin that is high stays high.
HAL_INLINE void steps_off() {
    TCCR1A = ALL_DISARMED;
    step_interrupts_off();
}

// The same; returns the last tick whose match still raised its pin. Interrupts must be off.
HAL_INLINE uint16_t end_steps() {
    uint16_t counter;
    __asm__ __volatile__(
        "lds %A0, %1\n\t"
        "lds %B0, %1 + 1\n\t"
        "sts %2, %3"
        : "=&r"(counter)
        : "i"(&TCNT1L), "i"(&TCCR1A), "r"(ALL_DISARMED));
    step_interrupts_off();
    return static_cast<uint16_t>(counter + END_TICKS);
}

// Turns of 3 cycles that pass the least high time of a pulse that may have risen just now.
constexpr uint8_t HIGH_TURNS = planarm::wire::MIN_STEP_HIGH_TICKS / 3 + 1;

inline void wait_step_high() {
    uint8_t turns = HIGH_TURNS;
    __asm__ __volatile__("1: dec %0\n\tbrne 1b" : "+r"(turns));
}

template <uint8_t JOINT>
HAL_INLINE bool dir_is(bool positive) {
    return written_pin(planarm::wire::DIR_PINS[JOINT]) == positive;
}

// One instruction, so no lock is needed.
template <uint8_t JOINT>
HAL_INLINE void dir_write(bool positive) {
    write_pin(planarm::wire::DIR_PINS[JOINT], positive);
}

}  // namespace hal
