#include "fixed.h"

namespace planarm {

namespace {

// The halves of a b; a shift of 64 bits would be a loop on an 8-bit machine.
union Product64 {
    uint64_t whole;
    uint32_t halves[2];
    uint16_t quarters[4];
};
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the first half is the low one");

Product64 multiply_full(uint32_t a, uint32_t b) {
    Product64 product;
    product.whole = static_cast<uint64_t>(a) * b;
    return product;
}

}  // namespace

uint32_t multiply_q16(uint32_t a, uint32_t b) {
    const Product64 product = multiply_full(a, b);
    if (product.quarters[3] != 0) return 0xFFFFFFFF;
    return (static_cast<uint32_t>(product.quarters[2]) << 16) | product.quarters[1];
}

uint32_t multiply_q32(uint32_t a, uint32_t b) { return multiply_full(a, b).halves[1]; }

uint32_t multiply_saturated(uint32_t a, uint32_t b) {
    const Product64 product = multiply_full(a, b);
    return product.halves[1] != 0 ? 0xFFFFFFFF : product.halves[0];
}

Fixed48 run_time(uint8_t n, uint32_t interval_q16, int32_t add_q16) {
    Fixed48 time = multiply(interval_q16, n);
    if (n < 2 || add_q16 == 0) return time;
    const uint16_t pairs = static_cast<uint16_t>(static_cast<uint16_t>(n * (n - 1u)) >> 1);
    const uint32_t add = static_cast<uint32_t>(add_q16);
    if (add_q16 < 0) {
        subtract_from(time, multiply(0 - add, pairs));
    } else {
        add_to(time, multiply(add, pairs));
    }
    return time;
}

}  // namespace planarm
