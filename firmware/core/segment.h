// A segment as the queue holds it, and the rules it must keep.
#pragma once

#include <stdint.h>

#include "messages.h"
#include "reader.h"

namespace planarm {

// One joint's steps in a segment: step n rises first_ticks + floor((n I + n (n - 1) / 2 A) / 2^16) ticks
// after its start.
struct Move {
    uint32_t first_ticks;
    uint32_t interval_q16;
    int32_t add_q16;
    uint16_t steps;
    bool positive;
};

struct Segment {
    uint32_t duration_ticks;
    bool last;
    Move moves[wire::JOINTS];
};

// Time from a joint's last queued step to the end of the queue, saturated; a joint that has not moved yet
// counts as resting for ever.
struct Rest {
    static constexpr uint32_t FOREVER = 0xFFFFFFFF;
    uint32_t ticks = FOREVER;
    bool positive = false;  // the direction of that step
};

// Least time between two steps of a joint in opposite directions.
constexpr uint16_t MIN_REVERSAL_TICKS = wire::MIN_INTERVAL_TICKS + wire::MIN_DIR_SETUP_TICKS;

// Whether all intervals of a move are in their limits; if so, `ticks` are those from its first to its last
// step.
bool run_ticks(const Move& move, uint32_t& ticks);

// Reads the fields of the next segment.
void read_segment(Reader& reader, Segment& segment);

// Checks a segment that follows after the joints' rests, and carries those on to its end. False when it
// breaks a limit.
bool check_segment(const Segment& segment, Rest (&rests)[wire::JOINTS]);

}  // namespace planarm
