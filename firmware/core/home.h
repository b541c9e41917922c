// Homing of one joint: to its limit switch, off it, and slowly onto it again. The speeds are the host's,
// meant to be below the start-stop speed: the joint starts and stops dead. The count is left alone: what it
// is at the switch tells the host how many steps were lost.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace home {

enum class Progress : uint8_t { NONE, GOING, DONE, FAILED, MISSED };

// For start-up.
void reset();

// True when the order keeps the limits.
bool is_good(const wire::Home& order);
void begin(const wire::Home& order, uint32_t start_ticks);
void cancel();

bool is_active();
uint8_t joint();

// To be called often.
Progress serve();

}  // namespace home
}  // namespace planarm
