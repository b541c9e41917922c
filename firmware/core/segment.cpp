#include "segment.h"

#include "fixed.h"

namespace planarm {

namespace {

constexpr uint32_t LEAST_INTERVAL_Q16 = static_cast<uint32_t>(wire::MIN_INTERVAL_TICKS) << 16;
constexpr uint32_t MOST_INTERVAL_Q16 = static_cast<uint32_t>(wire::MAX_INTERVAL_TICKS) << 16;

bool is_interval(uint32_t ticks_q16) {
    return ticks_q16 >= LEAST_INTERVAL_Q16 && ticks_q16 <= MOST_INTERVAL_Q16;
}

}  // namespace

// Intervals change by the same amount each time, so all are in their limits when the first and the last are.
uint32_t run_ticks(const Move& move) {
    if (move.steps < 2) return 0;
    const uint32_t first = move.interval_q16;
    const bool shrinks = move.add_q16 < 0;
    const uint32_t add = static_cast<uint32_t>(move.add_q16);
    const uint32_t change =
        multiply_saturated(shrinks ? 0 - add : add, static_cast<uint16_t>(move.steps - 2));
    const uint32_t last = shrinks ? first - change : first + change;
    const bool fits = (last < first) == (shrinks && change != 0);
    if (!fits || !is_interval(first) || !is_interval(last)) return NO_RUN;
    // n (first + last) / 2 for n = steps - 1 intervals.
    const uint16_t n = static_cast<uint16_t>(move.steps - 1);
    Fixed48 twice = multiply(first, n);
    add_to(twice, multiply(last, n));
    return twice.high >> 1;
}

void read_head(Reader& reader, SegmentHead& head) {
    const uint32_t duration_flags = reader.varuint();
    head.duration_ticks = duration_flags >> 1;
    head.last = (duration_flags & 1) != 0;
}

void read_move(Reader& reader, Move& move) {
    const uint32_t steps_dir = reader.varuint();
    move.positive = (steps_dir & 1) != 0;
    // More steps than fit are kept as too many, for check_move to refuse.
    const uint16_t steps =
        steps_dir > 0xFFFF ? 0xFFFF : static_cast<uint16_t>(static_cast<uint16_t>(steps_dir) >> 1);
    move.steps = steps;
    move.first_ticks = 0;
    move.interval_q16 = 0;
    move.add_q16 = 0;
    if (steps == 0) return;
    move.first_ticks = reader.varuint();
    if (steps == 1) return;
    // What does not fit is kept as too long, for check_move to refuse.
    const uint32_t interval_q8 = reader.varuint();
    move.interval_q16 = interval_q8 > 0xFFFFFF ? 0xFFFFFFFF : interval_q8 << 8;
    move.add_q16 = reader.varint();
}

// A rest that is so much longer; what does not fit is FOREVER. `ticks` are less than 2^31.
[[gnu::noinline]] uint16_t longer_rest(uint16_t rest_ticks, uint32_t ticks) {
    ticks += rest_ticks;
    return ticks < JointEnd::FOREVER ? static_cast<uint16_t>(ticks) : JointEnd::FOREVER;
}

bool check_move(const Move& move, uint32_t duration_ticks, JointEnd& end) {
    if (move.steps == 0) {
        end.rest_ticks = longer_rest(end.rest_ticks, duration_ticks);
        return true;
    }
    if (move.steps > wire::MAX_SEGMENT_STEPS || move.first_ticks >= duration_ticks) return false;
    const uint32_t last_ticks = move.first_ticks + run_ticks(move);
    if (last_ticks >= duration_ticks) return false;

    const uint16_t least_ticks =
        move.positive == end.positive ? wire::MIN_INTERVAL_TICKS : MIN_REVERSAL_TICKS;
    if (longer_rest(end.rest_ticks, move.first_ticks) < least_ticks) return false;
    end.rest_ticks = longer_rest(0, duration_ticks - last_ticks);
    end.positive = move.positive;
    const uint32_t steps = move.steps;
    end.usteps =
        static_cast<int32_t>(static_cast<uint32_t>(end.usteps) + (move.positive ? steps : 0 - steps));
    return true;
}

}  // namespace planarm
