// The journal in EEPROM: records of four bytes, written round and round, so that 100,000 writes of a cell are
// 12.8 million records, however fast they follow each other. A record is its number, of 23 bits, whether the
// drivers are enabled, and a check byte, written from the check down to the number's lowest byte.
//
// A record that a reset cuts short, or the next mark before it is whole, is torn: behind the new check some
// bytes are still those of the record written there a round before, whose number is 128 less. So it fails its
// check, or has that old number, too, and counts for no more; or the lowest byte alone is missing and had
// been the same, which makes it whole. The newest whole record stays the newest, and the one behind a torn
// record has the higher number: an order that stands for 17 ms is told after a reset, of shorter ones the
// last whose record became whole. No step is made before its mark is. A supply that fails within the 3.4 ms
// of a byte may leave anything there: the check finds every change of one byte, and where others are still
// old, all but one in 256.
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
