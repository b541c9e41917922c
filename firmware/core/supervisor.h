// States, what each event does in each of them, and the first fault: a table (supervisor.cpp). Nothing else
// switches the drivers, drops a motion or tells it to rest.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace supervisor {

enum class Event : uint8_t {
    // from the host
    ENABLE,
    RELEASE,
    SEGMENTS,
    START,
    CLEAR,
    HOLD,
    RESUME,
    STOP,
    QUICK_STOP,
    CONFIG,
    SOFT_LIMITS,
    HOME,
    SET_POSITION,
    // from the motion
    AT_REST,
    STARVED,
    FED,
    DONE,
    // CLEAR where the position is known
    CLEAR_KEPT,
};

enum class Outcome : uint8_t {
    NONE,
    ENERGISE,
    RELEASE,       // drops the motion, forgets the fault and releases the drivers
    DROP,          // drops the motion, at rest
    GO,            // the path clock goes on
    REST,          // it slows down to rest
    REST_QUICKLY,  // at once as the segments allow
    FORGET,        // drops the motion and forgets the fault; the drivers stay as they are
};

// Idle, without a fault. For start-up.
void reset();

wire::State state();
wire::Fault fault();
// The same for a STATUS: from then on the host knows of an emergency before it.
wire::Fault tell_fault();
uint8_t fault_detail();

// What a CLEAR is now: a fault that loses the position leaves nothing that the drivers could hold.
Event clear_event();

// True when the table has a row for the event in this state.
bool allows(Event event);

// Carries out the event's row. An event without one changes nothing.
void apply(Event event);

// Stops the steps and latches the fault. In the fault state nothing happens that could bring another.
void fail(wire::Fault fault, uint8_t detail = 0);

}  // namespace supervisor
}  // namespace planarm
