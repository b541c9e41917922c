// Timer1 of the ATmega328P, free-running at the CPU clock, and the pins that it steps: joint 0 on OC1A (D9),
// joint 1 on OC1B (D10). ATmega328P datasheet, section 15.
//
// A channel's compare output is in one of two modes. Armed: the pin toggles at the match, so it rises, and a
// forced compare takes it low again. Disarmed: the pin falls at the match, so a match means nothing to a low
// pin. What the step interrupts need at every step is where IN and OUT reach it: the steps left of each
// joint's run in GPIOR0 and GPIOR1, its fraction in registers that no compiled code uses.
#pragma once

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdint.h>

// The step interrupts must hold no calls.
#define HAL_INLINE inline __attribute__((always_inline))

namespace hal {

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

// Starts the timer with both channels disarmed. The counter starts at 0.
inline void step_timer_init() {
    TCCR1A = _BV(COM1A1) | _BV(COM1B1);
    TCNT1 = 0;
    TCCR1B = _BV(CS10);
}

// The timer's 16 bits. Interrupts must be off: they share the timer's TEMP register.
HAL_INLINE uint16_t counter() { return TCNT1; }

template <uint8_t JOINT>
HAL_INLINE uint16_t step_edge() {
    return JOINT == 0 ? OCR1A : OCR1B;
}

// Sets the tick of the next match. Interrupts must be off.
template <uint8_t JOINT>
HAL_INLINE void step_set_edge(uint16_t tick) {
    if (JOINT == 0) {
        OCR1A = tick;
    } else {
        OCR1B = tick;
    }
}

// The pin must be low.
template <uint8_t JOINT>
HAL_INLINE void step_arm() {
    constexpr uint8_t other = JOINT == 0 ? _BV(COM1B1) | _BV(COM1B0) : _BV(COM1A1) | _BV(COM1A0);
    TCCR1A = static_cast<uint8_t>((TCCR1A & other) | (JOINT == 0 ? _BV(COM1A0) : _BV(COM1B0)));
}

template <uint8_t JOINT>
HAL_INLINE void step_disarm() {
    constexpr uint8_t other = JOINT == 0 ? _BV(COM1B1) | _BV(COM1B0) : _BV(COM1A1) | _BV(COM1A0);
    TCCR1A = static_cast<uint8_t>((TCCR1A & other) | (JOINT == 0 ? _BV(COM1A1) : _BV(COM1B1)));
}

// Takes the pin low: a high one when armed, any when disarmed.
template <uint8_t JOINT>
HAL_INLINE void step_fall() {
    TCCR1C = JOINT == 0 ? _BV(FOC1A) : _BV(FOC1B);
}

// Steps left of the active run, the current one included.
template <uint8_t JOINT>
HAL_INLINE uint8_t steps_left() {
    return JOINT == 0 ? GPIOR0 : GPIOR1;
}

template <uint8_t JOINT>
HAL_INLINE void set_steps_left(uint8_t steps) {
    if (JOINT == 0) {
        GPIOR0 = steps;
    } else {
        GPIOR1 = steps;
    }
}

// Fraction of the current step's tick, in 2^-16. While the joint's interrupt is on, only it may ask. In
// step_interrupts.cpp, for joints 0 and 1.
template <uint8_t JOINT>
uint16_t step_fraction();
template <uint8_t JOINT>
void set_step_fraction(uint16_t fraction);

template <uint8_t JOINT>
HAL_INLINE bool step_is_high() {
    return (PINB & (JOINT == 0 ? _BV(PINB1) : _BV(PINB2))) != 0;
}

// Forgets a match that nobody waited for.
template <uint8_t JOINT>
HAL_INLINE void step_forget_match() {
    TIFR1 = JOINT == 0 ? _BV(OCF1A) : _BV(OCF1B);
}

template <uint8_t JOINT>
HAL_INLINE void step_interrupt_on() {
    TIMSK1 = static_cast<uint8_t>(TIMSK1 | (JOINT == 0 ? _BV(OCIE1A) : _BV(OCIE1B)));
}

template <uint8_t JOINT>
HAL_INLINE void step_interrupt_off() {
    TIMSK1 = static_cast<uint8_t>(TIMSK1 & ~(JOINT == 0 ? _BV(OCIE1A) : _BV(OCIE1B)));
}

template <uint8_t JOINT>
HAL_INLINE bool step_interrupt_is_on() {
    return (TIMSK1 & (JOINT == 0 ? _BV(OCIE1A) : _BV(OCIE1B))) != 0;
}

template <uint8_t JOINT>
constexpr uint8_t step_interrupt_mask() {
    return JOINT == 0 ? _BV(OCIE1A) : _BV(OCIE1B);
}

// The masks of the interrupts that are on.
HAL_INLINE uint8_t step_interrupts_on() { return TIMSK1; }

// Disarms both channels and stops their interrupts; a pin that is high stays high.
HAL_INLINE void steps_off() {
    TCCR1A = _BV(COM1A1) | _BV(COM1B1);
    TIMSK1 = 0;
}

// Passes the least high time of a pulse that may have risen just now: 19 turns of 3 cycles.
inline void wait_step_high() {
    uint8_t turns = 19;
    __asm__ __volatile__("1: dec %0\n\tbrne 1b" : "+r"(turns));
}

// DIR is D4 for joint 0 and D5 for joint 1.
template <uint8_t JOINT>
HAL_INLINE bool dir_is(bool positive) {
    return ((PORTD & (JOINT == 0 ? _BV(PORTD4) : _BV(PORTD5))) != 0) == positive;
}

// One instruction, so no lock is needed.
template <uint8_t JOINT>
HAL_INLINE void dir_write(bool positive) {
    constexpr uint8_t mask = JOINT == 0 ? _BV(PORTD4) : _BV(PORTD5);
    if (positive) {
        PORTD |= mask;
    } else {
        PORTD &= static_cast<uint8_t>(~mask);
    }
}

}  // namespace hal
