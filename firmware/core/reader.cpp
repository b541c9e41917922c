#include "reader.h"

namespace planarm {

int32_t Reader::varint() {
    const uint32_t zigzag = varuint();
    return static_cast<int32_t>((zigzag & 1) != 0 ? ~(zigzag >> 1) : zigzag >> 1);
}

}  // namespace planarm
