#include "reader.h"

namespace planarm {

namespace {

constexpr uint8_t MORE = 0x80;  // the number goes on

// Four bytes as a number; byte moves on an 8-bit machine.
uint32_t join(uint8_t b0, uint8_t b1, uint8_t b2, uint8_t b3) {
    const uint16_t low = static_cast<uint16_t>(b0 | (b1 << 8));
    const uint16_t high = static_cast<uint16_t>(b2 | (b3 << 8));
    return low | (static_cast<uint32_t>(high) << 16);
}

uint8_t bits(unsigned value) { return static_cast<uint8_t>(value); }

}  // namespace

// Leaves nothing to read, so that every later field fails as well.
uint32_t Reader::fail() {
    ok_ = false;
    left_ = 0;
    return 0;
}

uint16_t Reader::u16() {
    const uint8_t low = u8();
    return static_cast<uint16_t>(low | (u8() << 8));
}

uint32_t Reader::u32() {
    if (left_ < 4) return fail();
    const uint8_t b0 = next();
    const uint8_t b1 = next();
    const uint8_t b2 = next();
    return join(b0, b1, b2, next());
}

// Seven bits a byte, written out byte by byte because shifts of a number cost an 8-bit machine a loop.
uint32_t Reader::varuint() {
    if (left_ == 0) return fail();
    const uint8_t b0 = next();
    if (b0 < MORE) return b0;
    if (left_ == 0) return fail();
    const uint8_t b1 = next();
    const uint8_t r0 = bits((b0 & 0x7F) | (b1 << 7));
    if (b1 < MORE) return b1 == 0 ? fail() : join(r0, bits(b1 >> 1), 0, 0);
    if (left_ == 0) return fail();
    const uint8_t b2 = next();
    const uint8_t r1 = bits(((b1 & 0x7F) >> 1) | (b2 << 6));
    if (b2 < MORE) return b2 == 0 ? fail() : join(r0, r1, bits(b2 >> 2), 0);
    if (left_ == 0) return fail();
    const uint8_t b3 = next();
    const uint8_t r2 = bits(((b2 & 0x7F) >> 2) | (b3 << 5));
    if (b3 < MORE) return b3 == 0 ? fail() : join(r0, r1, r2, bits(b3 >> 3));
    if (left_ == 0) return fail();
    const uint8_t b4 = next();
    if (b4 == 0 || b4 > 0x0F) return fail();
    return join(r0, r1, r2, bits(((b3 & 0x7F) >> 3) | (b4 << 4)));
}

int32_t Reader::varint() {
    const uint32_t zigzag = varuint();
    return static_cast<int32_t>((zigzag & 1) != 0 ? ~(zigzag >> 1) : zigzag >> 1);
}

}  // namespace planarm
