#include "path_clock.h"

namespace planarm {
namespace path_clock {

namespace {

// The change of a slice that is stretched by `stretch` where it changes most, in relation to that: rate x
// path x stretch^2, in 2^-16. At most 1: so a quadratic in the number of steps stays a good likeness, and no
// slice takes much less time than the main program takes for the next one.
uint32_t relative_change(uint32_t rate_path, uint32_t stretch) {
    return least_of(multiply_q32(rate_path, multiply_q16(stretch, stretch)), ONE);
}

uint32_t slowed(uint32_t stretch, uint32_t rate_path) {
    return stretch + multiply_q16(stretch, relative_change(rate_path, stretch));
}

// The root of s + F D s^3 = s0 by Newton's method from above: it comes down to the root and does not pass it
// but for a rounding, where it ends. So each turn gives a lawful stretch and three are near enough. One with
// a smaller change than there is stays above, too.
uint32_t sped_up(uint32_t stretch, uint32_t rate_path) {
    uint32_t end = stretch;
    for (uint8_t turn = 0; turn < 3; ++turn) {
        const uint32_t relative = relative_change(rate_path, end);
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
    uint8_t exponent = static_cast<uint8_t>(code >> 4);
    uint32_t value = mantissa;
    if (exponent == 0) return value;
    value += 16;
    while (--exponent != 0) value <<= 1;
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

void Slice::follow() {
    start_ticks_ = end_ticks_;
    s0_ = s1_;
    if (s1_ != way_.target) s1_ = stretch_after(s1_, way_);
    plain_ = (s0_ | s1_) == ONE;  // neither is less
    increase(end_ticks_, multiply_high((s0_ + s1_) >> 1, way_.path_ticks));
    falls_ = s1_ < s0_;
    range_ = falls_ ? s0_ - s1_ : s1_ - s0_;
    if (range_ == 0 || way_.path_ticks == divided_ticks_) return;
    divided_ticks_ = way_.path_ticks;
    reciprocal_ = 0xFFFFFFFF / divided_ticks_;
}

// From the lesser end up, whichever that is: never below a stretch of 1, where steps would come closer than
// the least interval, whose ticks the step interrupt needs all.
uint32_t Slice::stretch_at(uint16_t path) const {
    if (range_ == 0) return s0_;
    uint16_t share = static_cast<uint16_t>(multiply_high(reciprocal_, path));  // of the slice, in 2^-16
    if (falls_) share = static_cast<uint16_t>(~share);
    return multiply_high(range_, share) + (falls_ ? s1_ : s0_);
}

uint32_t Slice::ticks_at(uint16_t path) const {
    uint32_t ticks = path;
    if (!plain_) ticks = multiply_high((stretch_at(path) + s0_) >> 1, path);
    return ticks + start_ticks_;
}

uint16_t Slice::stretched(uint16_t ticks, uint16_t path) const {
    return static_cast<uint16_t>(least_of(multiply_high(stretch_at(path), ticks), 0xFFFF));
}

}  // namespace path_clock
}  // namespace planarm
