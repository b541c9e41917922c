// The wire's checksum: CRC-16/MCRF4XX (reflected polynomial 0x1021, no final xor).
#pragma once

#include <stdint.h>

namespace planarm {

// The checksum after one more byte. Eight shifts of the reflected register folded into three: x^16 + x^12 +
// x^5 + 1 feeds every bit back at distances 0, 5 and 12, so a byte's worth of feedback is one nibble xor and
// three shifts.
constexpr uint16_t crc_update(uint16_t crc, uint8_t byte) {
    uint8_t feedback = static_cast<uint8_t>(byte ^ crc);
    feedback = static_cast<uint8_t>(feedback ^ (feedback << 4));
    return static_cast<uint16_t>((crc >> 8) ^ (static_cast<uint16_t>(feedback) << 8) ^
                                 (static_cast<uint16_t>(feedback) << 3) ^ (feedback >> 4));
}

}  // namespace planarm
