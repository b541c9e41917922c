#include "path_clock.h"

namespace planarm {
namespace path_clock {

namespace {

// The change of a slice that is stretched by `stretch` where it changes most, in relation to that: rate x
// path x stretch^2, in 2^-16.
uint32_t relative_change(uint32_t rate_path, uint32_t stretch) {
    return multiply_q32(rate_path, multiply_q16(stretch, stretch));
}

// At most twice the stretch, so that a quadratic in the number of steps stays a good likeness.
uint32_t slowed(uint32_t stretch, uint32_t rate_path) {
    const uint32_t relative = relative_change(rate_path, stretch);
    return stretch + (relative < ONE ? multiply_q16(stretch, relative) : stretch);
}

// The root of s + F D s^3 = s0 by Newton's method from above: it comes down to the root and does not pass it
// but for a rounding, where it ends. So each turn gives a lawful stretch and three are near enough.
uint32_t sped_up(uint32_t stretch, uint32_t rate_path) {
    uint32_t end = stretch;
    for (uint8_t turn = 0; turn < 3; ++turn) {
        const uint32_t relative = relative_change(rate_path, end);
        if (relative >= 8 * ONE) {  // the step is nearly end / 3
            end -= end >> 2;
            continue;
        }
        const uint32_t growth = multiply_q16(end, relative);
        const uint32_t gap = stretch - end;
        if (growth <= gap) break;
        const uint32_t slope = ((ONE + 3 * relative) >> 8) + 1;
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
    const uint32_t rate_path = multiply_saturated(way.rate, way.path_ticks);
    if (stretch < target) {
        const uint32_t end = slowed(stretch, rate_path);
        return end < target ? end : target;
    }
    const uint32_t end = sped_up(stretch, rate_path);
    return end > target ? end : target;
}

void Slice::follow(const Way& way) {
    from_path_ = static_cast<uint16_t>(end_path_);
    increase(end_path_, way.path_ticks);
    start_ticks_ = end_ticks_;
    ends_segment_ = way.ends_segment;
    s0_ = s1_;
    if (s1_ != way.target) s1_ = stretch_after(s1_, way);
    plain_ = s0_ == ONE && s1_ == ONE;
    const uint32_t ticks = plain_ ? way.path_ticks : multiply((s0_ + s1_) >> 1, way.path_ticks).high;
    increase(end_ticks_, ticks);
    if (s0_ != s1_) reciprocal_ = 0xFFFFFFFF / way.path_ticks;
}

uint32_t Slice::stretch_at(uint16_t path) const {
    if (s0_ == s1_) return s0_;
    const uint16_t share = static_cast<uint16_t>(multiply(reciprocal_, path).high);  // of the slice, in 2^-16
    if (s0_ < s1_) return s0_ + multiply(s1_ - s0_, share).high;
    return s0_ - multiply(s0_ - s1_, share).high;
}

uint32_t Slice::stretched_ticks_at(uint16_t path) const {
    const uint32_t end = stretch_at(path);
    const uint32_t mean = (s0_ + end + (end < s0_ ? 1 : 0)) >> 1;  // rounded to the start's side
    return start_ticks_ + multiply(mean, path).high;
}

}  // namespace path_clock
}  // namespace planarm
