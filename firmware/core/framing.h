// The codes that have a meaning of their own on the line.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {

// Kept for bytes outside of frames; never part of one.
inline bool is_reserved(uint8_t byte) {
    for (uint8_t code : wire::RESERVED) {
        if (byte == code) return true;
    }
    return false;
}

// Must be escaped inside a frame.
inline bool is_special(uint8_t byte) {
    return byte == wire::DELIMITER || byte == wire::ESCAPE || is_reserved(byte);
}

}  // namespace planarm
