#include "reader.h"

namespace planarm {

uint8_t Reader::u8() {
    ok_ = ok_ && at_ != end_;
    return ok_ ? *at_++ : 0;
}

uint32_t Reader::u32() {
    uint32_t value = 0;
    for (uint8_t shift = 0; shift < 32; shift = static_cast<uint8_t>(shift + 8)) {
        value |= static_cast<uint32_t>(u8()) << shift;
    }
    return ok_ ? value : 0;
}

uint32_t Reader::varuint() {
    uint32_t value = 0;
    for (uint8_t shift = 0; shift < 35; shift = static_cast<uint8_t>(shift + 7)) {
        const uint8_t byte = u8();
        if (shift == 28 && byte > 0x0F)
            break;                           // a fifth byte holds the four highest bits and ends the number
        if (shift != 0 && byte == 0) break;  // not the shortest form
        value |= static_cast<uint32_t>(byte & 0x7F) << shift;
        if (byte < 0x80) return ok_ ? value : 0;
    }
    ok_ = false;
    return 0;
}

int32_t Reader::varint() {
    const uint32_t zigzag = varuint();
    return static_cast<int32_t>((zigzag >> 1) ^ (0 - (zigzag & 1)));
}

}  // namespace planarm
