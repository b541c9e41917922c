// Timer1 with its two step outputs and the DIR pins, simulated: what hal/uno/hal_step_timer.h does on the
// chip.
#pragma once

#include <stdint.h>

#include "wiring.h"

#define HAL_INLINE inline

namespace hal {

// The simulated hardware, in board.cpp. All joints are on compare outputs.
namespace board {
void lock();
void unlock();
uint16_t counter();
uint8_t laps();
uint16_t edge(uint8_t joint);
void set_edge(uint8_t joint, uint16_t tick);
void arm(uint8_t joint, bool armed);  // the match toggles the pin, else it takes it low
void fall(uint8_t joint);
uint8_t steps_left(uint8_t joint);
void set_steps_left(uint8_t joint, uint8_t steps);
uint16_t fraction(uint8_t joint);
void set_fraction(uint8_t joint, uint16_t fraction);
bool is_high(uint8_t joint);
void forget_match(uint8_t joint);
void enable_interrupt(uint8_t joint, bool on);
bool interrupt_is_on(uint8_t joint);
bool dir(uint8_t joint);
void write_dir(uint8_t joint, bool positive);
void elapse(uint32_t ticks);
}  // namespace board

class InterruptLock {
  public:
    InterruptLock() { board::lock(); }
    ~InterruptLock() { board::unlock(); }
    InterruptLock(const InterruptLock&) = delete;
    InterruptLock& operator=(const InterruptLock&) = delete;
};

// An interrupt may come here, as on the chip: between any two statements that the barrier keeps in order.
inline void compiler_barrier() { InterruptLock(); }

inline uint16_t counter() { return board::counter(); }

inline uint8_t laps() { return board::laps(); }
inline bool lap_is_due() { return false; }

template <uint8_t JOINT>
uint16_t step_edge() {
    return board::edge(JOINT);
}

template <uint8_t JOINT>
void step_set_edge(uint16_t tick) {
    board::set_edge(JOINT, tick);
}

template <uint8_t JOINT>
void step_arm() {
    board::arm(JOINT, true);
}

template <uint8_t JOINT>
void step_disarm() {
    board::arm(JOINT, false);
}

template <uint8_t JOINT>
void step_fall() {
    board::fall(JOINT);
}

template <uint8_t JOINT>
uint8_t steps_left() {
    return board::steps_left(JOINT);
}

template <uint8_t JOINT>
void set_steps_left(uint8_t steps) {
    board::set_steps_left(JOINT, steps);
}

template <uint8_t JOINT>
uint16_t step_fraction() {
    return board::fraction(JOINT);
}

template <uint8_t JOINT>
void set_step_fraction(uint16_t fraction) {
    board::set_fraction(JOINT, fraction);
}

template <uint8_t JOINT>
constexpr uint8_t step_interrupt_mask() {
    return 1 << JOINT;
}

inline uint8_t step_interrupts_on() {
    uint8_t on = 0;
    for (uint8_t joint = 0; joint < planarm::wire::JOINTS; ++joint) {
        if (board::interrupt_is_on(joint)) on |= static_cast<uint8_t>(1 << joint);
    }
    return on;
}

template <uint8_t JOINT>
constexpr uint16_t step_early_ticks() {
    return 0;
}

template <uint8_t JOINT>
bool step_is_high() {
    return board::is_high(JOINT);
}

// As on the Uno, where the interrupt makes the fall.
constexpr uint16_t STEP_MARGIN_TICKS = planarm::wire::MIN_STEP_LOW_TICKS - 2;
constexpr uint16_t START_MARGIN_TICKS = STEP_MARGIN_TICKS;
constexpr uint16_t LATE_TICKS = 0;

template <uint8_t JOINT>
bool step_is_counted() {
    return false;
}

inline uint8_t step_levels() {
    uint8_t levels = 0;
    for (uint8_t joint = 0; joint < planarm::wire::JOINTS; ++joint) {
        if (board::is_high(joint)) levels |= static_cast<uint8_t>(1 << joint);
    }
    return levels;
}

template <uint8_t JOINT>
bool step_level(uint8_t levels) {
    return (levels >> JOINT & 1) != 0;
}

template <uint8_t JOINT>
void step_forget_match() {
    board::forget_match(JOINT);
}

template <uint8_t JOINT>
void step_interrupt_on() {
    board::enable_interrupt(JOINT, true);
}

template <uint8_t JOINT>
void step_interrupt_off() {
    board::enable_interrupt(JOINT, false);
}

template <uint8_t JOINT>
bool step_interrupt_is_on() {
    return board::interrupt_is_on(JOINT);
}

inline void steps_off() {
    for (uint8_t joint = 0; joint < planarm::wire::JOINTS; ++joint) {
        board::arm(joint, false);
        board::enable_interrupt(joint, false);
    }
}

inline uint16_t end_steps() {
    const uint16_t last = board::counter();
    steps_off();
    return last;
}

inline void wait_step_high() { board::elapse(planarm::wire::MIN_STEP_HIGH_TICKS + 1); }

template <uint8_t JOINT>
bool dir_is(bool positive) {
    return board::dir(JOINT) == positive;
}

template <uint8_t JOINT>
void dir_write(bool positive) {
    board::write_dir(JOINT, positive);
}

}  // namespace hal
