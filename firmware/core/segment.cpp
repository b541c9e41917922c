#include "segment.h"

#include "fixed.h"

namespace planarm {

namespace {

// Limits of intervals in units of 2^16: ticks, or 2^8 ticks in a slow move. What 32 bits hold is not too
// long.
constexpr uint16_t LEAST_SLOW = wire::MIN_SLOW_INTERVAL_TICKS >> 8;
static_assert(wire::MAX_INTERVAL_TICKS == 0xFFFF && wire::MAX_SLOW_INTERVAL_TICKS == 0xFFFFFF, "of 32 bits");
static_assert((wire::MIN_SLOW_INTERVAL_TICKS & 0xFF) == 0, "whole units");
static_assert(wire::SLOW_INTERVAL_TICKS == 0x10000, "the fourth byte tells");

}  // namespace

// Intervals change by the same amount each time, so all are in their limits when the first and the last are.
uint32_t run_ticks(const Move& move) {
    if (move.count < 2) return 0;
    const uint32_t first = move.interval;
    const bool shrinks = static_cast<int32_t>(move.add) < 0;
    const uint32_t change =
        multiply_saturated(shrinks ? 0 - move.add : move.add, static_cast<uint16_t>(move.count - 2));
    const uint32_t last = shrinks ? first - change : first + change;
    const bool fits = (last < first) == (shrinks && change != 0);
    uint16_t least = wire::MIN_INTERVAL_TICKS;
    // n (first + last) / 2 for n = steps - 1 intervals.
    uint16_t n = static_cast<uint16_t>(move.count - 1);
    if (move.slow != 0) {
        if (n >= wire::MAX_COARSE_STEPS) return NO_RUN;
        least = LEAST_SLOW;
        n = static_cast<uint16_t>(n << 8);
    }
    if (!fits || first >> 16 < least || last >> 16 < least) return NO_RUN;
    Fixed48 twice = multiply(first, n);
    add_to(twice, multiply(last, n));
    return twice.high >> 1;
}

void read_head(Reader& reader, SegmentHead& head) {
    const uint32_t duration_flags = reader.varuint();
    head.duration_ticks = duration_flags >> 1;
    head.last = (duration_flags & 1) != 0;
}

// From 2^-8, modulo 2^32.
[[gnu::noinline]] static void to_q16(uint32_t& value) { value <<= 8; }

void read_move(Reader& reader, Move& move) {
    const uint32_t steps_dir = reader.varuint();
    move = Move();
    move.positive = (steps_dir & 1) != 0;
    // More steps than fit are kept as too many, for check_move to refuse.
    const uint16_t steps =
        steps_dir > 0xFFFF ? 0xFFFF : static_cast<uint16_t>(static_cast<uint16_t>(steps_dir) >> 1);
    move.count = steps;
    if (steps == 0) return;
    move.first_ticks = reader.varuint();
    if (steps == 1) return;
    move.interval = reader.varuint();
    move.slow = static_cast<uint8_t>(move.interval >> 24);
    move.add = static_cast<uint32_t>(reader.varint());
    if (move.slow != 0) return;
    to_q16(move.interval);
    if (steps <= wire::MAX_COARSE_STEPS) to_q16(move.add);
}

// A rest that is so much longer; what does not fit is FOREVER. `ticks` are less than 2^31.
[[gnu::noinline]] uint16_t longer_rest(uint16_t rest_ticks, uint32_t ticks) {
    ticks += rest_ticks;
    return ticks < JointEnd::FOREVER ? static_cast<uint16_t>(ticks) : JointEnd::FOREVER;
}

bool check_move(const Move& move, uint32_t duration_ticks, JointEnd& end) {
    if (move.count == 0) {
        end.rest_ticks = longer_rest(end.rest_ticks, duration_ticks);
        return true;
    }
    if (move.count > wire::MAX_SEGMENT_STEPS || move.first_ticks >= duration_ticks) return false;
    const uint32_t last_ticks = move.first_ticks + run_ticks(move);
    if (last_ticks >= duration_ticks) return false;

    const uint16_t least_ticks =
        move.positive == end.positive ? wire::MIN_INTERVAL_TICKS : MIN_REVERSAL_TICKS;
    if (longer_rest(end.rest_ticks, move.first_ticks) < least_ticks) return false;
    end.rest_ticks = longer_rest(0, duration_ticks - last_ticks);
    end.positive = move.positive;
    const uint32_t steps = move.count;
    end.usteps =
        static_cast<int32_t>(static_cast<uint32_t>(end.usteps) + (move.positive ? steps : 0 - steps));
    return true;
}

}  // namespace planarm
