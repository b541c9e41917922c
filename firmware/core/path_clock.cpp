#include "path_clock.h"

#include "fixed.h"

namespace planarm {
namespace path_clock {

namespace {

// The change of a slice that is stretched by `stretch` where it changes most, in relation to that: rate x
// path x stretch^2, in 2^-16.
uint32_t relative_change(const Change& change, uint32_t stretch) {
    return multiply_q32(multiply_saturated(change.rate, change.path_ticks), multiply_q16(stretch, stretch));
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

// At most twice the stretch, so that a quadratic in the number of steps stays a good likeness.
uint32_t slowed(const Change& change) {
    const uint32_t relative = relative_change(change, change.stretch);
    uint32_t end =
        change.stretch + (relative >= ONE ? change.stretch : multiply_q16(change.stretch, relative));
    if (end > MAX_STRETCH) end = MAX_STRETCH;
    return end < change.target ? end : change.target;
}

// The root of s + F D s^3 = s0 by Newton's method from above: it comes down to the root and does not pass it
// but for a rounding, where it ends. So each turn gives a lawful stretch and three are near enough.
uint32_t sped_up(const Change& change) {
    uint32_t end = change.stretch;
    for (uint8_t turn = 0; turn < 3; ++turn) {
        const uint32_t relative = relative_change(change, end);
        if (relative >= 8 * ONE) {  // the step is nearly end / 3
            end -= end >> 2;
            continue;
        }
        const uint32_t growth = multiply_q16(end, relative);
        const uint32_t gap = change.stretch - end;
        if (growth <= gap) break;
        const uint32_t slope = ((ONE + 3 * relative) >> 8) + 1;
        end -= ((growth - gap) / slope) << 8;
    }
    return end > change.target ? end : change.target;
}

Slice::Slice(const Ends& ends) : ends_(ends), ticks_(ends.path_ticks) {
    if (is_plain()) return;
    const uint32_t mean =
        ends.s0 < ends.s1 ? ends.s0 + ((ends.s1 - ends.s0) >> 1) : ends.s1 + ((ends.s0 - ends.s1) >> 1);
    ticks_ = multiply_q16(ends.path_ticks, mean);
    if (ends.s0 != ends.s1) reciprocal_ = 0xFFFFFFFF / ends.path_ticks;
}

uint32_t Slice::change_at(uint16_t path) const {
    if (ends_.s0 == ends_.s1) return 0;
    const Fixed48 share = multiply(reciprocal_, path);  // of the slice, in 2^-32
    const uint32_t whole = ends_.s0 < ends_.s1 ? ends_.s1 - ends_.s0 : ends_.s0 - ends_.s1;
    return multiply(whole, static_cast<uint16_t>(share.high)).high;
}

uint32_t Slice::stretch_at(uint16_t path) const {
    const uint32_t change = change_at(path);
    return ends_.s0 < ends_.s1 ? ends_.s0 + change : ends_.s0 - change;
}

uint32_t Slice::ticks_at(uint16_t path) const {
    if (is_plain()) return ends_.start_ticks + path;
    const uint32_t half_change = change_at(path) >> 1;
    const uint32_t mean = ends_.s0 < ends_.s1 ? ends_.s0 + half_change : ends_.s0 - half_change;
    return ends_.start_ticks + multiply(mean, path).high;
}

}  // namespace path_clock
}  // namespace planarm
