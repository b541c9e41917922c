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

namespace planarm {
namespace motion {

enum class Progress : uint8_t {
    GOING,
    // as supervisor::Event has them
    AT_REST,  // as was wished
    STARVED,  // at rest because the queue ran low
    FED,      // goes on after that
    DONE,
    // faults
    MISSED,    // a step came too late
    UNDERRUN,  // the queue ran empty before the last segment
};

// What the path clock is to do.
enum class Wish : uint8_t { GO, REST, REST_QUICKLY };

// Empty queue, ledger 0, defaults. For start-up, before interrupts are on.
void reset();

// True when the next call of serve should not wait for other work.
bool is_urgent();
// True when a motion has nothing left to do, and so soon an end that what is queued now would come too late:
// it then ends in an underrun, after the last step that came in time.
bool is_too_late();

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

}  // namespace motion
}  // namespace planarm
