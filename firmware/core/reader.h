// Reads the wire's field types from a payload, never past its end. The payload may lie in a ring.
#pragma once

#include <stdint.h>

namespace planarm {

class Reader {
  public:
    Reader() = default;
    Reader(const uint8_t* bytes, uint8_t length) : at_(bytes), left_(length) {}
    // Bytes that go on at `ring` after `ring_end`.
    Reader(const uint8_t* bytes, uint8_t length, const uint8_t* ring, const uint8_t* ring_end)
        : at_(bytes), left_(length), ring_(ring), ring_end_(ring_end) {}

    bool at_end() const { return left_ == 0; }
    // False once a field was cut short or too large; every field read from then on is 0.
    bool ok() const { return ok_; }

    uint8_t u8();
    uint32_t varuint();
    int32_t varint();

  private:
    uint32_t fail();

    const uint8_t* at_ = nullptr;
    uint8_t left_ = 0;
    const uint8_t* ring_ = nullptr;
    const uint8_t* ring_end_ = nullptr;
    bool ok_ = true;
};

}  // namespace planarm
