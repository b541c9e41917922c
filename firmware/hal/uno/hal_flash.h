// Tables in program memory: on the chip, constants would else be copied to its 2 KB of RAM.
#pragma once

#include <avr/pgmspace.h>
#include <stdint.h>

#define HAL_FLASH PROGMEM

namespace hal {

// The byte at an address in a HAL_FLASH table.
inline uint8_t flash_byte(const void* address) { return pgm_read_byte(address); }

}  // namespace hal
