// Bytes to be read one after the other.
#pragma once

#include <stdint.h>

namespace hal {

struct Bytes {
    const uint8_t* at;
    uint8_t left;
    bool ok;  // false once more was asked for than is there, or a number was no number
    // Those that lie in a ring go on at `ring` after `ring_end`.
    const uint8_t* ring;
    const uint8_t* ring_end;
};

}  // namespace hal
