#include "path_clock.h"

namespace planarm {
namespace path_clock {

namespace {

// The change of a slice that is stretched by `stretch` where it changes most, in relation to that: rate x
// path x stretch^2, in 2^-16. Less than 1, as the products are saturated: so a quadratic in the number of
// steps stays a good likeness, and no slice takes much less time than the main program takes for the next
// one.
uint32_t relative_change(uint32_t rate_path, uint32_t stretch) {
    return multiply_q16(multiply_q16(rate_path, stretch), stretch) >> 16;
}

uint32_t slowed(uint32_t stretch, uint32_t rate_path) {
    return stretch + multiply_q16(stretch, relative_change(rate_path, stretch));
}

// Near the root of s + F D s^3 = s0, by one turn of Newton's method from s0, which comes down to the root and
// does not pass it: so the stretch is lawful. A turn takes as long as all else of it. What is small is
// divided with all of its digits: the clock would not come back to its pace by gentle rates.
uint32_t sped_up(uint32_t stretch, uint32_t rate_path) {
    const uint32_t relative = relative_change(rate_path, stretch);
    const uint32_t slope = ((ONE + multiply_low(relative, 3)) >> 8) + 1;
    const uint32_t growth = multiply_q16(stretch, relative);
    if (growth < ONE << 8) return stretch - (growth << 8) / slope;
    return stretch - ((growth / slope) << 8);
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

// By a rate's code, in 2^-32; saturated.
[[gnu::noinline]] static uint32_t rate_path(const Way& way, uint8_t code) {
    uint32_t rate = rate_value(code);
    static_assert(wire::GENTLE_PERCENT == 50, "a half");
    if (way.gently) rate >>= 1;
    return multiply_saturated(rate, way.path_ticks);
}

uint32_t stretch_after(uint32_t stretch, const Way& way) {
    if (stretch < way.target) return least_of(slowed(stretch, rate_path(way, way.rates.slow)), way.target);
    return most_of(sped_up(stretch, rate_path(way, way.rates.fast)), way.target);
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

uint32_t Slice::ticks_at(uint16_t path, uint32_t stretch) const {
    uint32_t ticks = path;
    if (!plain_) ticks = multiply_high((stretch + s0_) >> 1, path);
    return ticks + start_ticks_;
}

}  // namespace path_clock
}  // namespace planarm
