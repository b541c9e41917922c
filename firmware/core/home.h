// Homing of one joint: to its limit switch, off it, and slowly onto it again. The speeds are the host's,
// meant to be below the start-stop speed: the joint starts and stops dead. The count is left alone: what it
// is at the switch tells the host how many steps were lost.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace home {

struct Order {
    uint8_t joint;
    bool positive;  // the switch lies there
    uint32_t fast_ticks;
    uint32_t slow_ticks;
    uint32_t most_usteps;
    uint32_t back_usteps;
};

enum class Progress : uint8_t { NONE, GOING, DONE, FAILED, MISSED };

// For start-up.
void reset();

// OK or OUT_OF_RANGE.
wire::Result check(const Order& order);
void begin(const Order& order, uint32_t start_ticks);
void cancel();

bool is_active();
uint8_t joint();

// To be called often.
Progress serve(uint32_t now_ticks);

}  // namespace home
}  // namespace planarm
