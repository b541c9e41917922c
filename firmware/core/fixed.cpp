#include "fixed.h"

namespace planarm {

void increase(uint32_t& value, uint32_t by) { value += by; }

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
