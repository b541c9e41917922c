// A segment as the queue holds it, and the rules that its moves must keep.
#pragma once

#include <stdint.h>

#include "messages.h"
#include "reader.h"

namespace planarm {

// Steps with intervals in 2^-16 ticks, or in 2^-8.
struct Steps {
    uint32_t interval;
    uint32_t add;  // modulo 2^32
    uint16_t count;
    bool positive;
    uint8_t slow;  // 0: 2^-16
};

// One joint's steps in a segment: step n rises first_ticks + floor(n I + n (n - 1) / 2 A) ticks after its
// start.
struct Move : Steps {
    uint32_t first_ticks;
};

// Of a SEGMENTS payload, before its segments: slow, fast and need.
constexpr uint8_t SEGMENTS_HEAD_BYTES = wire::SEGMENTS_MIN_BYTES - 1 - wire::JOINTS;

struct SegmentHead {
    uint32_t duration_ticks;
    bool last;
};

// Where a joint is at the end of the queue.
struct JointEnd {
    static constexpr uint16_t FOREVER = 0xFFFF;
    uint16_t rest_ticks;  // since its last step, saturated; FOREVER when it has not moved yet
    int32_t usteps;
    bool positive;  // the direction of that step
};

// Least time between two steps of a joint in opposite directions.
constexpr uint16_t MIN_REVERSAL_TICKS = wire::MIN_INTERVAL_TICKS + wire::MIN_DIR_SETUP_TICKS;

// Ticks from a move's first step to its last; longer than any segment when an interval breaks its limits.
constexpr uint32_t NO_RUN = 0x80000000;
uint32_t run_ticks(const Move& move);

// Read the fields of the next segment: its head, then a move for each joint.
void read_head(Reader& reader, SegmentHead& head);
void read_move(Reader& reader, Move& move);

// Checks a move that follows after `end` in a segment so long, and carries `end` on to the segment's. False
// when it breaks a limit.
bool check_move(const Move& move, uint32_t duration_ticks, JointEnd& end);

}  // namespace planarm
