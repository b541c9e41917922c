// The segments that arrive: a SEGMENTS payload is checked segment by segment, then queued as a whole.
#pragma once

#include <stdint.h>

#include "messages.h"
#include "step_engine.h"

namespace planarm {
namespace intake {

// Begins anew, with an empty queue: joints that have not moved yet, where they are.
void reset(const step_engine::Position& position);
// For an arm at rest.
void set_position(uint8_t joint, int32_t usteps);

// Begins to check a SEGMENTS payload. OK, BUSY (no room), MALFORMED, or WRONG_STATE after the motion's last.
wire::Result begin_check(const uint8_t* payload, uint8_t length);
// Checks its next segment. OK, MALFORMED, OUT_OF_RANGE, or WRONG_STATE after the motion's last.
wire::Result check_next();
// True when all of them are checked.
bool is_checked();
// The joint that a checked segment takes out of its soft limits, or wire::JOINTS.
uint8_t joint_out_of_limits();
// Queues the payload.
void commit(const uint8_t* payload, uint8_t length);

// True when the motion's last segment is queued.
bool is_complete();

// Path time of all queued segments not yet begun, as far as it matters: a segment longer than any need counts
// as this long.
constexpr uint32_t ENOUGH_TICKS = 0x1000000;
static_assert(0xFF * static_cast<uint32_t>(wire::NEED_UNIT_TICKS) + 2 * wire::STARVING_TICKS < ENOUGH_TICKS,
              "more than any need");
uint32_t path_ticks();
// A segment so long has begun.
void begin_segment(uint32_t ticks);

}  // namespace intake
}  // namespace planarm
