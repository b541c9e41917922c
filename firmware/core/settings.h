// What the host has told of the arm, as it came.
#pragma once

#include "messages.h"

namespace planarm {
namespace settings {

extern wire::Config config;
extern wire::SoftLimits soft_limits;

// Bits of CONFIG's options.
enum Option : uint8_t {
    ENABLE_ACTIVE_HIGH = 0x01,
    EMERGENCY_RELEASES = 0x02,
    STOP_INPUT = 0x04,
    LIMIT_SWITCHES = 0x08,
    LIMITS_OPEN_WHEN_HIT = 0x10,
};

// The defaults. For start-up.
void reset();

bool has_option(Option option);

}  // namespace settings
}  // namespace planarm
