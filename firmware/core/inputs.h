// Limit switches, debounced: a change counts when it has lasted.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace inputs {

// For start-up.
void reset();

// To be called often.
void serve();

// As debounced.
bool is_hit(uint8_t joint);

// A motion that begins now may leave the switches that are hit: they count again once they have been open.
void excuse_hit();

// The first joint whose switch is hit and not excused, or wire::JOINTS; none when they are not watched.
uint8_t hit_joint();

// As STATUS tells them.
uint8_t report();

}  // namespace inputs
}  // namespace planarm
