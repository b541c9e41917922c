// What outlives a reset: a count of boots, and whether the drivers were enabled, in EEPROM with its wear
// spread.
#pragma once

#include <stdint.h>

namespace hal {

// Notes in the background whether the drivers are enabled; takes less than 20 ms.
void journal_mark(bool enabled);

// Goes on with it; to be called often.
void journal_serve();

}  // namespace hal
