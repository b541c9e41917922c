// Tables in program memory: on a PC, memory like any other.
#pragma once

#include <stdint.h>

#define HAL_FLASH

namespace hal {

inline uint8_t flash_byte(const void* address) { return *static_cast<const uint8_t*>(address); }

}  // namespace hal
