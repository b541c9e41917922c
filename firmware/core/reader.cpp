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

}  // namespace

// Leaves nothing to read, so that every later field fails as well.
uint32_t Reader::fail() {
    ok_ = false;
    left_ = 0;
    return 0;
}

uint8_t Reader::u8() {
    if (left_ == 0) return static_cast<uint8_t>(fail());
    const uint8_t byte = *at_++;
    if (at_ == ring_end_) at_ = ring_;
    --left_;
    return byte;
}

// Seven bits a byte. A product with a power of two brings them to their place in two bytes of the number,
// which is two cycles where a shift is a loop.
uint32_t Reader::varuint() {
    uint8_t byte = u8();
    uint8_t bytes[5] = {static_cast<uint8_t>(byte & ~MORE)};
    uint8_t* at = bytes;
    for (uint8_t place = 0x80; byte >= MORE; place = static_cast<uint8_t>(place >> 1)) {
        byte = u8();
        if (byte == 0 || place < 0x10) return fail();  // cut short, needless, or a sixth
        const uint16_t wide = static_cast<uint16_t>((byte & ~MORE) * place);
        *at = static_cast<uint8_t>(*at | wide);
        *++at = static_cast<uint8_t>(wide >> 8);
    }
    if (bytes[4] != 0) return fail();
    return join(bytes[0], bytes[1], bytes[2], bytes[3]);
}

int32_t Reader::varint() {
    const uint32_t zigzag = varuint();
    return static_cast<int32_t>((zigzag & 1) != 0 ? ~(zigzag >> 1) : zigzag >> 1);
}

}  // namespace planarm
