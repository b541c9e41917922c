#include "path_clock.h"

namespace planarm {
namespace path_clock {

namespace {

// The change of a slice that is stretched by `stretch` where it changes most, in relation to that, and at
// most `most`: rate x path x stretch^2, in 2^-16.
uint32_t relative_change(uint32_t rate_path, uint32_t stretch, uint8_t most) {
    const uint32_t relative = multiply_q32(rate_path, multiply_q16(stretch, stretch));
    return relative >> 16 < most ? relative : most * ONE;
}

// At most twice the stretch, so that a quadratic in the number of steps stays a good likeness.
uint32_t slowed(uint32_t stretch, uint32_t rate_path) {
    return stretch + multiply_q16(stretch, relative_change(rate_path, stretch, 1));
}

// The root of s + F D s^3 = s0 by Newton's method from above: it comes down to the root and does not pass it
// but for a rounding, where it ends. So each turn gives a lawful stretch and three are near enough. One with
// a smaller change than there is stays above, too.
uint32_t sped_up(uint32_t stretch, uint32_t rate_path) {
    uint32_t end = stretch;
    for (uint8_t turn = 0; turn < 3; ++turn) {
        const uint32_t relative = relative_change(rate_path, end, 8);
        const uint32_t growth = multiply_q16(end, relative);
        const uint32_t gap = stretch - end;
        if (growth <= gap) break;
        const uint32_t slope = ((ONE + multiply_low(relative, 3)) >> 8) + 1;
        end -= ((growth - gap) / slope) << 8;
    }
    return end;
}

}  // namespace

uint32_t rate_value(uint8_t code) {
    const uint8_t mantissa = static_cast<uint8_t>(code & 0x0F);
    const uint8_t exponent = static_cast<uint8_t>(code >> 4);
    if (exponent == 0) return mantissa;
    uint32_t value = 16u + mantissa;
    for (uint8_t i = 1; i < exponent; ++i) value <<= 1;
    return value;
}

uint32_t stretch_after(uint32_t stretch, const Way& way) {
    const uint32_t target = way.target;
    uint32_t rate = rate_value(stretch < target ? way.rates.slow : way.rates.fast);
    static_assert(wire::GENTLE_PERCENT == 50, "a half");
    if (way.gently) rate >>= 1;
    const uint32_t rate_path = multiply_saturated(rate, way.path_ticks);
    if (stretch < target) return least_of(slowed(stretch, rate_path), target);
    return most_of(sped_up(stretch, rate_path), target);
}

void Slice::follow(const Way& way) {
    path_ticks_ = way.path_ticks;
    start_ticks_ = end_ticks_;
    ends_segment_ = way.ends_segment;
    s0_ = s1_;
    if (s1_ != way.target) s1_ = stretch_after(s1_, way);
    plain_ = (s0_ | s1_) == ONE;  // neither is less
    increase(end_ticks_, multiply_high((s0_ + s1_) >> 1, way.path_ticks));
    if (s0_ != s1_) reciprocal_ = 0xFFFFFFFF / way.path_ticks;
}

// The shares add up to a little less than 1. Below a stretch of 1 steps would come closer than the least
// interval, whose ticks the step interrupt needs all.
uint32_t Slice::stretch_at(uint16_t path) const {
    if (s0_ == s1_) return s0_;
    const uint16_t share = static_cast<uint16_t>(multiply_high(reciprocal_, path));  // of the slice, in 2^-16
    return most_of(multiply_high(s0_, static_cast<uint16_t>(~share)) + multiply_high(s1_, share), ONE);
}

uint32_t Slice::ticks_at(uint16_t path) const {
    if (plain_) return start_ticks_ + path;
    return start_ticks_ + multiply_high((s0_ + stretch_at(path)) >> 1, path);
}

uint16_t Slice::stretched(uint16_t ticks, uint16_t path) const {
    const uint32_t longer = multiply_high(stretch_at(path), ticks);
    return longer < 0xFFFF ? static_cast<uint16_t>(longer) : 0xFFFF;
}

}  // namespace path_clock
}  // namespace planarm
