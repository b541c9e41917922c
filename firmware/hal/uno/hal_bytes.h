// Bytes and numbers of a payload, read in the AVR's registers: bytes.cpp. The cycles are those with call and
// return, counted by tests/firmware/test_firmware_math.py.
#pragma once

#include <stdint.h>

#include "bytes.h"

namespace hal {

// The next byte; 44 cycles at most. When none is left it is 0, `ok` is false, and so it stays.
uint8_t next_byte(Bytes& bytes);

// A varuint of docs/protocol.md; 75 to 298 cycles. One that is cut short, has a needless byte or more than 32
// bits is 0, and then nothing is left.
uint32_t varuint(Bytes& bytes);

}  // namespace hal
