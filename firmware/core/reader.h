// Reads the wire's field types from a payload, never past its end. The payload may lie in a ring.
#pragma once

#include <stdint.h>

namespace planarm {

class Reader {
  public:
    // Begins with a payload, whose bytes go on at `ring` after `ring_end` when it lies in one.
    void begin(const uint8_t* bytes, uint8_t length, const uint8_t* ring = nullptr,
               const uint8_t* ring_end = nullptr) {
        at_ = bytes;
        left_ = length;
        ring_ = ring;
        ring_end_ = ring_end;
        ok_ = true;
    }

    bool at_end() const { return left_ == 0; }
    // False once a field was cut short or too large; every field read from then on is 0.
    bool ok() const { return ok_; }

    uint8_t u8();
    uint32_t varuint();
    int32_t varint();

  private:
    uint32_t fail();

    const uint8_t* at_;
    uint8_t left_;
    bool ok_;
    const uint8_t* ring_;
    const uint8_t* ring_end_;
};

}  // namespace planarm
