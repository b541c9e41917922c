// States, the commands that each allows, and the first fault. What a change of state does to drivers and
// motion is in supervisor.cpp; nothing else switches the drivers.
#pragma once

#include <stdint.h>

#include "messages.h"

namespace planarm {
namespace supervisor {

enum class Command : uint8_t { ENABLE, RELEASE, SEGMENTS, START, CLEAR };

// Idle, without a fault. For start-up.
void reset();

wire::State state();
wire::Fault fault();

// True when the state takes the command.
bool allows(Command command);

// Carries out the change of state that an allowed command brings.
void apply(Command command, uint32_t now_ticks);

// The motion came to its end.
void motion_done();

// Stops the steps and latches the fault. In the fault state nothing happens that could bring another.
void fail(wire::Fault fault, uint32_t now_ticks);

}  // namespace supervisor
}  // namespace planarm
