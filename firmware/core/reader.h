// Reads the wire's field types from a payload, never past its end. The payload may lie in a ring.
#pragma once

#include <stdint.h>

#include "hal_bytes.h"

namespace planarm {

class Reader {
  public:
    // Begins with a payload, whose bytes go on at `ring` after `ring_end` when it lies in one.
    void begin(const uint8_t* bytes, uint8_t length, const uint8_t* ring = nullptr,
               const uint8_t* ring_end = nullptr) {
        bytes_ = {bytes, length, true, ring, ring_end};
    }

    bool at_end() const { return bytes_.left == 0; }
    // False once a field was cut short or too large; every field read from then on is 0.
    bool ok() const { return bytes_.ok; }

    uint8_t u8() { return hal::next_byte(bytes_); }
    uint32_t varuint() { return hal::varuint(bytes_); }
    int32_t varint();

  private:
    hal::Bytes bytes_;
};

}  // namespace planarm
