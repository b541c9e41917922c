// The journal in EEPROM: records of four bytes, written round and round, so that 100,000 writes of a cell are
// 12.8 million records. A record is its number, of 23 bits, whether the drivers are enabled, and a check
// byte; one that a reset cut short fails its check, and the one before it counts.
#pragma once

#include <stdint.h>

namespace hal {

struct JournalBoot {
    uint32_t count;  // differs at every boot
    bool was_enabled;
};

// Reads the newest record and writes that of this boot; waits about 14 ms. For start-up only.
JournalBoot journal_boot();

}  // namespace hal
