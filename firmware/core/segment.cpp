#include "segment.h"

#include "fixed.h"

namespace planarm {

namespace {

constexpr uint32_t LEAST_INTERVAL_Q16 = static_cast<uint32_t>(wire::MIN_INTERVAL_TICKS) << 16;
constexpr uint32_t MOST_INTERVAL_Q16 = static_cast<uint32_t>(wire::MAX_INTERVAL_TICKS) << 16;

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
[[gnu::noinline]] bool check_move(const Move& move, uint32_t duration_ticks, Rest& rest) {
    if (move.steps == 0) {
        rest.ticks = add_saturated(rest.ticks, duration_ticks);
        return true;
    }
    if (move.steps > wire::MAX_SEGMENT_STEPS || move.first_ticks >= duration_ticks) return false;
    uint32_t last_ticks;
    if (!run_ticks(move, last_ticks)) return false;
    last_ticks += move.first_ticks;
    if (last_ticks >= duration_ticks) return false;

    const uint16_t least_ticks =
        move.positive == rest.positive ? wire::MIN_INTERVAL_TICKS : MIN_REVERSAL_TICKS;
    if (add_saturated(rest.ticks, move.first_ticks) < least_ticks) return false;
    rest.ticks = duration_ticks - last_ticks;
    rest.positive = move.positive;
    return true;
}

}  // namespace

// Intervals change by the same amount each time, so all are in their limits when the first and the last are.
bool run_ticks(const Move& move, uint32_t& ticks) {
    ticks = 0;
    if (move.steps < 2) return true;
    const uint32_t first = move.interval_q16;
    if (first < LEAST_INTERVAL_Q16 || first > MOST_INTERVAL_Q16) return false;
    const bool shrinks = move.add_q16 < 0;
    const uint32_t add = static_cast<uint32_t>(move.add_q16);
    const Fixed48 to_last = multiply(shrinks ? 0 - add : add, static_cast<uint16_t>(move.steps - 2));
    if (to_last.high > 0xFFFF) return false;
    const uint32_t change = (to_last.high << 16) | to_last.low;
    if (change > (shrinks ? first - LEAST_INTERVAL_Q16 : MOST_INTERVAL_Q16 - first)) return false;
    // n I + n (n - 1) / 2 A for n = steps - 1; the change is (n - 1) A, which is even when n is not.
    const uint16_t n = static_cast<uint16_t>(move.steps - 1);
    Fixed48 time = multiply(first, n);
    const Fixed48 grown =
        (n & 1) != 0 ? multiply(change >> 1, n) : multiply(change, static_cast<uint16_t>(n >> 1));
    if (shrinks) {
        subtract_from(time, grown);
    } else {
        add_to(time, grown);
    }
    ticks = time.high;
    return true;
}

void read_segment(Reader& reader, Segment& segment) {
    const uint32_t duration_flags = reader.varuint();
    segment.duration_ticks = duration_flags >> 1;
    segment.last = (duration_flags & 1) != 0;
    for (Move& move : segment.moves) read_move(reader, move);
}

bool check_segment(const Segment& segment, Rest (&rests)[wire::JOINTS]) {
    const uint32_t duration_ticks = segment.duration_ticks;
    if (duration_ticks == 0 || duration_ticks > wire::MAX_SEGMENT_TICKS) return false;
    const Move* move = segment.moves;
    for (Rest& rest : rests) {
        if (!check_move(*move++, duration_ticks, rest)) return false;
    }
    return true;
}

}  // namespace planarm
