// The drivers' supply as far as ENABLE goes: wake-up time, release after idleness, the mark in EEPROM, and
// what CONFIG tells of the wiring.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace power {

struct Config {
    uint8_t options;
    uint32_t idle_ms;
    uint32_t wake_ticks;
};

enum Option : uint8_t {
    ENABLE_ACTIVE_HIGH = 0x01,
    EMERGENCY_RELEASES = 0x02,
    STOP_INPUT = 0x04,
    LIMIT_SWITCHES = 0x08,
    LIMITS_OPEN_WHEN_HIT = 0x10,
};

// Drivers released, defaults. For start-up.
void reset();

void configure(const Config& config);
bool has_option(Option option);

// Energises the drivers, and marks in EEPROM that the arm is held.
void energise();
void release();

// The earliest tick for a first step: the drivers are awake and the mark is written.
uint32_t ready_ticks();

// Something happened that is not idleness.
void note_activity();
// True when the drivers were idle for so long that they are to be released. To be called
// every millisecond.
bool is_idle_too_long();

}  // namespace power
}  // namespace planarm
