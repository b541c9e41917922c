// ENABLE's polarity in EEPROM, so that the pin is right from the first microsecond after a reset.
#pragma once

#include <stdint.h>

namespace hal {

// The last byte of the EEPROM. Erased (0xFF): active low.
constexpr uint16_t POLARITY_ADDRESS = 1023;
constexpr uint8_t ACTIVE_HIGH = 0x01;

// Writes the byte if it changed; waits for the EEPROM then, 3.4 ms.
void keep_enable_polarity(bool active_high);

}  // namespace hal
