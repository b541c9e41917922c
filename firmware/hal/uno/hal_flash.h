// Tables in program memory: on the chip, constants would else be copied to its 2 KB of RAM.
#pragma once

#include <avr/pgmspace.h>
#include <stdint.h>

#define HAL_FLASH PROGMEM

namespace hal {

// The word at an address in a HAL_FLASH table.
inline uint16_t flash_word(const uint16_t* address) { return pgm_read_word(address); }

}  // namespace hal
