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

// a b modulo 2^32, and a b / 2^16, rounded down.
inline uint32_t multiply_low(uint32_t a, uint16_t b) {
    return static_cast<uint32_t>(static_cast<uint64_t>(a) * b);
}
inline uint32_t multiply_high(uint32_t a, uint16_t b) { return multiply(a, b).high; }

// a b, and a b / 2^16, rounded down: 2^32 - 1 when it does not fit.
inline uint32_t saturated(uint64_t value) {
    return value > 0xFFFFFFFF ? 0xFFFFFFFF : static_cast<uint32_t>(value);
}
inline uint32_t multiply_saturated(uint32_t a, uint16_t b) { return saturated(static_cast<uint64_t>(a) * b); }
inline uint32_t multiply_q16(uint32_t a, uint32_t b) {
    return saturated((static_cast<uint64_t>(a) * b) >> 16);
}

inline uint64_t whole(Fixed48 value) { return (static_cast<uint64_t>(value.high) << 16) | value.low; }

// sum += term.
inline void add_to(Fixed48& sum, Fixed48 term) {
    const uint64_t total = whole(sum) + whole(term);
    sum = {static_cast<uint32_t>(total >> 16), static_cast<uint16_t>(total)};
}

// 2^16 a / b, rounded down; it must fit.
inline uint32_t divide_q16(uint32_t a, uint8_t b) {
    return static_cast<uint32_t>((static_cast<uint64_t>(a) << 16) / b);
}

}  // namespace hal
