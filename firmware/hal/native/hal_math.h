// Wide products and quotients.
#pragma once

#include <stdint.h>

#include "fixed48.h"

namespace hal {

// a b, in 48 bits.
inline Fixed48 multiply(uint32_t a, uint16_t b) {
    const uint64_t product = static_cast<uint64_t>(a) * b;
    return {static_cast<uint32_t>(product >> 16), static_cast<uint16_t>(product)};
}

// 2^16 a / b, rounded down; it must fit.
inline uint32_t divide_q16(uint32_t a, uint8_t b) {
    return static_cast<uint32_t>((static_cast<uint64_t>(a) << 16) / b);
}

}  // namespace hal
