// The motion in progress: the queue of segments, and the path clock that works it off.
//
// A segment is staged when received, committed with its whole frame, prepared (its runs handed to the step
// engine) shortly before it starts, and executed when the clock passes its end.
#pragma once

#include <stdint.h>

#include "messages.h"
#include "segment.h"

namespace planarm {
namespace motion {

enum class Progress : uint8_t { GOING, DONE, MISSED, UNDERRUN };

struct Ledger {
    uint32_t ticks;  // the moment it is told for
    uint32_t executed_segments;
    int32_t position_usteps[wire::JOINTS];
};

// Empty queue, ledger 0. For start-up, before interrupts are on.
void reset();

// True when a segment marked as the motion's last is queued or staged: nothing may follow it.
bool is_complete();

// Reads a segment, checks it against those before it and holds it back. OK, BUSY (no slot), MALFORMED or
// OUT_OF_RANGE.
wire::Result stage(Reader& reader);
// Appends the staged segments. When they come too late for a motion that has nothing else left to do, it
// forgets them and returns false: the motion then ends in an underrun, after the last step that came in time.
bool commit();
// Forgets the staged segments.
void discard();

bool is_empty();
uint8_t free_slots();

// The first queued segment starts at `start_ticks`.
void start(uint32_t start_ticks);

// Moves the motion on; to be called often, at least every few hundred microseconds while it lasts.
Progress serve(uint32_t now_ticks);

// Stops all steps at once and drops the queue. The ledger stays true.
void halt(uint32_t now_ticks);

Ledger ledger();

}  // namespace motion
}  // namespace planarm
