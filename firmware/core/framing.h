// The codes that have a meaning of their own on the line.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {

// Kept for bytes outside of frames; never part of one.
constexpr bool is_reserved(uint8_t byte) { return byte == wire::RESERVED[0] || byte == wire::RESERVED[1]; }

// Must be escaped inside a frame. The four codes are neighbours, which makes one comparison enough.
constexpr uint8_t FIRST_SPECIAL = wire::RESERVED[0];
static_assert(wire::HOLD_CODE == FIRST_SPECIAL && wire::EMERGENCY_CODE == FIRST_SPECIAL + 1,
              "the receive interrupt looks at one range");
static_assert(wire::RESERVED[1] == FIRST_SPECIAL + 1 && wire::ESCAPE == FIRST_SPECIAL + 2 &&
                  wire::DELIMITER == FIRST_SPECIAL + 3,
              "is_special looks at one range");

constexpr bool is_special(uint8_t byte) { return static_cast<uint8_t>(byte - FIRST_SPECIAL) < 4; }

}  // namespace planarm
