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
// SCHEDULED  joints 2 and 3: Timer2's interrupts make the pulse, one each edge, when Timer1 says so:
//            scheduled.cpp.
//
// What the step interrupts of joints 0 and 1 need at every step is where IN and OUT reach it: the steps left
// of each joint's run in GPIOR0 and GPIOR1.
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

// Where every cycle of a step counts its fraction is in registers that no compiled code uses: r12 to r15,
// which platformio.ini keeps from the compiler for those boards. A step takes 8 cycles less then, the image
// some 700 bytes more.
constexpr bool FRACTIONS_IN_REGISTERS = planarm::wire::JOINTS == 2 && !SECOND_MATCH;

// Distance that an edge must still have when the interrupt that places it looks at the timer: the low time,
// less 2 between the fall and the look. With a second match the low time is what the intervals leave: no more
// than the way to the compare register.
constexpr uint16_t STEP_MARGIN_TICKS = SECOND_MATCH ? 14 : planarm::wire::MIN_STEP_LOW_TICKS - 2;
// The same for the main program, which starts a joint: its way to the output's mode is up to 21, to the
// interrupt up to 26 (tests/firmware/test_firmware_locks.py).
constexpr uint16_t START_MARGIN_TICKS = SECOND_MATCH ? 38 : STEP_MARGIN_TICKS;
static_assert(START_MARGIN_TICKS >= 26, "the way to TIMSK1");
static_assert(!SECOND_MATCH || planarm::wire::MIN_INTERVAL_TICKS - planarm::wire::MIN_STEP_HIGH_TICKS >=
                                   planarm::wire::MIN_STEP_LOW_TICKS,
              "the low time");

// COM bits with both channels disarmed; on other pins the compare outputs are left alone.
constexpr uint8_t ALL_DISARMED = output<0>() == Output::COMPARE ? _BV(COM1A1) | _BV(COM1B1) : 0;

// Timer1's interrupts while nothing steps.
constexpr uint8_t ONLY_LAPS = _BV(TOIE1);

HAL_INLINE bool is_scheduled(uint8_t joint) { return planarm::wire::JOINTS > 2 && joint >= 2; }
// Steps left of joints that Timer2's interrupts step. A step is counted when its pin rises; the tick of the
// current one and its fraction are in the run.
constexpr uint8_t SCHEDULED_JOINTS = planarm::wire::JOINTS > 2 ? planarm::wire::JOINTS - 2 : 1;
extern volatile uint8_t scheduled_left[SCHEDULED_JOINTS];
// A scheduled step may rise so much before its tick.
constexpr uint16_t SCHEDULED_EARLY_TICKS = 190;

// Lets the interrupt of a scheduled joint, told by its bit, come and look.
void wake_scheduled(uint8_t mask);

// The last emergency's cause, as an interrupt wrote it, and whether the host knows (serial.cpp).
extern volatile uint8_t emergency_state;
constexpr uint8_t EMERGENCY_CAUSE = 0x03;
HAL_INLINE bool has_emergency() { return (emergency_state & EMERGENCY_CAUSE) != 0; }

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
HAL_INLINE uint16_t step_early_ticks(uint8_t joint) {
    return is_scheduled(joint) ? SCHEDULED_EARLY_TICKS : 0;
}

// The tick of the next step, or of the last one until its interrupt has placed the next. Scheduled joints
// find it in their run. Interrupts must be off.
static_assert(_SFR_MEM_ADDR(OCR1B) == _SFR_MEM_ADDR(OCR1A) + 2, "an array");
uint16_t edge_of_four(uint8_t joint);
HAL_INLINE uint16_t step_edge(uint8_t joint) {
    return planarm::wire::JOINTS > 2 ? edge_of_four(joint) : (&OCR1A)[joint];
}
HAL_INLINE void step_set_edge(uint8_t joint, uint16_t tick) {
    if (!is_scheduled(joint)) (&OCR1A)[joint] = tick;
}

// Takes the pins of disarmed compare outputs low.
HAL_INLINE void steps_fall() {
    if (output<0>() == Output::COMPARE) TCCR1C = _BV(FOC1A) | _BV(FOC1B);
}

// Steps left of the active run, the current one included.
volatile uint8_t& left_of_four(uint8_t joint);  // a call takes less code where there are four
HAL_INLINE volatile uint8_t& left_of(uint8_t joint) {
    if (__builtin_constant_p(joint))
        return joint == 0 ? GPIOR0 : joint == 1 ? GPIOR1 : scheduled_left[joint - 2];
    return planarm::wire::JOINTS > 2 ? left_of_four(joint) : joint == 0 ? GPIOR0 : GPIOR1;
}
HAL_INLINE uint8_t steps_left(uint8_t joint) { return left_of(joint); }
HAL_INLINE void count_step(uint8_t joint) {
    volatile uint8_t& left = left_of(joint);
    left = static_cast<uint8_t>(left - 1);
}
HAL_INLINE void set_steps_left(uint8_t joint, uint8_t steps) { left_of(joint) = steps; }

// The fraction of the current step's tick, in 2^-16, where registers hold it (step_interrupts.cpp). While the
// joint's interrupt is on, only it may ask. Elsewhere it is in the run.
uint16_t step_fraction(uint8_t joint);
void set_step_fraction(uint8_t joint, uint16_t fraction);

// Each joint has a bit, joint 0 this one and each further joint twice the one before: in TIMSK1, TIFR1 and,
// as OC1A and OC1B, in PINB, and in what tells all joints'.
constexpr uint8_t FIRST_MASK = _BV(OCIE1A);
static_assert(4 * FIRST_MASK == _BV(OCIE2A) << 2 && 8 * FIRST_MASK == _BV(OCIE2B) << 2, "TIMSK2, twice left");
static_assert(FIRST_MASK == _BV(OCF1A) && 2 * FIRST_MASK == _BV(OCIE1B) && 2 * FIRST_MASK == _BV(OCF1B),
              "TIFR1");
constexpr uint8_t COMPARE_PINS = output<0>() == Output::COMPARE ? mask_of(9) | mask_of(10) : 0;
static_assert(FIRST_MASK == mask_of(9) && 2 * FIRST_MASK == mask_of(10), "PINB");

// Of the step pins those that are high. Main never sees a pulse that an interrupt makes whole, and scheduled
// ones, counted when they rise, are near enough to their tick to be no matter.
HAL_INLINE uint8_t step_levels_high() { return COMPARE_PINS != 0 ? PINB & COMPARE_PINS : 0; }

// The same of those whose rise is not counted yet, in an instruction or two. With a second match the flags
// are read first: a pulse that falls in between is counted.
HAL_INLINE uint8_t step_levels() {
    if (SECOND_MATCH) {
        const uint8_t matched = TIFR1;
        __asm__ __volatile__("nop");  // the pin is read a cycle later than it changes
        return matched & PINB;
    }
    return COMPARE_PINS != 0 ? PINB : 0;
}

// Forgets a match that nobody waited for.
HAL_INLINE void step_forget_match(uint8_t joint, uint8_t mask) {
    if (!is_scheduled(joint)) TIFR1 = mask;
}

// Lets a joint's interrupt come; its pin must be low and disarmed.
HAL_INLINE void step_start(uint8_t joint, uint8_t mask) {
    if (is_scheduled(joint)) {
        wake_scheduled(mask);
        return;
    }
    if (COMPARE_PINS != 0) {
        // From 2 to 1: the match no longer takes the pin low, but toggles it.
        constexpr uint8_t first = _BV(COM1A1) | _BV(COM1A0), second = _BV(COM1B1) | _BV(COM1B0);
        TCCR1A = static_cast<uint8_t>(TCCR1A ^ (joint == 0 ? first : second));
    }
    TIMSK1 = static_cast<uint8_t>(TIMSK1 | mask);
}

// The bits of the joints whose interrupts are on, and others.
HAL_INLINE uint8_t step_interrupts_on() {
    return planarm::wire::JOINTS > 2 ? static_cast<uint8_t>(TIMSK1 | TIMSK2 << 2) : TIMSK1;
}

HAL_INLINE void step_interrupts_off() {
    TIMSK1 = ONLY_LAPS;
    if (planarm::wire::JOINTS > 2) TIMSK2 = 0;
}

// A step that is made at all may rise so much later than its tick, where an interrupt makes it.
constexpr uint16_t LATE_TICKS = output<0>() == Output::COMPARE && planarm::wire::JOINTS == 2 ? 0 : 560;

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

// Takes scheduled ones low, too: they are counted.
inline void wait_step_high() {
    uint8_t turns = HIGH_TURNS;
    __asm__ __volatile__("1: dec %0\n\tbrne 1b" : "+r"(turns));
    if (planarm::wire::JOINTS > 2) {
        write_pin(planarm::wire::STEP_PINS[2 % planarm::wire::JOINTS], false);
        write_pin(planarm::wire::STEP_PINS[3 % planarm::wire::JOINTS], false);
    }
}

// Sets a joint's DIR; true when it changed.
bool dir_set(uint8_t joint, bool high);

}  // namespace hal
