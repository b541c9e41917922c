// Limit switches, debounced: a change counts when it has lasted.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace inputs {

// For start-up.
void reset(uint32_t now_ticks);

// To be called often.
void serve(uint32_t now_ticks);

// As debounced.
bool is_hit(uint8_t joint);
// As the pin tells now.
bool is_hit_now(uint8_t joint);
// True when the pin has changed and not yet lasted.
bool is_bouncing(uint8_t joint);

// The first joint whose switch is hit, or wire::JOINTS; none when they are not watched.
uint8_t hit_joint();

// As STATUS tells them.
uint8_t report();

}  // namespace inputs
}  // namespace planarm
