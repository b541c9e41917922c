// A count of boots in EEPROM.
#pragma once

#include <stdint.h>

namespace hal {

// Counts this boot and returns the count, which is in EEPROM by then. Waits for the EEPROM (about 3.4 ms a
// changed byte): for start-up only.
uint32_t count_boot();

}  // namespace hal
