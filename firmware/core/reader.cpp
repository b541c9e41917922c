#include "reader.h"

namespace planarm {

namespace {

constexpr uint8_t LONGEST_VARUINT = 5;

// value << 7 in byte moves and one shift, which an 8-bit machine does faster than seven.
uint32_t shift_by_seven(uint32_t value) { return ((value >> 1) << 8) | ((value & 1) != 0 ? 0x80 : 0); }

}  // namespace

// Leaves nothing to read, so that every later field fails as well.
uint32_t Reader::fail() {
    ok_ = false;
    at_ = end_;
    return 0;
}

uint8_t Reader::u8() { return at_ == end_ ? static_cast<uint8_t>(fail()) : *at_++; }

uint32_t Reader::u32() {
    if (end_ - at_ < 4) return fail();
    uint32_t value = 0;
    for (uint8_t i = 4; i-- > 0;) value = (value << 8) | at_[i];
    at_ += 4;
    return value;
}

uint32_t Reader::varuint() {
    const uint8_t* byte = at_;
    uint8_t length = 0;
    do {
        if (byte == end_ || length == LONGEST_VARUINT) return fail();
        ++length;
    } while (*byte++ >= 0x80);
    const uint8_t* const next = byte;

    uint32_t value = *--byte;  // the most significant bits
    if (length > 1 && value == 0) return fail();
    if (length == LONGEST_VARUINT && value > 0x0F) return fail();
    while (byte != at_) value = shift_by_seven(value) | (*--byte & 0x7F);
    at_ = next;
    return value;
}

int32_t Reader::varint() {
    const uint32_t zigzag = varuint();
    return static_cast<int32_t>((zigzag & 1) != 0 ? ~(zigzag >> 1) : zigzag >> 1);
}

}  // namespace planarm
