// The wire's checksum, one byte further: avr-libc has it in 17 cycles.
#pragma once

#include <stdint.h>
#include <util/crc16.h>

namespace hal {

inline uint16_t crc_update(uint16_t crc, uint8_t byte) { return _crc_ccitt_update(crc, byte); }

}  // namespace hal
