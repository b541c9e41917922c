// What the interrupts of the line and the stop input have seen: bytes out of band.
#pragma once

#include <stdint.h>

namespace hal {

// Hold bytes so far, modulo 256.
uint8_t hold_count();

enum class Emergency : uint8_t { NONE, LINE, INPUT };

// What ended all pulses; until `emergency_clear` no step is made.
Emergency emergency();
// Two steps, so that none is cleared that the host has not been told of: a STATUS tells the latched fault,
// CLEAR takes back what came before that. What came later goes on to be told by `emergency`.
void emergency_told();
void emergency_clear();

// Restarts the count of 250 ms after which a main program that stands still is reset.
void watchdog_feed();

}  // namespace hal
