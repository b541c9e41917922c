// Arithmetic of products that 32 bits do not hold.
#pragma once

#include <stdint.h>

#include "hal_math.h"

namespace planarm {

using hal::add_to;
using hal::Fixed48;
using hal::multiply;
using hal::multiply_low;
using hal::multiply_q16;
using hal::multiply_q32;
using hal::multiply_saturated;

// value += by, in place: a call takes a third of the bytes that the sum takes where it is made.
void increase(uint32_t& value, uint32_t by);

inline Fixed48 from_q16(uint32_t value) { return {value >> 16, static_cast<uint16_t>(value)}; }

}  // namespace planarm
