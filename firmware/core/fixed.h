// Arithmetic of products that 32 bits do not hold.
#pragma once

#include <stdint.h>

#include "hal_math.h"

namespace planarm {

using hal::add_to;
using hal::Fixed48;
using hal::multiply;
using hal::subtract_from;

// a b / 2^16 and a b / 2^32, rounded down; 2^32 - 1 when it does not fit.
uint32_t multiply_q16(uint32_t a, uint32_t b);
uint32_t multiply_q32(uint32_t a, uint32_t b);

// a b, or 2^32 - 1 when that does not fit.
uint32_t multiply_saturated(uint32_t a, uint32_t b);

// 2^32 - 1 when the sum does not fit.
inline uint32_t add_saturated(uint32_t a, uint32_t b) {
    const uint32_t sum = a + b;
    return sum < a ? 0xFFFFFFFF : sum;
}

// n I + n (n - 1) / 2 A for n < 2^8, in 2^-16 units: the time from step 0 to step n of a run.
Fixed48 run_time(uint8_t n, uint32_t interval_q16, int32_t add_q16);

}  // namespace planarm
