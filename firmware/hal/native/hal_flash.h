// Tables in program memory: on a PC, memory like any other.
#pragma once

#include <stdint.h>

#define HAL_FLASH

namespace hal {

inline uint16_t flash_word(const uint16_t* address) { return *address; }

}  // namespace hal
