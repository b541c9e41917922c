#include "segment.h"

namespace planarm {

namespace {

// High 32 and low 16 bits of a 32 x 16 bit product.
struct Product {
    uint32_t high;
    uint16_t low;
};

Product multiply(uint32_t a, uint16_t b) {
    const uint32_t low = static_cast<uint32_t>(static_cast<uint16_t>(a)) * b;
    const uint32_t high = static_cast<uint32_t>(static_cast<uint16_t>(a >> 16)) * b + (low >> 16);
    return {high, static_cast<uint16_t>(low)};
}

uint32_t last_interval_q16(const Move& move) {
    return move.interval_q16 + static_cast<uint32_t>(move.add_q16) * static_cast<uint16_t>(move.steps - 2);
}

bool interval_in_limits(uint32_t interval_q16) {
    return interval_q16 >= static_cast<uint32_t>(wire::MIN_INTERVAL_TICKS) << 16 &&
           interval_q16 <= static_cast<uint32_t>(wire::MAX_INTERVAL_TICKS) << 16;
}

// Intervals change by the same amount each time, so all are in their limits when the first and the last are,
// and the way between these two did not wrap.
bool intervals_in_limits(const Move& move) {
    if (move.steps < 2) return true;
    const uint32_t size =
        move.add_q16 < 0 ? 0 - static_cast<uint32_t>(move.add_q16) : static_cast<uint32_t>(move.add_q16);
    const Product way = multiply(size, static_cast<uint16_t>(move.steps - 2));
    if (way.high > 0xFFFF) return false;
    const uint32_t last = last_interval_q16(move);
    const bool wrapped = move.add_q16 < 0 ? last > move.interval_q16 : last < move.interval_q16;
    return !wrapped && interval_in_limits(move.interval_q16) && interval_in_limits(last);
}

Move read_move(Reader& reader) {
    Move move = {};
    const uint32_t steps_dir = reader.varuint();
    move.positive = (steps_dir & 1) != 0;
    const uint32_t steps = steps_dir >> 1;
    // More steps than fit are kept as too many, for check_move to refuse.
    move.steps = steps > wire::MAX_SEGMENT_STEPS ? 0xFFFF : static_cast<uint16_t>(steps);
    if (steps >= 1) move.first_ticks = reader.varuint();
    if (steps >= 2) {
        move.interval_q16 = reader.varuint();
        move.add_q16 = reader.varint();
    }
    return move;
}

// Checks one joint's move and carries its rest on to the segment's end.
bool check_move(Move& move, uint32_t duration_ticks, uint32_t& rest_ticks) {
    if (move.steps == 0) {
        const uint32_t rested = rest_ticks + duration_ticks;
        rest_ticks = rested < rest_ticks ? Rest::FOREVER : rested;
        return true;
    }
    if (move.steps > wire::MAX_SEGMENT_STEPS || move.first_ticks >= duration_ticks) return false;
    if (!intervals_in_limits(move)) return false;
    const uint32_t last_ticks = move.first_ticks + run_ticks(move);
    if (last_ticks >= duration_ticks) return false;

    const uint32_t gap_ticks = rest_ticks + move.first_ticks;
    const bool far = gap_ticks < rest_ticks || gap_ticks > MAX_AHEAD_TICKS;
    if (!far && gap_ticks < wire::MIN_INTERVAL_TICKS) return false;
    move.near = !far;
    rest_ticks = duration_ticks - last_ticks;
    return true;
}

}  // namespace

uint32_t run_ticks(const Move& move) {
    if (move.steps < 2) return 0;
    // n I + n (n - 1) / 2 A = n (first interval + last interval) / 2, an integer for n = steps - 1.
    const uint16_t n = static_cast<uint16_t>(move.steps - 1);
    const Product first = multiply(move.interval_q16, n);
    const Product last = multiply(last_interval_q16(move), n);
    const uint16_t low = static_cast<uint16_t>(first.low + last.low);
    return (first.high + last.high + (low < first.low ? 1 : 0)) >> 1;
}

Segment read_segment(Reader& reader) {
    Segment segment = {};
    const uint32_t duration_flags = reader.varuint();
    segment.duration_ticks = duration_flags >> 1;
    segment.last = (duration_flags & 1) != 0;
    for (Move& move : segment.moves) move = read_move(reader);
    return segment;
}

wire::Result check_segment(Segment& segment, Rest& rest) {
    const uint32_t duration_ticks = segment.duration_ticks;
    if (duration_ticks == 0 || duration_ticks > wire::MAX_SEGMENT_TICKS) return wire::Result::OUT_OF_RANGE;
    for (uint8_t joint = 0; joint < wire::JOINTS; ++joint) {
        if (!check_move(segment.moves[joint], duration_ticks, rest.ticks[joint]))
            return wire::Result::OUT_OF_RANGE;
    }
    return wire::Result::OK;
}

}  // namespace planarm
