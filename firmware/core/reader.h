// Reads the wire's field types from a payload, never past its end.
#pragma once

#include <stdint.h>

namespace planarm {

class Reader {
  public:
    Reader() = default;
    Reader(const uint8_t* bytes, uint8_t length) : at_(bytes), end_(bytes + length) {}

    bool at_end() const { return at_ == end_; }
    // False once a field was cut short or too large; every field read from then on is 0.
    bool ok() const { return ok_; }

    uint8_t u8();
    uint32_t u32();
    uint32_t varuint();
    int32_t varint();

  private:
    uint32_t fail();

    const uint8_t* at_ = nullptr;
    const uint8_t* end_ = nullptr;
    bool ok_ = true;
};

}  // namespace planarm
