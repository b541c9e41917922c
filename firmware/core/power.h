// The drivers' supply as far as ENABLE goes: wake-up time, release after idleness, the mark in EEPROM.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace power {

// Drivers released. For start-up.
void reset();

// Takes over what the settings tell.
void configure();

// Energises the drivers, and marks in EEPROM that the arm is held.
void energise();
void release();

// Notices that the drivers are awake. To be called often, so that it does so before the clock has gone round.
void serve();

// The earliest tick for a first step: the drivers are awake and the mark is written.
uint32_t ready_ticks();

// Something happened that is not idleness.
void note_activity();
// True when the drivers were idle for so long that they are to be released. To be called
// every millisecond.
bool is_idle_too_long();

}  // namespace power
}  // namespace planarm
