// The wire's checksum, one byte further.
#pragma once

#include <stdint.h>

namespace hal {

// Eight bits of the reflected register at once: each outgoing bit is fed back at distances 0, 5 and 12. What
// goes out is the byte xor the register's low half, with the feedback of its own low nibble added to its high
// nibble.
inline uint16_t crc_update(uint16_t crc, uint8_t byte) {
    uint8_t out = static_cast<uint8_t>(byte ^ crc);
    out = static_cast<uint8_t>(out ^ (out << 4));
    return static_cast<uint16_t>((crc >> 8) ^ (out << 8) ^ (out << 3) ^ (out >> 4));
}

}  // namespace hal
