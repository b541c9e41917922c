// Bytes and numbers of a payload.
#pragma once

#include <stdint.h>

#include "bytes.h"

namespace hal {

// Leaves nothing to read, so that every later field fails as well.
inline uint32_t fail(Bytes& bytes) {
    bytes.ok = false;
    bytes.left = 0;
    return 0;
}

// The next byte. When none is left it is 0, `ok` is false, and so it stays.
inline uint8_t next_byte(Bytes& bytes) {
    if (bytes.left == 0) return static_cast<uint8_t>(fail(bytes));
    const uint8_t byte = *bytes.at++;
    if (bytes.at == bytes.ring_end) bytes.at = bytes.ring;
    --bytes.left;
    return byte;
}

// A varuint of docs/protocol.md. One that is cut short, has a needless byte or more than 32 bits is 0, and
// then nothing is left.
inline uint32_t varuint(Bytes& bytes) {
    constexpr uint8_t MORE = 0x80;
    uint8_t byte = next_byte(bytes);
    uint64_t value = byte & 0x7F;
    for (uint8_t place = 7; byte >= MORE; place = static_cast<uint8_t>(place + 7)) {
        byte = next_byte(bytes);
        if (byte == 0 || place > 28) return fail(bytes);  // cut short, needless, or a sixth
        value |= static_cast<uint64_t>(byte & 0x7F) << place;
    }
    if (value > 0xFFFFFFFF) return fail(bytes);
    return static_cast<uint32_t>(value);
}

}  // namespace hal
