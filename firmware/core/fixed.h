// Arithmetic of products that 32 bits do not hold.
#pragma once

#include <stdint.h>

#include "hal_math.h"

namespace planarm {

using hal::add_to;
using hal::Fixed48;
using hal::multiply;
using hal::multiply_high;
using hal::multiply_low;
using hal::multiply_q16;
using hal::multiply_saturated;

// value += by, in place: a call takes a third of the bytes that the sum takes where it is made.
void increase(uint32_t& value, uint32_t by);

// Functions of their own for the same reason.
uint32_t least_of(uint32_t a, uint32_t b);
uint32_t most_of(uint32_t a, uint32_t b);

inline Fixed48 from_q16(uint32_t value) { return {value >> 16, static_cast<uint16_t>(value)}; }

}  // namespace planarm
