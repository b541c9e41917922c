// Arithmetic of products that 32 bits do not hold.
#pragma once

#include <stdint.h>

#include "hal_math.h"

namespace planarm {

using hal::add_to;
using hal::Fixed48;
using hal::multiply;
using hal::multiply_q16;
using hal::multiply_q32;
using hal::multiply_saturated;
using hal::subtract_from;

// value += by, in place: a call takes a third of the bytes that the sum takes where it is made.
void increase(uint32_t& value, uint32_t by);

// 2^32 - 1 when the sum does not fit.
inline uint32_t add_saturated(uint32_t a, uint32_t b) {
    const uint32_t sum = a + b;
    return sum < a ? 0xFFFFFFFF : sum;
}

// n I + n (n - 1) / 2 A for n < 2^8, in 2^-16 units: the time from step 0 to step n of a run.
Fixed48 run_time(uint8_t n, uint32_t interval_q16, int32_t add_q16);

}  // namespace planarm
