#include "segment.h"

#include "fixed.h"

namespace planarm {

namespace {

constexpr uint32_t LEAST_INTERVAL_Q16 = static_cast<uint32_t>(wire::MIN_INTERVAL_TICKS) << 16;
constexpr uint32_t MOST_INTERVAL_Q16 = static_cast<uint32_t>(wire::MAX_INTERVAL_TICKS) << 16;

bool interval_in_limits(uint32_t interval_q16) {
    return interval_q16 >= LEAST_INTERVAL_Q16 && interval_q16 <= MOST_INTERVAL_Q16;
}

// The last interval of a move of two steps or more; false when it is beyond what 32 bits hold.
bool find_last_interval(const Move& move, uint32_t& last_q16) {
    const uint32_t add = static_cast<uint32_t>(move.add_q16);
    const bool shrinking = move.add_q16 < 0;
    const Fixed48 change = multiply(shrinking ? 0 - add : add, static_cast<uint16_t>(move.steps - 2));
    if (change.high > 0xFFFF) return false;
    const uint32_t change_q16 = (change.high << 16) | change.low;
    last_q16 = shrinking ? move.interval_q16 - change_q16 : move.interval_q16 + change_q16;
    return shrinking ? change_q16 <= move.interval_q16 : last_q16 >= change_q16;
}

void read_move(Reader& reader, Move& move) {
    const uint32_t steps_dir = reader.varuint();
    const uint32_t steps = steps_dir >> 1;
    move.positive = (steps_dir & 1) != 0;
    // More steps than fit are kept as too many, for check_move to refuse.
    move.steps = steps > wire::MAX_SEGMENT_STEPS ? 0xFFFF : static_cast<uint16_t>(steps);
    move.first_ticks = steps >= 1 ? reader.varuint() : 0;
    const uint32_t interval_q8 = steps >= 2 ? reader.varuint() : 0;
    // What does not fit is kept as too long, for check_move to refuse.
    move.interval_q16 = interval_q8 > 0xFFFFFF ? 0xFFFFFFFF : interval_q8 << 8;
    move.add_q16 = steps >= 2 ? reader.varint() : 0;
}

// Checks one joint's move and carries its rest on to the segment's end.
bool check_move(const Move& move, uint32_t duration_ticks, uint32_t& rest_ticks, bool& rest_positive) {
    if (move.steps == 0) {
        const uint32_t rested = rest_ticks + duration_ticks;
        rest_ticks = rested < rest_ticks ? Rest::FOREVER : rested;
        return true;
    }
    if (move.steps > wire::MAX_SEGMENT_STEPS || move.first_ticks >= duration_ticks) return false;
    uint32_t last_ticks;
    if (!run_ticks(move, last_ticks)) return false;
    last_ticks += move.first_ticks;
    if (last_ticks >= duration_ticks) return false;

    const uint32_t gap_ticks = rest_ticks + move.first_ticks;
    const bool far = gap_ticks < rest_ticks;  // beyond what 32 bits hold
    const uint16_t least_ticks =
        move.positive == rest_positive ? wire::MIN_INTERVAL_TICKS : MIN_REVERSAL_TICKS;
    if (!far && gap_ticks < least_ticks) return false;
    rest_ticks = duration_ticks - last_ticks;
    rest_positive = move.positive;
    return true;
}

}  // namespace

// Intervals change by the same amount each time, so all are in their limits when the first and the last are.
bool run_ticks(const Move& move, uint32_t& ticks) {
    ticks = 0;
    if (move.steps < 2) return true;
    const uint32_t first = move.interval_q16;
    uint32_t last;
    if (!interval_in_limits(first) || !find_last_interval(move, last) || !interval_in_limits(last))
        return false;
    // n I + n (n - 1) / 2 A = n (first + last) / 2 for n = steps - 1: an integer, so with an odd sum n is
    // even.
    const uint16_t n = static_cast<uint16_t>(move.steps - 1);
    const Fixed48 whole = multiply((first >> 1) + (last >> 1) + (first & last & 1), n);
    const uint16_t odd_half = ((first ^ last) & 1) != 0 ? static_cast<uint16_t>(n >> 1) : 0;
    ticks = whole.high + (static_cast<uint16_t>(whole.low + odd_half) < odd_half ? 1 : 0);
    return true;
}

void read_segment(Reader& reader, Segment& segment) {
    const uint32_t duration_flags = reader.varuint();
    segment.duration_ticks = duration_flags >> 1;
    segment.last = (duration_flags & 1) != 0;
    for (Move& move : segment.moves) read_move(reader, move);
}

wire::Result check_segment(Segment& segment, Rest& rest) {
    const uint32_t duration_ticks = segment.duration_ticks;
    if (duration_ticks == 0 || duration_ticks > wire::MAX_SEGMENT_TICKS) return wire::Result::OUT_OF_RANGE;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        if (!check_move(segment.moves[joint], duration_ticks, rest.ticks[joint], rest.positive[joint])) {
            return wire::Result::OUT_OF_RANGE;
        }
    }
    return wire::Result::OK;
}

}  // namespace planarm
