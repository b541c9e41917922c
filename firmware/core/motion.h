// The motion in progress: works the queue off along the path clock.
//
// A SEGMENTS payload is checked segment by segment when it comes, and queued as a whole. A segment is read
// again shortly before it starts, cut into slices of path time, and each slice's steps are handed to the step
// engine with the path clock's stretch of that moment. A hold, a stop, an override and a queue that runs low
// change the stretch from slice to slice; where all joints are slower than their start-stop speeds the clock
// may be frozen at any instant.
#pragma once

#include <stdint.h>

#include "messages.h"
#include "reader.h"

namespace planarm {
namespace motion {

enum class Progress : uint8_t {
    GOING,
    DONE,
    MISSED,    // a step came too late
    UNDERRUN,  // the queue ran empty before the last segment
    AT_REST,   // as was wished
    STARVED,   // at rest because the queue ran low
    FED,       // goes on after that
};

// What the path clock is to do.
enum class Wish : uint8_t { GO, REST, REST_QUICKLY };

// Empty queue, ledger 0, defaults. For start-up, before interrupts are on.
void reset();

// Begins to check a SEGMENTS payload. OK, BUSY (no room), MALFORMED, or WRONG_STATE after the motion's last.
wire::Result begin_check(const uint8_t* payload, uint8_t length);
// Checks its next segment. OK, MALFORMED, OUT_OF_RANGE, or WRONG_STATE after the motion's last.
wire::Result check_next();
// True when all of them are checked.
bool is_checked();
// The joint that a checked segment takes out of its soft limits, or wire::JOINTS.
uint8_t joint_out_of_limits();
// Queues the payload. When it comes too late for a motion that has nothing else left to do, it does not and
// returns false: the motion then ends in an underrun, after the last step that came in time.
bool commit(const uint8_t* payload, uint8_t length);

bool is_empty();
// True when the next call of serve should not wait for other work.
bool is_urgent();
uint16_t free_bytes();

// The first queued segment starts at `start_ticks`.
void start(uint32_t start_ticks);

void set_wish(Wish wish);
// 1 to 100.
void set_override(uint8_t percent);
uint8_t override_percent();
uint8_t rate_percent();

// Moves the motion on; to be called often, at least every few hundred microseconds while it lasts.
Progress serve();

// Stops all steps at once and drops the queue. The ledger stays true.
void halt();

// Tells the ledger as it is at the moment returned, in ticks.
uint32_t tell_ledger(wire::Ledger& ledger);
// For an arm at rest.
void set_position(uint8_t joint, int32_t usteps);

}  // namespace motion
}  // namespace planarm
