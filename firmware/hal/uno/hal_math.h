// Wide products and quotients, in the AVR's bytes: math.cpp. The compiler's own take two to three times as
// long. The cycles are those with call and return, counted by tests/firmware/test_firmware_math.py.
#pragma once

#include <stdint.h>

#include "fixed48.h"

namespace hal {

// a b, in 48 bits; 51 cycles.
Fixed48 multiply(uint32_t a, uint16_t b);

// a b modulo 2^32, and a b / 2^16, rounded down; 59 and 60 cycles.
uint32_t multiply_low(uint32_t a, uint16_t b);
uint32_t multiply_high(uint32_t a, uint16_t b);

// a b, and a b / 2^16, rounded down: 2^32 - 1 when it does not fit. 61 to 64 cycles, and 159 to 162.
uint32_t multiply_saturated(uint32_t a, uint16_t b);
uint32_t multiply_q16(uint32_t a, uint32_t b);

// sum += term; 39 cycles.
void add_to(Fixed48& sum, Fixed48 term);

// 2^16 a / b, rounded down; it must fit. 685 to 717 cycles.
uint32_t divide_q16(uint32_t a, uint8_t b);

}  // namespace hal
