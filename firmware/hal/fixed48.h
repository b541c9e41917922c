// A number of 48 bits, which fits into an 8-bit machine's registers where 64 do not.
#pragma once

#include <stdint.h>

namespace hal {

// High 32 and low 16 bits of a product, or a time in ticks and 2^-16 ticks.
struct Fixed48 {
    uint32_t high;
    uint16_t low;
};

}  // namespace hal
