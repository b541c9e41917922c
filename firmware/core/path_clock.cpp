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

// At most twice the stretch, so that a quadratic in the number of steps stays a good likeness.
uint32_t slowed(const Change& change) {
    uint32_t growth = change.stretch;
    const uint32_t relative = relative_change(change, change.stretch);
    if (relative < ONE) growth = multiply_q16(growth, relative);
    const uint32_t end = change.stretch + growth;
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

}  // namespace

uint32_t rate_value(uint8_t code) {
    const uint8_t mantissa = static_cast<uint8_t>(code & 0x0F);
    const uint8_t exponent = static_cast<uint8_t>(code >> 4);
    if (exponent == 0) return mantissa;
    uint32_t value = 16u + mantissa;
    for (uint8_t i = 1; i < exponent; ++i) value <<= 1;
    return value;
}

uint32_t stretch_after(const Change& change) {
    if (change.stretch == change.target) return change.target;
    return change.stretch < change.target ? slowed(change) : sped_up(change);
}

void Slice::begin(const Stretch& path) {
    path_ = path;
    reciprocal_ = 0;
    ticks_ = path.path_ticks;
    plain_ = path.s0 == ONE && path.s1 == ONE;
    if (plain_) return;
    ticks_ = multiply_q16(path.path_ticks, (path.s0 + path.s1) >> 1);
    if (path.s0 != path.s1) reciprocal_ = 0xFFFFFFFF / path.path_ticks;
}

uint32_t Slice::stretch_at(uint16_t path) const {
    const uint16_t share = static_cast<uint16_t>(multiply(reciprocal_, path).high);  // of the slice, in 2^-16
    const bool falls = path_.s1 < path_.s0;
    const uint32_t whole = falls ? path_.s0 - path_.s1 : path_.s1 - path_.s0;
    const uint32_t change = multiply(whole, share).high;
    return falls ? path_.s0 - change : path_.s0 + change;
}

uint32_t Slice::ticks_at(uint16_t path) const {
    if (is_plain()) return path_.start_ticks + path;
    const uint32_t end = stretch_at(path);
    const uint32_t mean = (path_.s0 + end + (end < path_.s0 ? 1 : 0)) >> 1;  // rounded to the start's side
    return path_.start_ticks + multiply(mean, path).high;
}

}  // namespace path_clock
}  // namespace planarm
