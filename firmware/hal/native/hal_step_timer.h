// Timer1 with its two step outputs and the DIR pins, simulated: what hal/uno/hal_step_timer.h does on the
// chip.
#pragma once

#include <stdint.h>

#include "wiring.h"

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
bool is_high(uint8_t joint);
void forget_match(uint8_t joint);
void enable_interrupt(uint8_t joint, bool on);
bool interrupt_is_on(uint8_t joint);
bool dir(uint8_t joint);
void write_dir(uint8_t joint, bool positive);
void elapse(uint32_t ticks);
bool has_emergency();
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

inline bool has_emergency() { return board::has_emergency(); }

inline uint8_t laps() { return board::laps(); }
inline bool lap_is_due() { return false; }

// Of joint 0; each further joint's is twice that.
constexpr uint8_t FIRST_MASK = 1;
constexpr uint8_t COMPARE_PINS = 0xFF;

inline uint16_t step_edge(uint8_t joint) { return board::edge(joint); }

inline void step_set_edge(uint8_t joint, uint16_t tick) { board::set_edge(joint, tick); }

inline void step_fall(uint8_t joint) { board::fall(joint); }

inline uint8_t steps_left(uint8_t joint) { return board::steps_left(joint); }

inline void count_step(uint8_t joint) {
    board::set_steps_left(joint, static_cast<uint8_t>(board::steps_left(joint) - 1));
}

inline void set_steps_left(uint8_t joint, uint8_t steps) { board::set_steps_left(joint, steps); }

// They are in the runs.
constexpr bool FRACTIONS_IN_REGISTERS = false;
inline uint16_t step_fraction(uint8_t) { return 0; }
inline void set_step_fraction(uint8_t, uint16_t) {}

inline uint8_t step_interrupts_on() {
    uint8_t on = 0;
    for (uint8_t joint = 0; joint < planarm::wire::JOINTS; ++joint) {
        if (board::interrupt_is_on(joint)) on |= static_cast<uint8_t>(FIRST_MASK << joint);
    }
    return on;
}

constexpr uint16_t step_early_ticks(uint8_t) { return 0; }

// As on the Uno, where the interrupt makes the fall.
constexpr uint16_t STEP_MARGIN_TICKS = planarm::wire::MIN_STEP_LOW_TICKS - 2;
constexpr uint16_t START_MARGIN_TICKS = STEP_MARGIN_TICKS;
constexpr uint16_t LATE_TICKS = 0;

inline void steps_fall() {
    for (uint8_t joint = 0; joint < planarm::wire::JOINTS; ++joint) board::fall(joint);
}

inline uint8_t step_levels_high() {
    uint8_t levels = 0;
    for (uint8_t joint = 0; joint < planarm::wire::JOINTS; ++joint) {
        if (board::is_high(joint)) levels |= static_cast<uint8_t>(FIRST_MASK << joint);
    }
    return levels;
}

inline uint8_t step_levels() { return step_levels_high(); }

inline void step_forget_match(uint8_t joint, uint8_t) { board::forget_match(joint); }

inline void step_start(uint8_t joint, uint8_t) {
    board::arm(joint, true);
    board::enable_interrupt(joint, true);
}

inline void step_end(uint8_t joint) {
    board::arm(joint, false);
    board::enable_interrupt(joint, false);
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

// True when it changed.
inline bool dir_set(uint8_t joint, bool positive) {
    const bool changes = board::dir(joint) != positive;
    board::write_dir(joint, positive);
    return changes;
}

}  // namespace hal
